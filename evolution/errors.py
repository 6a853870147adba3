"""The ways a caller of this package can be wrong."""


class RunError(RuntimeError):
    """A run cannot start, go on or be read; the message names the folder or value and a remedy."""
