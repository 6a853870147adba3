"""The ways a caller of this package can be wrong."""


class EvolutionError(Exception):
    """Base class of the errors of this package."""


class RunError(EvolutionError, RuntimeError):
    """A run cannot start, continue or be read; the message names the folder or value and a remedy."""


class NoEnvironmentError(RunError):
    """The environment of trials cannot be made; of a shorter or narrower body it might."""
