"""A champion that was evolved as an organism, in robots that have docked into its body."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from evolution._src.controllers.protocol import check_genotypes
from evolution._src.errors import RunError
from evolution._src.search.validation import Champion
from symbrion_gym._src.swarm.world import SwarmCommands

if TYPE_CHECKING:
    from symbrion_gym._src.swarm.dynamic.world import DynamicWorld

_READ = ("hinge_angle", "pitch", "roll", "contact", "track_odometry")
"""Parts of an observation that docked robots have."""


class DockedChampion:
    """Drives docked robots as a champion drives its organism; call `step` until the robots have arrived.

    As long as docks still mate or free arms still fold up, the robots stand.
    """

    dt = 0.02  # Time between two actions, as in the environment [s]

    def __init__(
        self, champion: Champion, world: "DynamicWorld", modules: Sequence[int], start: float
    ) -> None:
        from symbrion_gym._src.swarm.docks import make_organism

        self._world, self._modules = world, list(modules)
        body = champion.find_organism()
        links = [link for link in world.state.links if link.first in self._modules]
        organism, order = make_organism(links, self._modules, world.scout, self._modules[0])
        if organism.dockings != body.dockings or list(order) != self._modules:
            raise RunError(f"robots {self._modules} have not docked into the body of the champion")
        self._controller = champion.make_controller(body)
        missing = sorted(set(self._controller.sensors) - set(_READ))
        if missing:
            raise RunError(f"docked robots do not sense {', '.join(missing)}; there are: {', '.join(_READ)}")
        self._genotype = np.array(champion.genotype)[None]
        check_genotypes(self._controller, self._genotype)
        self._state: Any = self._controller.begin(1)
        self._hinged = [self._modules[module] for module in organism.hinges]
        self.track_odometry = start

    def command(self, commands: SwarmCommands) -> SwarmCommands:
        """Return commands in which the robots of the organism do what the champion does now; others keep theirs."""
        from symbrion_gym._src.swarm.dynamic.world import is_organism, read_organism

        hinge, tracks, latch = commands.hinge.copy(), commands.tracks.copy(), commands.latch.copy()
        latch[self._modules] = self._world.state.docked[self._modules]  # its free docks close
        if not is_organism(self._world, self._modules):
            hinge[self._modules], tracks[self._modules] = 0.0, 0.0
            return SwarmCommands(tracks, hinge, latch)
        parts = read_organism(self._world, self._modules)
        parts["track_odometry"] = np.array([self.track_odometry])
        structure, rows, first = {}, [], 0
        for name in self._controller.sensors:
            structure[name] = slice(first, first + len(parts[name]))
            rows.append(parts[name])
            first += len(parts[name])
        action, self._state = self._controller.act(
            np.concatenate(rows)[None], self._genotype, structure, self._state
        )
        scout = self._world.scout
        hinge[self._hinged] = scout.hinge_range * np.clip(action[0, : len(self._hinged)], -1.0, 1.0)
        tracks[self._modules] = scout.track_speed
        self.track_odometry += self.dt * scout.track_speed * float(np.cos(parts["pitch"][0]))
        return SwarmCommands(tracks, hinge, latch)

    def step(self, commands: SwarmCommands) -> None:
        """Advance the world by one action of the champion; robots of other groups do what `commands` say."""
        self._world.step(self.command(commands), self.dt)
