"""An arena with the way of a task through it: what a simulation takes place in."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float, Int

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.route import Route

if TYPE_CHECKING:
    import trimesh

_STRIP = 0.05  # Width of the strips across x whose greatest heights are known [m]; it changes the time alone
_TRIANGLE_MARGIN = 1e-6
"""Triangles reach this much farther than they are when the ground of a strip is sought [m]: rounding."""


@dataclass(frozen=True, eq=False)
class Scene:
    """An arena, who is in it, and the way."""

    arena: Arena  # arena of the simulation
    organism: Organism  # organism in it
    route: Route  # the way to go
    map_route: Route  # the way on the robot's map, which `stretch` does not change

    @property
    def is_along_x(self) -> bool:
        """Whether the way runs along x, in the middle."""
        return self.route.heading == 0.0 and self.route.lateral == 0.0

    @property
    def start_on_map(self) -> float:
        """Start on the robot's map, from the middle of the pit, if there is one [m]."""
        near, far, _ = self.map_route.pit or (0.0, 0.0, 0.0)
        return self.map_route.start - (near + far) / 2

    @cached_property
    def _ceiling(self) -> tuple[Float[np.ndarray, " S"], Float[np.ndarray, " S+1"]]:
        return find_ceiling(self.arena.surface)

    def is_above_all(
        self, x: Float[np.ndarray, " P"], z: Float[np.ndarray, " P"], margin: float
    ) -> np.ndarray:
        """Return which places are at least `margin` above the highest ground of their strip across x [m]."""
        strips, ceiling = self._ceiling
        return z - ceiling[np.searchsorted(strips, x)] >= margin

    def find_ground(
        self, x: Float[np.ndarray, " P"], y: Float[np.ndarray, " P"], z: Float[np.ndarray, " P"]
    ) -> Float[np.ndarray, " P"]:
        """Return the height of the ground: the surface, or below a ceiling its highest part beneath the places [m]."""
        if self.route.start_height is None:
            return self.arena.height(x, y)
        return self.arena.elevation.height_below(x, y, z)


def find_ceiling(surface: trimesh.Trimesh) -> tuple[Float[np.ndarray, " S"], Float[np.ndarray, " S+1"]]:
    """Return x where strips end [m], and the greatest height of the surface in each strip [m]."""
    x, height = surface.triangles[:, :, 0], surface.triangles[:, :, 2].max(axis=1) + _TRIANGLE_MARGIN
    ends = np.arange(x.min() - _STRIP, x.max() + _STRIP, _STRIP)
    first = np.searchsorted(ends, x.min(axis=1) - _TRIANGLE_MARGIN)
    last = np.searchsorted(ends, x.max(axis=1) + _TRIANGLE_MARGIN)
    ceiling = np.full(len(ends) + 1, -np.inf)
    for step in range((last - first).max() + 1):
        np.maximum.at(ceiling, np.minimum(first + step, last), height)
    return ends, ceiling


class HostArrays:
    """The answers of NumPy; those of JAX are in `symbrion_gym._src.environment.warp.state`.

    A term that uses operators, methods of arrays, the functions of `xp`, and these methods runs on both. On a device
    all simulations are computed at once: whatever looks at values (`if`, `np.flatnonzero`) belongs in here.
    """

    xp: Any = np  # namespace of the arrays, here NumPy
    memory: dict[str, np.ndarray]  # what terms remember, name -> `[N, ...]`
    scenes: list[Scene]  # arena and way of each simulation
    position: np.ndarray  # `[N, n, 3]` centers of the modules [m]

    def may_hold(self, mask: Bool[np.ndarray, " N"]) -> bool:
        """Return whether something is so in any simulation; on a device True, as looking would take time."""
        return bool(np.count_nonzero(mask))

    def confirm(
        self,
        mask: Bool[np.ndarray, " M"],
        find: Callable[[Int[np.ndarray, " K"]], Bool[np.ndarray, " K"]],
    ) -> Bool[np.ndarray, " M"]:
        """Return where something is so and something else as well, which is looked for only there."""
        rows = np.flatnonzero(mask)
        if len(rows):
            mask[rows] = find(rows)
        return mask

    def keep(self, name: str, values: np.ndarray, where: Bool[np.ndarray, " N"]) -> None:
        """Change what a term remembers in some simulations; see `TaskState.remember`."""
        np.copyto(self.memory[name], values, where=where)

    def group(self, mask: Bool[np.ndarray, " N"]) -> Iterator[tuple[Scene, Int[np.ndarray, " M"]]]:
        """Yield each scene in which something is so, and in which of its simulations; on a device all of them."""
        groups: dict[int, list[int]] = {}
        for row in np.flatnonzero(mask).tolist():
            groups.setdefault(id(self.scenes[row]), []).append(row)
        for members in groups.values():
            yield self.scenes[members[0]], np.array(members)

    def write(self, name: str, place: Any, values: Any, where: Bool[np.ndarray, " N"]) -> None:
        """Change entries of what a term remembers, in simulations that `group` yielded."""
        del where
        self.memory[name][place] = values

    def find_low(self, rows: Int[np.ndarray, " M"], height: float) -> Bool[np.ndarray, " M"]:
        """Return which of some bodies may have every module lower than this above the ground: a quick look."""
        is_low = np.ones(len(rows), dtype=bool)
        for index, row in enumerate(rows):
            x, _, z = self.position[row].T
            is_low[index] = not self.scenes[row].is_above_all(x, z, height).any()
        return is_low
