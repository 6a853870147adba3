"""Colors of exact courses, by position: what a camera sees of them, and what is compared with."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from symbrion_gym._src.errors import ArenaError

_EDGE = 0.3
"""Of a cube of the checker, and width of a stripe [m]."""
_SHIFT = np.array([0.15, 0.0, 0.125])
"""Of the cubes: no floor, plateau or wall of the courses lies on a side of one [m]."""
_CHECKER = np.array([[0.85, 0.45, 0.20], [0.15, 0.35, 0.65]])
_STRIPES = np.array([[0.80, 0.25, 0.25], [0.90, 0.80, 0.30], [0.25, 0.60, 0.35], [0.30, 0.40, 0.75]])
_WAVES = np.array([[0.9, 0.4, 0.5], [-0.6, 1.1, 0.7], [0.5, -0.8, 1.3]])
"""Wave vectors of red, green and blue in the gradient [rad/m]."""
_MIDDLE, _SWING = 0.5, 0.35
"""Of a channel of the gradient."""


def _paint_checker(places: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
    cube = np.floor((places - _SHIFT) / _EDGE).astype(np.int64)
    return _CHECKER[cube.sum(axis=1) % len(_CHECKER)]


def _paint_stripes(places: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
    stripe = np.floor((places[:, 0] - _SHIFT[0]) / _EDGE).astype(np.int64)
    return _STRIPES[stripe % len(_STRIPES)]


def _paint_gradient(places: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
    return _MIDDLE + _SWING * np.sin(places @ _WAVES.T)


PATTERNS: dict[str, Callable[[Float[np.ndarray, "N 3"]], Float[np.ndarray, "N 3"]]] = {
    "checker": _paint_checker,
    "stripes": _paint_stripes,
    "gradient": _paint_gradient,
}
"""Name -> the function that returns red, green and blue (0 to 1) of positions [m]."""


def check_pattern(pattern: str | None) -> None:
    """Refuse a pattern that there is not; None is none."""
    if pattern is not None and pattern not in PATTERNS:
        raise ArenaError(f"color_pattern is {pattern!r}; there are: {', '.join(PATTERNS)}, or None")
