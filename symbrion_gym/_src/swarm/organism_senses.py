"""What docked robots sense as one organism: the parts of an organism's observation, from a dynamic world."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.swarm.docks import make_organism
from symbrion_gym._src.swarm.dynamic.loads import find_contact_forces
from symbrion_gym._src.swarm.dynamic.world import DynamicWorld

if TYPE_CHECKING:
    from symbrion_gym._src.swarm.mixed import MixedWorld
    from symbrion_gym._src.swarm.world import SwarmWorld


def find_modules(world: SwarmWorld, robots: Sequence[int], root: int | None = None) -> tuple[int, ...]:
    """Return docked robots in the order of the modules of their organism; see `make_organism`."""
    links = [link for link in world.state.links if link.first in robots]
    return make_organism(links, robots, world.scout, root)[1]


def is_organism(world: DynamicWorld | MixedWorld, modules: Sequence[int]) -> bool:
    """Return whether robots are the very tree of an `Organism`: all docks have mated and free arms are folded."""
    world, modules = world.find_dynamic(modules)
    trees = world.assembly.layout.trees
    return any(tree.is_organism and set(tree.robots) == set(modules) for tree in trees)


def read_organism(world: DynamicWorld | MixedWorld, modules: Sequence[int]) -> dict[str, np.ndarray]:
    """Return parts of the observation of an organism, without noise, as its environment has them."""
    is_whole = is_organism(world, modules)
    world, modules = world.find_dynamic(modules)
    if not is_whole:
        trees = [each.robots for each in world.assembly.layout.trees if each.is_organism]
        raise OptionError(
            f"robots {modules} are not one organism yet; there are {trees}: step until they have mated and folded arms"
        )
    hinged = [robot for robot in modules if world.assembly.hinge_qpos[robot] >= 0]
    rotation = world.state.rotation[modules]
    return {
        "hinge_angle": world.state.hinge[hinged],
        "pitch": np.arcsin(np.clip(rotation[:, 2, 0], -1.0, 1.0)),
        "roll": np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2]),
        "contact": np.minimum(_find_touches(world)[modules], world.scout.contact_range),
    }


def _find_touches(world: DynamicWorld) -> Float[np.ndarray, " N"]:
    """Return the sum of the normal forces on each robot [N]."""
    touches = np.zeros(world.num_robots)
    owners, forces = find_contact_forces(world.assembly, world.data)
    for side in range(2):
        is_robot = owners[:, side] >= 0
        np.add.at(touches, owners[is_robot, side], forces[is_robot, 0])
    return touches
