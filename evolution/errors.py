"""The ways a caller of this package can be wrong."""


class EvolutionError(Exception):
    """Base class of the errors of this package."""


class RunError(EvolutionError, RuntimeError):
    """A run cannot start, continue or be read; the message names the folder or value and a remedy."""
