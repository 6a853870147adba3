"""Places in a plane: how modules lie beside each other when all hinges are straight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Pose:
    """A place in the plane of a body.

    Attributes:
        x: [m].
        y: [m].
        heading: about z [rad].
    """

    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0

    @property
    def position(self) -> list[float]:
        """As MuJoCo wants it, `[3]` [m]."""
        return [self.x, self.y, 0.0]

    @property
    def quaternion(self) -> list[float]:
        """As MuJoCo wants it, w first."""
        return [np.cos(self.heading / 2), 0.0, 0.0, np.sin(self.heading / 2)]

    def compose(self, other: Pose) -> Pose:
        """Return the pose of `other`, given in this frame, in the frame of this one's parent."""
        c, s = np.cos(self.heading), np.sin(self.heading)
        return Pose(
            self.x + c * other.x - s * other.y,
            self.y + s * other.x + c * other.y,
            self.heading + other.heading,
        )

    def invert(self) -> Pose:
        """Return the pose of the parent in this frame."""
        c, s = np.cos(self.heading), np.sin(self.heading)
        return Pose(-c * self.x - s * self.y, s * self.x - c * self.y, -self.heading)
