"""What terms ask of the arrays of a state, so that one term serves both: NumPy on the host, JAX on a device."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Int

if TYPE_CHECKING:
    from symbrion_gym._src.tasks.scene import Scene


class HostArrays:
    """The answers of NumPy; those of JAX are in `symbrion_gym._src.warp.device.state`.

    A term that uses operators, methods of arrays, the functions of `xp`, and these methods runs on both. On a device
    all simulations are computed at once: whatever looks at values (`if`, `np.flatnonzero`) belongs in here.

    Attributes:
        xp: namespace of the arrays, here NumPy.
        memory: what terms remember, name -> `[N, ...]`.
        scenes: arena and way of each simulation.
        position: `[N, n, 3]` centers of the modules [m].
    """

    xp: Any = np
    memory: dict[str, np.ndarray]
    scenes: list[Scene]
    position: np.ndarray

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
