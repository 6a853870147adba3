"""A linear policy for bodies that drive alone: from the place to head for and the distance sensors to the tracks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evolution._src.controllers.protocol import Structure
from symbrion_gym._src.robot.scout_constants import ScoutConfig

_NUM_IR = 8


@dataclass(frozen=True)
class GoalPolicy:
    """Set each track speed to a linear function of the goal's direction and the distances; see `Controller`.

    Attributes:
        num_tracks: number of track speeds in an action.
        name: of the controller.
        version: of the controller.
    """

    num_tracks: int
    name: str = "goal"
    version: str = "1"
    sensors: tuple[str, ...] = ("ir", "goal")

    @property
    def parameters(self) -> tuple[str, ...]:
        """Name of each gene: weights of every track."""
        inputs = ("bias", "goal_ahead", "goal_left", *(f"ir_{index}" for index in range(_NUM_IR)))
        return tuple(f"track_{track}_{each}" for track in range(self.num_tracks) for each in inputs)

    @property
    def lower(self) -> tuple[float, ...]:
        """Smallest values."""
        return (-3.0,) * len(self.parameters)

    @property
    def upper(self) -> tuple[float, ...]:
        """Largest values."""
        return (3.0,) * len(self.parameters)

    @property
    def initial(self) -> tuple[float, ...]:
        """Zero."""
        return (0.0,) * len(self.parameters)

    def begin(self, count: int) -> tuple[()]:
        """Return no state."""
        return ()

    def act(
        self, observation: np.ndarray, genotype: np.ndarray, structure: Structure, state: tuple[()]
    ) -> tuple[np.ndarray, tuple[()]]:
        """Return track speeds."""
        goal = observation[:, structure["goal"]]
        goal = goal / np.maximum(np.linalg.norm(goal, axis=1, keepdims=True), 1e-9)
        near = 1.0 - observation[:, structure["ir"]] / ScoutConfig.ir_range
        inputs = np.concatenate([np.ones((len(goal), 1)), goal, near], axis=1)
        weights = genotype.reshape(len(goal), self.num_tracks, -1)
        return np.clip(np.einsum("pti,pi->pt", weights, inputs), -1.0, 1.0), state
