"""Small arenas, worlds and commands that several tests of swarms share."""

import numpy as np
import trimesh

import symbrion_gym as sg
from symbrion_gym._src.contact.quality import ArenaQuality
from symbrion_gym._src.swarm.docks import SCOUT
from symbrion_gym._src.swarm.dynamic.world import DynamicWorld
from symbrion_gym._src.swarm.kinematic.kinematic_world import KinematicWorld
from symbrion_gym._src.swarm.world import BACK, FRONT, SwarmCommands, SwarmState

ARENA = sg.Arena.from_course(sg.Course(pit=0.45))


def make_floor(*things: trimesh.Trimesh, tilt: float = 0.0) -> sg.Arena:
    """Return a floor of 4 x 4 m about the origin, tilted up along x by an angle [rad], with things on it."""
    x, z = 2.0, 2.0 * np.tan(tilt)
    corners = np.array([[-x, -2.0, -z], [x, -2.0, z], [x, 2.0, z], [-x, 2.0, -z]])
    floor = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)
    surface = trimesh.util.concatenate([floor, *things])
    piece = trimesh.creation.box((4.0, 4.0, 0.1), trimesh.transformations.translation_matrix([0, 0, -0.05]))
    return sg.Arena("made", [piece], surface, ArenaQuality(mean=0.0, p95=0.0, max=0.0, num_pieces=1))


def make_sheet(x: float) -> trimesh.Trimesh:
    """Return a wall without thickness across the floor, 0.3 m high."""
    corners = np.array([[x, -2.0, 0.0], [x, 2.0, 0.0], [x, 2.0, 0.3], [x, -2.0, 0.3]])
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


def make_block(x: float, y: float, size: tuple[float, float, float]) -> trimesh.Trimesh:
    """Return a box that stands on the floor about a place."""
    return trimesh.creation.box(size, trimesh.transformations.translation_matrix([x, y, size[2] / 2]))


FLOOR = make_floor()


def make_world(poses, arena=FLOOR, slip=0.0, seed=0) -> KinematicWorld:
    """Return kinematic robots that stand at x, y and heading."""
    poses = np.atleast_2d(np.array(poses, float))
    world = KinematicWorld(arena, len(poses), slip=slip)
    world.reset(poses, seed)
    return world


def make_state(poses, hinge=None, links=(), rotation=None) -> SwarmState:
    """Return the state of robots on level ground at x, y and heading."""
    x, y, heading = np.atleast_2d(np.array(poses, float)).T
    cosine, sine, zero = np.cos(heading), np.sin(heading), np.zeros(len(x))
    turn = np.array([[cosine, -sine, zero], [sine, cosine, zero], [zero, zero, zero + 1.0]]).transpose(
        2, 0, 1
    )
    return SwarmState(
        np.column_stack([x, y, np.full(len(x), 0.05)]),
        turn if rotation is None else rotation,
        np.zeros((len(x), 3)),
        zero if hinge is None else np.array(hinge, float),
        tuple(links),
        np.zeros((len(x), 2)),
    )


def make_row(count, gap=0.0):
    """Return poses of robots behind each other on the floor, docked exactly but for a gap [m]."""
    return np.array([[-1.8 - (SCOUT.pitch + gap) * i, 0.0, 0.0] for i in range(count)])


def latch_row(count, speed=0.0) -> SwarmCommands:
    """Return commands with which a row latches front to back, and drives [m/s]."""
    commands = SwarmCommands.make_idle(count)
    commands.tracks[:] = speed
    commands.latch[1:, FRONT], commands.latch[:-1, BACK] = True, True
    return commands


def make_docked(count, gap=0.0) -> tuple[DynamicWorld, SwarmCommands]:
    """Return a world in which a row has become one organism, and its commands."""
    world, commands = DynamicWorld(ARENA, count), latch_row(count)
    world.reset(make_row(count, gap))
    for _ in range(60):
        world.step(commands)
        if world.assembly.layout.trees[0].is_organism and not world.assembly.layout.welds:
            break
    return world, commands
