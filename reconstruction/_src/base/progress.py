"""Progress of long work, reported to the caller."""

from collections.abc import Callable

Progress = Callable[[str, float], None]
"""Called with the name of the present step and the fraction of all work done, 0 to 1."""


def silent(message: str, fraction: float) -> None:
    """Ignore the progress: the default everywhere."""
