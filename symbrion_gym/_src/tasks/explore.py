"""Goals that are no place: to see as much of the ground as possible, and to stand up after a tumble."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction._src.base.range_checks import check_positive
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import ArenaError, TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.goals import check_share, find_honest, find_standing
from symbrion_gym._src.tasks.paths import find_path
from symbrion_gym._src.tasks.route import Route, Start, find_ground_map
from symbrion_gym._src.tasks.state import Scene, TaskState, add_up

_SIGHT = 4.0  # Modules see as far as this many of their lengths
_LOOKS = 5
"""The ground is looked at in the first tick and every so many: at 0.1 m/s a module moves 1 cm in between."""


class Cells(NamedTuple):
    """Ground as a grid, with room around it for what is seen from its rim."""

    origin: Float[np.ndarray, " 2"]  # (x, y) of the middle of the first cell [m]
    shape: tuple[int, int]  # number of cells along x and y
    pad: int  # number of cells of the room around the ground
    is_ground: Bool[np.ndarray, " C"]  # whether there is ground that can be reached
    disc: Int[np.ndarray, " D"]  # numbers of the cells that are seen from one, relative to it

    def find_seen(self, xp: Any, place: Float[Any, "M 2"], edge: float) -> Int[Any, "M D"]:
        """Return the numbers of the cells that are seen from places; one outside the grid counts as at its rim."""
        index = xp.nan_to_num(xp.round((place - self.origin) / edge))
        index = xp.clip(index, self.pad, np.array(self.shape) - self.pad - 1).astype(int)
        middle = index[:, 0] * self.shape[1] + index[:, 1]
        return middle[:, None] + self.disc


@dataclass(frozen=True, eq=False, kw_only=True)
class AreaRoute(Route):
    """A start, and the ground that can be reached from it."""

    # middles of the cells of this ground [m]
    places: Float[np.ndarray, "C 2"]
    edge: float  # edge of a cell [m]
    sight: float  # how far a module sees [m]

    @property
    def area(self) -> float:
        """Area of the ground in plan [m²]."""
        return len(self.places) * self.edge**2

    @cached_property
    def cells(self) -> Cells:
        """The ground as a grid."""
        pad = int(np.ceil(self.sight / self.edge)) + 1
        origin = self.places.min(axis=0) - pad * self.edge
        index = np.round((self.places - origin) / self.edge).astype(np.int64)
        width, depth = (index.max(axis=0) + pad + 1).tolist()
        is_ground = np.zeros(width * depth, dtype=bool)
        is_ground[index[:, 0] * depth + index[:, 1]] = True
        reach = np.arange(-pad, pad + 1)
        x, y = (each.ravel() for each in np.meshgrid(reach, reach, indexing="ij"))
        near = np.hypot(x, y) * self.edge <= self.sight
        return Cells(origin, (width, depth), pad, is_ground, (x * depth + y)[near])


def _read_area(scene: Scene) -> AreaRoute:
    assert isinstance(scene.route, AreaRoute)
    return scene.route


@dataclass(frozen=True)
class SeeGround:
    """See a share of the ground that the body can reach from its start.

    Ground is seen when module 0 has been within `sight` of it.

    Raises:
        TaskError: a number is out of range.
    """

    share: float = 0.6  # share of the ground that has to be seen
    sight: float | None = None  # how far a module sees [m]; None for four of its lengths

    def __post_init__(self) -> None:
        check_share(self.share)
        if self.sight is not None:
            check_positive(self, ("sight",), TaskError)

    def find(self, arena: Arena, organism: Organism, start: Start) -> AreaRoute:
        """Find the start on the map, and the ground that is connected to it."""
        path = find_path(arena, organism, start, ())
        ground = find_ground_map(arena, organism)
        at = np.array(path.place(path.start))
        drivable = np.flatnonzero(ground.is_drivable)
        nearest = drivable[np.argmin(np.linalg.norm(ground.positions[drivable, :2] - at, axis=1))]
        inside = ground.positions[ground.region == ground.region[nearest], :2]
        if not len(inside):
            raise ArenaError(f"arena {arena.name!r} has no ground to explore; give a smaller body")
        given = {each.name: getattr(path, each.name) for each in fields(Route)}
        sight = _SIGHT * organism.scout.size[0] if self.sight is None else self.sight
        return AreaRoute(**given, places=np.unique(inside, axis=0), edge=ground.grid.cell, sight=sight)

    def progress(self, state: TaskState) -> Float[Any, " N"]:
        """Return the area that was seen [m²]."""
        xp, looks = state.xp, (state.tick % _LOOKS == 0) | (state.tick == 1)
        state.remember("explore_area", 0.0)
        for scene, rows in state.group(looks):
            route = _read_area(scene)
            cells, nothing = route.cells, np.zeros(len(route.cells.is_ground), dtype=bool)
            name = f"explore_seen_{len(nothing)}"
            state.remember(name, nothing)
            seen = cells.find_seen(xp, state.position[rows, 0, :2], route.edge)
            state.write(name, (rows[:, None], seen), True, looks)
            seen = state.remember(name, nothing)[rows] & cells.is_ground
            state.write("explore_area", rows, xp.count_nonzero(seen, axis=1) * route.edge**2, looks)
        return state.remember("explore_area", 0.0).copy()

    def _find_least(self, state: TaskState) -> Float[np.ndarray, " N"]:
        return self.share * np.array([_read_area(scene).area for scene in state.scenes])

    def limits(self, state: TaskState) -> dict[str, np.ndarray]:
        return {"progress": self._find_least(state)}

    def has_arrived(self, state: TaskState) -> Bool[Any, " N"]:
        """Return whether enough was seen, and the body stands on the ground."""
        has_arrived = (state.progress >= self._find_least(state)) & find_honest(state)
        return state.confirm(has_arrived, lambda rows: find_standing(state, rows))


@dataclass(frozen=True)
class StandUp:
    """Get every module upright and on the ground."""

    def find(self, arena: Arena, organism: Organism, start: Start) -> Route:
        """Find a place on the map with room around it, unless the start is a place."""
        return find_path(arena, organism, start, ())

    def progress(self, state: TaskState) -> Float[Any, " N"]:
        """Return the mean z of the modules' up axes, from -1 to 1."""
        return add_up(state.up) * (1.0 / state.up.shape[1])

    def limits(self, state: TaskState) -> dict[str, float]:
        return {"progress": state.criteria.upright}

    def has_arrived(self, state: TaskState) -> Bool[Any, " N"]:
        """Return whether every module is upright and on the ground."""
        has_arrived = (state.least_up > state.criteria.upright) & find_honest(state)
        return state.confirm(has_arrived, lambda rows: find_standing(state, rows))
