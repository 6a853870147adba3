"""A controller of two genes that drives a Scout toward its goal, or past it first."""

from typing import Any

import numpy as np
from jaxtyping import Float

_GAIN = 3.0
"""Difference of the tracks per error of the heading [1/rad]."""
_RAMP = 0.3
"""Distance over which it turns from the detour to the goal [m]."""


class Detour:
    """Keep the goal `side` radians to the left until it is `near` meters away, then head for it."""

    name, version, sensors = "detour", "1", ("goal",)
    parameters, initial = ("side", "near"), (0.0, 1.0)
    lower, upper = (-1.2, 0.0), (1.2, 3.0)

    def __init__(self, organism: object) -> None:
        """Take any body of one module."""

    def begin(self, count: int) -> tuple[()]:
        """Return no state."""
        return ()

    def act(
        self,
        observation: Float[np.ndarray, "P O"],
        genotype: Float[np.ndarray, "P 2"],
        structure: dict[str, slice],
        state: tuple[()],
    ) -> tuple[Float[np.ndarray, "P 2"], Any]:
        """Return the speeds of the left and of the right track, as shares of the full speed."""
        ahead, left = observation[:, structure["goal"]].astype(float).T
        share = np.clip((np.hypot(ahead, left) - genotype[:, 1]) / _RAMP, 0.0, 1.0)
        turn = np.clip(_GAIN * (np.arctan2(left, ahead) - share * genotype[:, 0]), -1.0, 1.0)
        return np.clip(np.stack([1.0 - turn, 1.0 + turn], axis=1), -1.0, 1.0), state
