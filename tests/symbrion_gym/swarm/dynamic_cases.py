"""Worlds and commands that several tests of full contact share."""

import numpy as np

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig
from symbrion_gym._src.swarm.docks import DockConfig
from symbrion_gym._src.swarm.dynamic.world import DynamicWorld
from symbrion_gym._src.swarm.world import SwarmCommands

ARENA = Arena.from_course(Course(pit=0.45))
FRONT, BACK = SIDES.index("front"), SIDES.index("back")
PITCH = ScoutConfig().pitch


def make_row(count, gap=0.0):
    """Return poses of robots behind each other on the floor, docked exactly but for a gap [m]."""
    return np.array([[-1.8 - (PITCH + gap) * i, 0.0, 0.0] for i in range(count)])


def latch_row(count, speed=0.0):
    """Return commands with which a row latches front to back, and drives [m/s]."""
    commands = SwarmCommands.make_idle(count)
    commands.tracks[:] = speed
    commands.latch[1:, FRONT], commands.latch[:-1, BACK] = True, True
    return commands


def make_docked(count, gap=0.0, mating_time=0.3, **docks):
    """Return a world in which a row has become one organism, and its commands."""
    world = DynamicWorld(ARENA, count, docks=DockConfig(mating_time=mating_time, **docks))
    world.reset(make_row(count, gap))
    commands = latch_row(count)
    for _ in range(40):
        world.step(commands)
        if world.assembly.layout.trees[0].is_organism and not world.assembly.layout.welds:
            break
    return world, commands
