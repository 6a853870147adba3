"""Many swarms at once: each moves as in a `KinematicWorld` of its own, to the bit, for a fraction of the time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.swarm.kinematic.kinematic_world import KinematicWorld
from symbrion_gym._src.swarm.world import SwarmCommands, SwarmState

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

    from symbrion_gym._src.arenas.arena import Arena
    from symbrion_gym._src.robot.scout_constants import ScoutConfig
    from symbrion_gym._src.swarm.docks import DockConfig
    from symbrion_gym._src.swarm.kinematic.config import KinematicConfig
    from symbrion_gym._src.swarm.sight import Sight


class SwarmOfBatch:
    """One swarm of a batch, for `Senses`, `Signals` and behaviors; it is stepped with the whole batch.

    Attributes:
        arena: where it is.
        scout: constants of its robots.
        docks: when docks latch.
        num_robots: N.
        sight: rays in the arena.
    """

    def __init__(self, batch: KinematicBatch, index: int) -> None:
        self._batch, self._index = batch, index
        self.arena: Arena = batch.world.arena
        self.scout: ScoutConfig = batch.world.scout
        self.docks: DockConfig = batch.world.docks
        self.sight: Sight = batch.world.sight
        self.num_robots = batch.num_robots
        self._rows = slice(index * self.num_robots, (index + 1) * self.num_robots)

    @property
    def time(self) -> float:
        """Time since the reset [s]."""
        return self._batch.world.time

    @property
    def state(self) -> SwarmState:
        """State now; a new object after every step."""
        return self._batch.states[self._index]

    @property
    def blocked(self) -> Bool[np.ndarray, " N"]:
        """Whether each robot could not move as it was told in the last step."""
        return self._batch.world.blocked[self._rows]

    @property
    def groups(self) -> Int[np.ndarray, " N"]:
        """Smallest index in the group of docked robots of each robot."""
        return self._batch.world.groups[self._rows] - self._rows.start

    def reset(self, poses: Float[np.ndarray, "N 3"], seed: int = 0) -> None:
        """Refuse: all swarms of a batch begin together."""
        raise OptionError("a swarm of a batch begins with the others; call reset of the batch")

    def step(self, commands: SwarmCommands) -> None:
        """Refuse: all swarms of a batch move together."""
        raise OptionError("a swarm of a batch moves with the others; call step of the batch")


class KinematicBatch:
    """B swarms of N Scouts in equal arenas that never meet each other, stepped at once.

    Each gets the very states that a `KinematicWorld` of its own would give it, with equal poses, seeds and commands. A
    step of small swarms is mostly the overhead of array operations, which a batch pays once.

    Args:
        arena: of all swarms.
        num_swarms: B.
        num_robots: N, of each swarm.
        scout: constants of the robots; None for the defaults, with the friction of the arena.
        docks: when docks latch; None for the defaults.
        config: limits and errors of the motion; None for the defaults.

    Attributes:
        world: all robots, swarm after swarm.
        num_swarms: B.
        num_robots: N.
        swarms: each of them, a `SwarmWorld` whose steps are those of the batch.
        states: of each swarm now.

    Raises:
        OptionError: fewer than 1 swarm or robot.
    """

    def __init__(
        self,
        arena: Arena,
        num_swarms: int,
        num_robots: int,
        scout: ScoutConfig | None = None,
        docks: DockConfig | None = None,
        config: KinematicConfig | None = None,
    ) -> None:
        for name, value in (("num_swarms", num_swarms), ("num_robots", num_robots)):
            if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
                raise OptionError(f"{name} must be a whole number of at least 1, got {value!r}")
        self.num_swarms, self.num_robots = int(num_swarms), int(num_robots)
        self.world = _SideBySide(arena, self.num_swarms, self.num_robots, scout, docks, config)
        self.swarms = tuple(SwarmOfBatch(self, index) for index in range(self.num_swarms))
        self.states: list[SwarmState] = []

    def reset(self, poses: Float[np.ndarray, "B N 3"], seeds: Sequence[int]) -> None:
        """Place the robots of all swarms on the ground, undocked, at x [m], y [m] and heading [rad]."""
        poses, shape = np.asarray(poses, dtype=np.float64), (self.num_swarms, self.num_robots, 3)
        if poses.shape != shape or len(seeds) != self.num_swarms:
            raise OptionError(
                f"poses must be {shape} and seeds {self.num_swarms}, got {poses.shape} and {len(seeds)}"
            )
        self.world.reset(poses.reshape(-1, 3))
        self.world.generators = [np.random.default_rng(seed) for seed in seeds]
        self._divide()

    def step(self, commands: Sequence[SwarmCommands]) -> None:
        """Advance all swarms by one decision."""
        if len(commands) != self.num_swarms:
            raise OptionError(
                f"commands of {len(commands)} swarms for {self.num_swarms}; one for each is needed"
            )
        self.world.step(SwarmCommands(*(np.concatenate(parts) for parts in zip(*commands, strict=True))))
        self._divide()

    def _divide(self) -> None:
        """Give each swarm its part of the state."""
        state, count = self.world.state, self.num_robots
        links: list[list[Docking]] = [[] for _ in range(self.num_swarms)]
        for link in state.links:
            swarm = link.first // count
            begin = swarm * count
            links[swarm].append(
                Docking(link.first - begin, link.first_side, link.second - begin, link.second_side)
            )
        self.states = []
        for swarm, own in enumerate(links):
            rows = slice(swarm * count, (swarm + 1) * count)
            parts = {
                name: value[rows] for name, value in state._asdict().items() if isinstance(value, np.ndarray)
            }
            self.states.append(SwarmState(**parts, links=tuple(own)))


class _SideBySide(KinematicWorld):
    """The robots of several swarms, which do not meet each other; each swarm has its own generator."""

    def __init__(
        self,
        arena: Arena,
        num_swarms: int,
        num_robots: int,
        scout: ScoutConfig | None,
        docks: DockConfig | None,
        config: KinematicConfig | None,
    ) -> None:
        super().__init__(arena, num_swarms * num_robots, scout, docks, config)
        self._num_swarms = num_swarms
        self.generators: list[np.random.Generator] = []

    def _draw_slip(self) -> Float[np.ndarray, "N 2"]:
        count = self.num_robots // self._num_swarms
        return np.concatenate([each.standard_normal((count, 2)) for each in self.generators])
