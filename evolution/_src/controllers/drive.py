"""Tracks as part of the action: how fast each one runs where the body is to go ahead and to turn."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from evolution._src.controllers.namespaces import find_namespace
from evolution._src.controllers.protocol import Structure
from evolution._src.errors import RunError
from reconstruction._src.base.quantities import format_count
from reconstruction._src.base.range_checks import check_choice
from symbrion_gym._src.environment.config import SENSORS

if TYPE_CHECKING:
    from symbrion_gym._src.robot.organism import Organism

GOAL_SENSOR = "goal_direction"
"""Bearing of the goal, positive to the left of the head [rad], and its distance [m], by dead reckoning."""
TRACK_OFFSET = 0.0458
"""Distance of a track from the middle line of its module [m] (the authors' simulator, danfis/sim)."""
_SMALLEST_LEVER = 0.02
"""Tracks with shorter levers would move the body rather than turn it [m]; a module's own tracks have 0.0458."""
_ROUNDING = 1e-9
"""Cosines closer than this to a whole number are that number."""


@dataclass(frozen=True, eq=False)
class Drive:
    """Track speeds of a body that moves as a rigid one, read from one to three genes.

    A track at (x, y) from the middle of the body, of a module that looks along the angle a, runs at
    ``ahead * cos(a) + turn * (x * sin(a) - y * cos(a)) / longest lever`` of its full speed, in [-1, 1].

    Attributes:
        ahead: factor of each track on the speed ahead.
        lever: factor on the rate of turn, 1 at the track with the longest lever.
        bound: largest absolute value of a gene.
    """

    ahead: Float[np.ndarray, " T"]
    lever: Float[np.ndarray, " T"]
    bound: float

    @property
    def can_turn(self) -> bool:
        """Whether the tracks can turn the body."""
        return bool(np.any(self.lever))

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the genes: added to full speed; a constant rate of turn; a gain on the bearing of the goal."""
        if not len(self.ahead):
            return ()
        return ("track_speed_change", *(("track_turn", "track_steering") if self.can_turn else ()))

    @property
    def initial(self) -> tuple[float, ...]:
        """Genotype at which a search with a hint begins: full speed, toward the goal."""
        return (0.0, 0.0, 1.0)[: len(self.parameters)]

    @property
    def sensors(self) -> tuple[str, ...]:
        """Sensors that steering reads, as far as the environment has them."""
        return (GOAL_SENSOR,) if self.can_turn and GOAL_SENSOR in SENSORS else ()

    def act(
        self, genes: Float[Any, "P D"], observation: Float[Any, "P O"], structure: Structure
    ) -> Float[Any, "P T"]:
        """Return track speeds, as shares of their full speed."""
        xp = find_namespace(genes)
        if not len(self.ahead):
            return xp.zeros((len(genes), 0))
        speed = xp.clip(1.0 + genes[:, :1], -1.0, 1.0)
        if not self.can_turn:
            return speed * self.ahead
        toward_goal = xp.clip(genes[:, 2:3] * find_bearing(observation, structure), -1.0, 1.0)
        turn = xp.clip(genes[:, 1:2] + toward_goal, -1.0, 1.0)
        speed = speed * (1.0 - xp.abs(toward_goal))
        return xp.clip(speed * self.ahead + turn * self.lever, -1.0, 1.0)


def find_bearing(observation: Float[Any, "P O"], structure: Structure) -> Float[Any, "P 1"]:
    """Return the bearing of the goal, positive to the left [rad]; 0 where the observation lacks it."""
    if GOAL_SENSOR not in structure:
        return find_namespace(observation).zeros((len(observation), 1))
    first = structure[GOAL_SENSOR].start
    return find_namespace(observation).asarray(observation[:, first : first + 1], dtype=float)


def count_tracks(track_control: str, num_modules: int) -> int:
    """Return the number of track speeds in an action under the option `track_control` of the environment."""
    counts = {"constant": 0, "body": 1, "modules": num_modules, "skid": 2 * num_modules}
    check_choice("track_control", track_control, tuple(counts), RunError)
    return counts[track_control]


def make_drive(organism: Organism, num_tracks: int, bound: float) -> Drive:
    """Return how the tracks of a body drive it."""
    count = organism.num_modules
    if num_tracks not in (0, 1, count, 2 * count):
        raise RunError(
            f"num_tracks is {num_tracks}; a body of {format_count(count, 'module')} has 0, 1, {count} or {2 * count}"
        )
    if num_tracks <= 1:
        return Drive(np.ones(num_tracks), np.zeros(num_tracks), bound)
    poses = organism.find_poses()
    middle_x, middle_y = (np.mean([getattr(pose, axis) for pose in poses]) for axis in ("x", "y"))
    offsets = (0.0,) if num_tracks == count else (TRACK_OFFSET, -TRACK_OFFSET)
    ahead, lever = [], []
    for pose in poses:
        c, s = cos(pose.heading), sin(pose.heading)
        for offset in offsets:
            x, y = pose.x - offset * s - middle_x, pose.y + offset * c - middle_y
            ahead.append(c)
            lever.append(x * s - y * c)
    levers = np.where(np.abs(lever) > _SMALLEST_LEVER, lever, 0.0)
    return Drive(_round(np.array(ahead)), levers / max(np.abs(levers).max(), _SMALLEST_LEVER), bound)


def _round(cosines: Float[np.ndarray, " T"]) -> Float[np.ndarray, " T"]:
    """Return cosines with 0 and ±1 where only rounding is between them."""
    return np.where(np.abs(cosines - np.round(cosines)) < _ROUNDING, np.round(cosines), cosines)
