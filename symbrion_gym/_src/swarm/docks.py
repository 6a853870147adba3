"""Docks of Scouts as arrays: where they are, which of them may latch, and what the latched ones form.

All tolerances are estimates of ours: units were told apart by cones that center them, whose catch is not in the sources
at hand. The protocol of the robots (symbrion-morph) locks once both units touch and are aligned.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction._src.geometry.rows import cross_rows, dot_rows
from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.organism import Docking, Organism
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig
from symbrion_gym._src.swarm.world import FRONT, SwarmState

SCOUT = ScoutConfig()  # All robots of a swarm have its shape
LARGEST_GAP = 0.010
"""Largest gap between the units, beyond that of a docked pair [m]; also how far they may be pressed into each other."""
LARGEST_OFFSET = 0.010  # Largest displacement to the side [m]
LARGEST_RISE = 0.008  # Largest displacement along the height of a module [m]
LARGEST_ANGLE = np.deg2rad(10.0)  # Largest angle between one unit's axis and the other's reversed axis [rad]
LARGEST_ROLL = np.deg2rad(10.0)  # Largest rotation of the units against each other about their axis [rad]
_REACH = float(np.linalg.norm([LARGEST_GAP + SCOUT.dock_gap, LARGEST_OFFSET, LARGEST_RISE]))  # Of all [m]
MATING_TIME = 1.0  # In which the cones pull a latched pair to its exact pose [s]


class DockFrames(NamedTuple):
    """Frames of all docks in the arena; sides in the order of `SIDES`."""

    position: Float[np.ndarray, "N 4 3"]  # of the docks [m]
    axis: Float[np.ndarray, "N 4 3"]  # unit vectors out of the module
    # unit vectors along the height of the module, for the front dock that of its arm
    up: Float[np.ndarray, "N 4 3"]


def compute_dock_frames(state: SwarmState) -> DockFrames:
    """Return positions, axes and ups of the docks of all robots in the arena."""
    count = len(state.position)
    local = np.tile(_find_frames(), (count, 1, 1, 1))
    cosine, sine, zero = np.cos(state.hinge), np.sin(state.hinge), np.zeros(count)
    ahead = np.stack([cosine, zero, sine], axis=1)
    local[:, FRONT, 0], local[:, FRONT, 1] = SCOUT.arm_reach * ahead, ahead
    local[:, FRONT, 2] = np.stack([-sine, zero, cosine], axis=1)
    turned = (local.reshape(count, 12, 3) @ state.rotation.transpose(0, 2, 1)).reshape(local.shape)
    return DockFrames(turned[:, :, 0] + state.position[:, None], turned[:, :, 1], turned[:, :, 2])


@lru_cache
def _find_frames() -> Float[np.ndarray, "4 3 3"]:
    """Return place, axis and up of each dock in the frame of a module, its hinge at 0."""
    x, y, heading = np.array([SCOUT.compute_dock(side) for side in SIDES]).T
    zero, one = np.zeros(len(SIDES)), np.ones(len(SIDES))
    return np.array([[x, y, zero], [np.cos(heading), np.sin(heading), zero], [zero, zero, one]]).transpose(
        2, 0, 1
    )


def change_links(state: SwarmState, latch: Bool[np.ndarray, "N 4"]) -> tuple[list[Docking], list[Docking]]:
    """Return the dockings that open, as one of their ends is told not to latch, and those that form."""
    gone = [
        link
        for link in state.links
        if not all(latch[module, SIDES.index(side)] for module, side in link.ends)
    ]
    kept = tuple(link for link in state.links if link not in gone)
    return gone, find_matches(state._replace(links=kept), latch)


def find_matches(state: SwarmState, latch: Bool[np.ndarray, "N 4"]) -> list[Docking]:
    """Return the dockings that form now: pairs of free docks within tolerance that are both told to latch.

    The nearest pairs come first. A pair that would close a ring, or whose modules would overlap with straight hinges,
    does not latch, as an organism is a tree.
    """
    robots, sides = np.nonzero(np.asarray(latch, bool) & ~state.docked)
    if len(robots) < 2:
        return []
    from scipy.spatial import cKDTree

    frames = DockFrames(*(field[robots, sides] for field in compute_dock_frames(state)))
    pairs = cKDTree(frames.position).query_pairs(_REACH, output_type="ndarray")
    if len(pairs) == 0:
        return []
    first, second, distance = _choose_close(frames, *pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))].T)
    is_other = robots[first] != robots[second]
    order = np.argsort(distance[is_other], kind="stable")
    links, found = list(state.links), []
    for i, j in zip(first[is_other][order], second[is_other][order], strict=True):
        ends = sorted([(int(robots[i]), SIDES[sides[i]]), (int(robots[j]), SIDES[sides[j]])])
        new = Docking(*ends[0], *ends[1])
        if can_join(new, links, len(state.position)):
            links.append(new)
            found.append(new)
    return found


def _choose_close(
    frames: DockFrames, first: Int[np.ndarray, " A"], second: Int[np.ndarray, " A"]
) -> tuple[Int[np.ndarray, " P"], Int[np.ndarray, " P"], Float[np.ndarray, " P"]]:
    """Return indices and distances of the pairs of docks within tolerance."""
    between = frames.position[second] - frames.position[first]
    facing = -dot_rows(frames.axis[first], frames.axis[second])
    axis = frames.axis[first] - frames.axis[second]
    axis /= np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), np.finfo(float).tiny)
    up, other_up = (
        frames.up[end] - dot_rows(frames.up[end], axis)[:, None] * axis for end in (first, second)
    )
    roll = np.arctan2(dot_rows(cross_rows(up, other_up), axis), dot_rows(up, other_up))
    gap, rise, offset = (dot_rows(between, each) for each in (axis, up, cross_rows(axis, up)))
    is_close = (
        (np.abs(gap - SCOUT.dock_gap) <= LARGEST_GAP)
        & (np.abs(offset) <= LARGEST_OFFSET)
        & (np.abs(rise) <= LARGEST_RISE)
        & (facing >= np.cos(LARGEST_ANGLE))
        & (np.abs(roll) <= LARGEST_ROLL)
    )
    return first[is_close], second[is_close], np.linalg.norm(between, axis=1)[is_close]


def find_groups(links: Sequence[Docking], num_robots: int) -> Int[np.ndarray, " N"]:
    """Return for each robot the smallest index in its group of docked robots; its own where it is alone."""
    groups = np.arange(num_robots)
    for link in links:
        one, other = groups[link.first], groups[link.second]
        groups[groups == max(one, other)] = min(one, other)
    return groups


def sort_links(links: Sequence[Docking]) -> tuple[Docking, ...]:
    """Return dockings in the order of `SwarmState.links`."""
    return tuple(sorted(links, key=lambda link: link.ends))


def can_join(new: Docking, links: Sequence[Docking], num_robots: int) -> bool:
    """Return whether a docking leaves its group a tree whose modules do not overlap with straight hinges."""
    groups = find_groups(links, num_robots)
    if groups[new.first] == groups[new.second]:
        return False
    members = np.flatnonzero(np.isin(groups, groups[[new.first, new.second]]))
    try:
        make_organism([*links, new], members.tolist(), SCOUT)
    except OrganismError:
        return False
    return True


def make_organism(
    links: Sequence[Docking], members: Sequence[int], scout: ScoutConfig, root: int | None = None
) -> tuple[Organism, tuple[int, ...]]:
    """Return the organism that docked robots form, and which robot is which of its modules.

    Modules are numbered from the root, depth first with the docks of a module in the order of `SIDES`: robots that are
    docked front to back in a row form the very organism of `snake`.
    """
    neighbors: dict[int, list[tuple[int, int, int, str]]] = {robot: [] for robot in sorted(members)}
    for link in links:
        for (one, side), (other, other_side) in (link.ends, link.ends[::-1]):
            if one in neighbors:
                neighbors[one].append((other, one, SIDES.index(side), other_side))
    if root is None:
        free = [robot for robot, ways in neighbors.items() if all(side != FRONT for _, _, side, _ in ways)]
        root = min(free or neighbors)
    order: list[int] = []
    dockings: list[Docking] = []
    waiting = [(root, -1, -1, "")]
    while waiting:
        robot, parent, side, robot_side = waiting.pop()
        if robot in order:
            raise OrganismError(f"robots {sorted(members)} are docked in a ring; release one docking")
        if robot not in neighbors:
            raise OrganismError(f"robot {robot} is docked to the group but no member of it; name it as well")
        if parent >= 0:
            dockings.append(Docking(len(order), robot_side, order.index(parent), SIDES[side]))
        order.append(robot)
        children = [each for each in neighbors[robot] if each[0] != parent]
        waiting += sorted(children, key=lambda child: child[2], reverse=True)
    return Organism(len(members), tuple(dockings), scout), tuple(order)
