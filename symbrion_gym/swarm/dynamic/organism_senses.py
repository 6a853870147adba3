"""What docked robots sense as one organism: the parts of an organism's observation, from a dynamic world."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from jaxtyping import Float

from symbrion_gym.errors import OptionError
from symbrion_gym.swarm.docks import make_organism
from symbrion_gym.swarm.dynamic.world import DynamicWorld


def find_modules(world: DynamicWorld, robots: Sequence[int], root: int | None = None) -> tuple[int, ...]:
    """Return docked robots in the order of the modules of their organism; see `make_organism`."""
    links = [link for link in world.state.links if link.first in robots]
    return make_organism(links, robots, world.scout, root)[1]


def read_organism(world: DynamicWorld, modules: Sequence[int]) -> dict[str, np.ndarray]:
    """Return parts of the observation of an organism, without noise, as its environment has them.

    Args:
        world: where the robots are.
        modules: robots in the order of the modules, of one tree.

    Returns:
        "hinge_angle" of the working hinges [rad], "pitch" and "roll" of the modules [rad], and "contact", the force on
        the skin of each [N].

    Raises:
        OptionError: the robots are not one tree.
    """
    world, modules = world.find_dynamic(modules)
    tree = next((each for each in world.assembly.layout.trees if set(each.robots) == set(modules)), None)
    if tree is None or not tree.is_organism:
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
    touches, force = np.zeros(world.num_robots), np.zeros(6)
    for index in range(world.data.ncon):
        mujoco.mj_contactForce(world.assembly.model, world.data, index, force)
        for robot in world.assembly.owners[world.data.contact.geom[index]]:
            if robot >= 0:
                touches[robot] += force[0]
    return touches
