"""How long work tells its caller how far it is."""

from collections.abc import Callable

Progress = Callable[[str, float], None]
"""Called with what is being done and the fraction that is done, 0 to 1."""


def silent(message: str, fraction: float) -> None:
    """Ignore the progress: the default everywhere."""
