"""Docks of Scouts as arrays: where they are, which of them may latch, and what the latched ones form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from reconstruction._src.base.range_checks import check_not_negative, check_positive
from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.organism import Docking, Organism
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

    from symbrion_gym._src.swarm.world import SwarmState

_FRONT = SIDES.index("front")
_HALF_TURN = 180.0


@dataclass(frozen=True)
class DockConfig:
    """When two docking units latch, and when a latched pair tears.

    All numbers are estimates of ours: units were told apart by cones that center them, whose catch is not in the
    sources at hand. The protocol of the robots (symbrion-morph) locks once both units touch and are aligned.

    Raises:
        OrganismError: a value is out of range.
    """

    # largest gap between the units, beyond that of a docked pair [m]; also how far they may be pressed into
    # each other
    distance: float = 0.010
    offset: float = 0.010  # largest displacement to the side [m]
    height: float = 0.008  # largest displacement along the height of a module [m]
    angle: float = 10.0  # largest angle between one unit's axis and the other's reversed axis [deg]
    roll: float = 10.0  # largest rotation of the units against each other about their axis [deg]
    mating_time: float = 1.0  # in which the cones pull a latched pair to its exact pose [s]
    # whether a load above `dock_force` of the Scout opens a latch; else it is only reported
    tears: bool = False

    def __post_init__(self) -> None:
        check_positive(self, ("distance", "offset", "height", "angle", "roll"), OrganismError)
        check_not_negative(self, ("mating_time",), OrganismError)
        for name in ("angle", "roll"):
            if getattr(self, name) >= _HALF_TURN / 2:
                raise OrganismError(f"DockConfig.{name} must be below 90 degrees, got {getattr(self, name)}")
        if not isinstance(self.tears, bool):
            raise OrganismError(f"DockConfig.tears must be True or False, got {self.tears!r}")


class DockFrames(NamedTuple):
    """Frames of all docks in the arena; sides in the order of `SIDES`."""

    position: Float[np.ndarray, "N 4 3"]  # of the docks [m]
    axis: Float[np.ndarray, "N 4 3"]  # unit vectors out of the module
    # unit vectors along the height of the module, for the front dock that of its arm
    up: Float[np.ndarray, "N 4 3"]


def compute_dock_poses(
    state: SwarmState, scout: ScoutConfig | None = None
) -> tuple[Float[np.ndarray, "N 4 3"], Float[np.ndarray, "N 4 3"]]:
    """Return positions [m] and outward axes of the docks of all robots in the arena."""
    frames = compute_dock_frames(state, scout)
    return frames.position, frames.axis


def compute_dock_frames(state: SwarmState, scout: ScoutConfig | None = None) -> DockFrames:
    """Return positions, axes and ups of the docks of all robots in the arena; see `compute_dock_poses`."""
    scout = scout or ScoutConfig()
    places = np.array([scout.compute_dock(side) for side in SIDES])
    count = len(state.position)
    local = np.zeros((count, 4, 3, 3))
    local[:, :, 0, 0], local[:, :, 0, 1] = places[:, 0], places[:, 1]
    local[:, :, 1, 0], local[:, :, 1, 1] = np.cos(places[:, 2]), np.sin(places[:, 2])
    local[:, :, 2, 2] = 1.0
    cosine, sine = np.cos(state.hinge), np.sin(state.hinge)
    ahead = np.stack([cosine, np.zeros(count), sine], axis=1)
    local[:, _FRONT, 0], local[:, _FRONT, 1] = scout.arm_reach * ahead, ahead
    local[:, _FRONT, 2] = np.stack([-sine, np.zeros(count), cosine], axis=1)
    turned = np.einsum("nij,nskj->nksi", state.rotation, local)
    return DockFrames(turned[:, 0] + state.position[:, None], turned[:, 1], turned[:, 2])


def find_matches(
    state: SwarmState,
    latch: Bool[np.ndarray, "N 4"],
    config: DockConfig | None = None,
    scout: ScoutConfig | None = None,
) -> tuple[Docking, ...]:
    """Return the dockings that form now: pairs of free docks within tolerance that are both told to latch.

    The nearest pairs come first. A pair that would close a ring, or whose modules would overlap with straight hinges,
    does not latch, as an organism is a tree.
    """
    config, scout = config or DockConfig(), scout or ScoutConfig()
    wanted = np.array(latch, bool)
    for link in state.links:
        for module, side in link.ends:
            wanted[module, SIDES.index(side)] = False
    if np.count_nonzero(wanted) < 2:
        return ()
    robots, sides = np.nonzero(wanted)
    frames = DockFrames(*(field[robots, sides] for field in compute_dock_frames(state, scout)))
    first, second, distance = _find_close_pairs(frames, config, scout)
    is_other = robots[first] != robots[second]
    order = np.argsort(distance[is_other], kind="stable")
    links, found = list(state.links), []
    for i, j in zip(first[is_other][order], second[is_other][order], strict=True):
        new = make_docking(int(robots[i]), SIDES[sides[i]], int(robots[j]), SIDES[sides[j]])
        if can_join(new, links, len(state.position), scout):
            links.append(new)
            found.append(new)
    return sort_links(found)


def _find_close_pairs(
    frames: DockFrames, config: DockConfig, scout: ScoutConfig
) -> tuple[Int[np.ndarray, " P"], Int[np.ndarray, " P"], Float[np.ndarray, " P"]]:
    """Return indices and distances of the pairs of docks within tolerance; first < second."""
    from scipy.spatial import cKDTree

    reach = float(np.linalg.norm([config.distance + scout.dock_gap, config.offset, config.height]))
    pairs = cKDTree(frames.position).query_pairs(reach, output_type="ndarray")
    first, second = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))].T
    between = frames.position[second] - frames.position[first]
    facing = -np.einsum("pi,pi->p", frames.axis[first], frames.axis[second])
    axis = frames.axis[first] - frames.axis[second]
    axis /= np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), np.finfo(float).tiny)
    up = frames.up[first] - np.einsum("pi,pi->p", frames.up[first], axis)[:, None] * axis
    other_up = frames.up[second] - np.einsum("pi,pi->p", frames.up[second], axis)[:, None] * axis
    roll = np.arctan2(
        np.einsum("pi,pi->p", np.cross(up, other_up), axis), np.einsum("pi,pi->p", up, other_up)
    )
    side = np.cross(axis, up)
    gap, height, offset = (np.einsum("pi,pi->p", between, each) for each in (axis, up, side))
    is_close = (
        (np.abs(gap - scout.dock_gap) <= config.distance)
        & (np.abs(offset) <= config.offset)
        & (np.abs(height) <= config.height)
        & (facing >= np.cos(np.deg2rad(config.angle)))
        & (np.abs(roll) <= np.deg2rad(config.roll))
    )
    return first[is_close], second[is_close], np.linalg.norm(between, axis=1)[is_close]


def find_released(links: Sequence[Docking], latch: Bool[np.ndarray, "N 4"]) -> tuple[Docking, ...]:
    """Return the latched dockings of which at least one end is told not to latch."""
    return tuple(
        link for link in links if not all(latch[module, SIDES.index(side)] for module, side in link.ends)
    )


def find_groups(links: Sequence[Docking], num_robots: int) -> Int[np.ndarray, " N"]:
    """Return for each robot the smallest index in its group of docked robots; its own where it is alone."""
    groups = np.arange(num_robots)
    for link in links:
        one, other = groups[link.first], groups[link.second]
        groups[groups == max(one, other)] = min(one, other)
    return groups


def make_docking(robot: int, side: str, other: int, other_side: str) -> Docking:
    """Return the docking of two docks, the smaller index first."""
    ends = sorted([(robot, side), (other, other_side)])
    return Docking(*ends[0], *ends[1])


def sort_links(links: Sequence[Docking]) -> tuple[Docking, ...]:
    """Return dockings in the order of `SwarmState.links`."""
    return tuple(sorted(links, key=lambda link: link.ends))


def can_join(new: Docking, links: Sequence[Docking], num_robots: int, scout: ScoutConfig) -> bool:
    """Return whether a docking leaves its group a tree whose modules do not overlap with straight hinges."""
    groups = find_groups(links, num_robots)
    if groups[new.first] == groups[new.second]:
        return False
    members = np.flatnonzero(np.isin(groups, groups[[new.first, new.second]]))
    try:
        make_organism([*links, new], members.tolist(), scout)
    except OrganismError:
        return False
    return True


def make_organism(
    links: Sequence[Docking],
    members: Sequence[int],
    scout: ScoutConfig | None = None,
    root: int | None = None,
) -> tuple[Organism, tuple[int, ...]]:
    """Return the organism that docked robots form, and which robot is which of its modules.

    Modules are numbered from the root, depth first with the docks of a module in the order of `SIDES`: robots that are
    docked front to back in a row form the very organism of `snake`.
    """
    neighbors: dict[int, list[tuple[int, int, str]]] = {robot: [] for robot in sorted(members)}
    for link in links:
        for (one, side), (other, other_side) in (link.ends, link.ends[::-1]):
            if one in neighbors:
                neighbors[one].append((SIDES.index(side), other, other_side))
    if root is None:
        free = [robot for robot, docked in neighbors.items() if all(side != _FRONT for side, _, _ in docked)]
        root = min(free or neighbors)
    order, dockings = [root], []
    waiting = _list_children(neighbors, root, -1)
    while waiting:
        parent, side, robot, robot_side = waiting.pop()
        if robot in order:
            raise OrganismError(f"robots {sorted(members)} are docked in a ring; release one docking")
        dockings.append(Docking(len(order), robot_side, order.index(parent), SIDES[side]))
        order.append(robot)
        waiting += _list_children(neighbors, robot, parent)
    return Organism(len(members), tuple(dockings), scout or ScoutConfig()), tuple(order)


def _list_children(
    neighbors: dict[int, list[tuple[int, int, str]]], robot: int, parent: int
) -> list[tuple[int, int, int, str]]:
    """Return what is docked to a robot beyond its parent, the last side first."""
    if robot not in neighbors:
        raise OrganismError(f"robot {robot} is docked to the group but no member of it; name it as well")
    children = sorted((each for each in neighbors[robot] if each[1] != parent), reverse=True)
    return [(robot, side, other, other_side) for side, other, other_side in children]
