"""Where and how a body starts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.tasks.route import Point, StartName

START_NAMES = ("floor", "pit")


@dataclass(frozen=True)
class Start:
    """Where a body starts, and whether it has been tumbled.

    Attributes:
        place: "floor": before the ramp or step, or the beginning of the way; "pit": before the pit; or (x, y) or
            (x, y, z) of the head [m], where z selects one of several storeys.
        roll: smallest and largest angle by which the body is turned about the axis of its head [rad]; drawn for
            every episode.

    Raises:
        TaskError: no such place, or angles that are no range.
    """

    place: StartName | Point = "floor"
    roll: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        place = self.place
        if isinstance(place, str):
            if place not in START_NAMES:
                raise TaskError(f"start must be {' or '.join(START_NAMES)}, or a place, got {place!r}")
        else:
            try:
                point = np.asarray(place, dtype=np.float64).ravel()
            except (TypeError, ValueError):
                point = np.zeros(0)
            if len(point) not in (2, 3) or not np.isfinite(point).all():
                raise TaskError(f"start must be a place (x, y) or (x, y, z) in meters, got {place!r}")
            object.__setattr__(self, "place", tuple(point.tolist()))
        if self.roll is not None:
            low, high = self.roll
            if not -np.pi <= low <= high <= np.pi:
                raise TaskError(f"roll must be (low, high) within -pi to pi, got {self.roll!r}")
            object.__setattr__(self, "roll", (float(low), float(high)))

    def randomize(self) -> Mapping[str, Any]:
        """Return the reset options that belong to the start."""
        return {} if self.roll is None else {"roll": self.roll}
