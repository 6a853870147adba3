"""How the hinges of an organism lie in its tree of modules, as arrays that control laws index with."""

from dataclasses import dataclass
from math import cos, sin
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float, Int

from evolution._src.controllers.protocol import Structure
from evolution._src.errors import RunError
from reconstruction._src.base.range_checks import format_count

if TYPE_CHECKING:
    from symbrion_gym._src.robot.organism import Organism


def find_namespace(array: Any) -> Any:
    """Return NumPy for its arrays, and `jax.numpy` for those of JAX."""
    return np if isinstance(array, np.ndarray) else array.__array_namespace__()


def add_to_column(array: Any, column: int, values: Any) -> Any:
    """Return an array with values added to a column; of NumPy, it is the same array."""
    if isinstance(array, np.ndarray):
        array[:, column] += values
        return array
    return array.at[:, column].add(values)


_ROUNDING = 1e-9  # What differs by less from a whole number is that number: snakes step by whole modules


@dataclass(frozen=True, eq=False)
class Joints:
    """Hinges in a tree of modules. Hinge i belongs to the module `own[i]`, and joins it to `ahead[i]` in front of it.

    A positive angle lifts what is ahead. "Inclination" is that of a module along the direction in which the hinge's
    own module looks: the pitch of a module that looks the same way, the roll of one that is docked sideways.
    """

    num_modules: int  # number of modules
    # number of servos that rotate arms: as many as hinges, or none. Only `oscillators` moves them.
    num_twists: int
    own: Int[np.ndarray, " h"]  # module that each hinge belongs to
    ahead: Int[np.ndarray, " h"]  # module docked to its front
    # column of the inclination of `ahead` in pitches, followed by rolls where `has_rolls`
    ahead_column: Int[np.ndarray, " h"]
    ahead_sign: Float[np.ndarray, " h"]  # factor on it
    has_rolls: bool  # whether a roll is needed
    # modules on the side of `ahead`, which the hinge separates from the rest
    ahead_part: Bool[np.ndarray, "h n"]
    is_head: Bool[np.ndarray, " h"]  # whether the hinge joins module 0, the head, to another
    # whether it joins a module at an end of the tree, other than the head, to another
    is_tail: Bool[np.ndarray, " h"]
    depth: Int[np.ndarray, " h"]  # number of dockings from the head to the farther of its modules
    # cosine of the angle between its own module and the head, in the straight body
    along: Float[np.ndarray, " h"]
    # 1 where its own module lies to the left of the head's middle line, -1 to the right, 0 on it
    side: Float[np.ndarray, " h"]
    dock: tuple[str, ...]  # side of `ahead` that its own module is docked to
    parents: tuple[int, ...]  # module that each module is docked to on its way to the head, -1 for the head
    order: tuple[int, ...]  # modules other than the head, each after its parent
    # how far behind its parent each module lies along the head's direction, in units of a module's length
    steps: Float[np.ndarray, " n"]

    def compute_inclination_ahead(
        self, pitch: Float[Any, "P n"], roll: Float[Any, "P n"] | None = None
    ) -> Float[Any, "P h"]:
        """Return the inclination of the module ahead of each hinge [rad]."""
        both = pitch if roll is None else find_namespace(pitch).concatenate((pitch, roll), axis=1)
        return both[:, self.ahead_column] * self.ahead_sign


def find_joints(organism: "Organism") -> Joints:
    """Return how the hinges of an organism lie in its tree."""
    count, parents, order = organism.num_modules, organism.parents, organism.order[1:]
    poses, pitch = organism.compute_poses(), organism.scout.pitch
    joined = [pair for docking in organism.dockings for pair in (docking.ends, docking.ends[::-1])]
    fronts = {module: other for (module, side), other in joined if side == "front"}
    num_dockings = np.bincount(np.array([module for (module, _), _ in joined], dtype=int), minlength=count)
    own = np.array(organism.hinges, dtype=np.int64)
    ahead = np.array([fronts[module][0] for module in organism.hinges], dtype=np.int64)
    headings = np.array([pose.heading for pose in poses])
    turns = headings[own] - headings[ahead]
    is_sideways = np.abs(np.cos(turns)) < 0.5
    is_end = (num_dockings == 1) & (np.arange(count) > 0)
    depths, beyond = np.zeros(count, dtype=np.int64), np.eye(count, dtype=bool)
    for module in order:
        depths[module] = depths[parents[module]] + 1
    for module in order[::-1]:
        beyond[parents[module]] |= beyond[module]
    is_nearer = np.array(parents, dtype=np.int64)[ahead] == own
    steps = [0.0 if j < 0 else (poses[j].x - poses[i].x) / pitch for i, j in enumerate(parents)]
    return Joints(
        num_modules=count,
        num_twists=len(organism.servos) - len(own),
        own=own,
        ahead=ahead,
        ahead_column=ahead + count * is_sideways,
        ahead_sign=_snap(np.where(is_sideways, np.sin(turns), np.cos(turns))),
        has_rolls=bool(is_sideways.any()),
        ahead_part=np.where(is_nearer[:, None], beyond[ahead], ~beyond[own]),
        is_head=(own == 0) | (ahead == 0),
        is_tail=is_end[own] | is_end[ahead],
        depth=np.maximum(depths[own], depths[ahead]),
        along=_snap(np.cos(headings[own])) + 0.0,  # without -0
        side=np.sign(_snap(np.array([poses[i].y / pitch for i in own], dtype=float))) + 0.0,
        dock=tuple(fronts[module][1] for module in organism.hinges),
        parents=parents,
        order=order,
        steps=_snap(np.array(steps)) + 0.0,
    )


def _snap(values: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
    """Return numbers, whole ones where only rounding is between them."""
    whole = np.round(values)
    return np.where(np.abs(values - whole) < _ROUNDING, whole, values)


GOAL_SENSOR = "goal_direction"
"""Bearing of the goal, positive to the left of the head [rad], and its distance [m], by dead reckoning."""
TRACK_OFFSET = 0.0458
"""Distance of a track from the middle line of its module [m] (the authors' simulator, danfis/sim)."""
_SMALLEST_LEVER = 0.02
"""Tracks with shorter levers would move the body rather than turn it [m]; a module's own tracks have 0.0458."""


@dataclass(frozen=True, eq=False)
class Drive:
    """Track speeds of a body that moves as a rigid one, read from one or two genes.

    A track at (x, y) from the middle of the body, of a module that looks along the angle a, runs at
    ``ahead * cos(a) + turn * (x * sin(a) - y * cos(a)) / longest lever`` of its full speed, in [-1, 1].
    """

    ahead: Float[np.ndarray, " T"]  # factor of each track on the speed ahead
    lever: Float[np.ndarray, " T"]  # factor on the rate of turn, 1 at the track with the longest lever
    bound: float  # largest absolute value of a gene

    @property
    def can_turn(self) -> bool:
        """Whether the tracks can turn the body."""
        return bool(np.any(self.lever))

    @property
    def genes(self) -> dict[str, float]:
        """Genes, and where a search with a hint begins: what is added to full speed, and a gain on the bearing of the
        goal. None turns the body whatever it senses: an arc would follow a way on one arena, and on no other."""
        turns = {"track_steering": 1.0} if self.can_turn else {}
        return {"track_speed_change": 0.0} | turns if len(self.ahead) else {}

    @property
    def sensors(self) -> tuple[str, ...]:
        """Sensors that steering reads."""
        return (GOAL_SENSOR,) if self.can_turn else ()

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
        turn = xp.clip(genes[:, 1:2] * compute_bearing(observation, structure), -1.0, 1.0)
        return self.run(speed * (1.0 - xp.abs(turn)), turn)

    def run(self, speed: Float[Any, "P 1"], turn: Float[Any, "P 1"]) -> Float[Any, "P T"]:
        """Return track speeds of a speed ahead and a rate of turn, all as shares of the full ones."""
        return find_namespace(speed).clip(speed * self.ahead + turn * self.lever, -1.0, 1.0)


def compute_bearing(observation: Float[Any, "P O"], structure: Structure) -> Float[Any, "P 1"]:
    """Return the bearing of the goal, positive to the left [rad]; 0 where the observation lacks it."""
    xp, part = find_namespace(observation), structure.get(GOAL_SENSOR)
    if part is None:
        return xp.zeros((len(observation), 1))
    return xp.asarray(observation[:, part.start : part.start + 1], dtype=float)


def make_drive(organism: "Organism", num_tracks: int, bound: float) -> Drive:
    """Return how the tracks of a body drive it."""
    count = organism.num_modules
    if num_tracks not in (0, 1, count, 2 * count):
        raise RunError(
            f"num_tracks is {num_tracks}; a body of {format_count(count, 'module')} has 0, 1, {count} or {2 * count}"
        )
    if num_tracks <= 1:
        return Drive(np.ones(num_tracks), np.zeros(num_tracks), bound)
    poses = organism.compute_poses()
    middle_x, middle_y = (np.mean([getattr(pose, axis) for pose in poses]) for axis in ("x", "y"))
    ahead, lever = [], []
    for pose in poses:
        c, s = cos(pose.heading), sin(pose.heading)
        for offset in (0.0,) if num_tracks == count else (TRACK_OFFSET, -TRACK_OFFSET):
            x, y = pose.x - offset * s - middle_x, pose.y + offset * c - middle_y
            ahead.append(c)
            lever.append(x * s - y * c)
    levers = np.where(np.abs(lever) > _SMALLEST_LEVER, lever, 0.0)
    return Drive(_snap(np.array(ahead)), levers / max(np.abs(levers).max(), _SMALLEST_LEVER), bound)
