"""Docks of robots in full contact: jumps where the model changes, momentum, drift of latches under load, speed."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from jaxtyping import Float

import symbrion_gym as sg
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig
from symbrion_gym._src.swarm.docks import DockConfig
from symbrion_gym._src.swarm.dynamic.mating import find_error
from symbrion_gym._src.swarm.dynamic.motion import find_jump, find_kinetic_energy, find_momentum
from symbrion_gym._src.swarm.dynamic.world import DynamicWorld
from symbrion_gym._src.swarm.world import SwarmCommands

FORCE = 100.0
"""Load of a latch [N]: what a docking unit holds."""
SPEED = 0.05
"""Of robots that drive while they mate and part [m/s]."""
BARS = {
    "jump_mm": 0.1,
    "jump_deg": 0.1,
    "momentum_share": 0.01,
    "drift_mm": 1.0,
    "drift_deg": 0.5,
    "times_real_time": 15.0,
}
"""All but the last are upper limits."""
_LEAST_MOMENTUM = 0.01
"""Shares are of no less than this [kg m/s]."""
_NEVER = 1e6
"""Mating time with which a weld is never replaced by a tree [s]."""
_PLACE = np.array([-2.0, 0.0, 0.0])


def make_row(num_robots: int, rng: np.random.Generator, head: Float[np.ndarray, " 3"] = _PLACE) -> np.ndarray:
    """Return poses `[N, 3]` of a row behind a head, each robot beside its exact place, within reach of the docks."""
    pitch = ScoutConfig().pitch + 0.007
    poses = np.repeat(head[None], num_robots, axis=0)
    back = pitch * np.arange(num_robots)
    poses[:, 0] -= np.cos(head[2]) * back
    poses[:, 1] -= np.sin(head[2]) * back
    poses[1:] += rng.uniform(-1.0, 1.0, (num_robots - 1, 3)) * [0.001, 0.002, np.deg2rad(2.0)]
    return poses


def latch_row(num_robots: int, speed: float = 0.0) -> SwarmCommands:
    """Return commands of a row that drives: each front dock and the back dock ahead of it latch."""
    commands = SwarmCommands.make_idle(num_robots)
    commands.tracks[:] = speed
    commands.latch[1:, SIDES.index("front")] = True
    commands.latch[:-1, SIDES.index("back")] = True
    return commands


def assemble(world: DynamicWorld, head: Float[np.ndarray, " 3"], seed: int, speed: float = 0.0) -> int:
    """Let all robots of a world dock into a snake; return how many decisions it took, at most 100."""
    world.reset(make_row(world.num_robots, np.random.default_rng(seed), head), seed)
    commands = latch_row(world.num_robots, speed)
    for decision in range(100):
        world.step(commands)
        if world.assembly.layout.trees[0].is_organism and len(world.assembly.layout.trees) == 1:
            return decision + 1
    return 100


def measure_docks(quick: bool) -> dict[str, Any]:
    """Measure jumps and momentum at every change of the model, and the drift of latches."""
    arena = sg.load_arena("truth")
    rows = [row for seed in range(2 if quick else 20) for row in _watch_changes(arena, seed)]
    worst = {name: float(max(row[name] for row in rows)) for name in rows[0]}
    drift = measure_drift(arena)
    figures = {**worst, **drift}
    missed = [name for name, bar in BARS.items() if name in figures and figures[name] > bar]
    return {"changes": len(rows), **figures, "missed": missed}


def _watch_changes(arena: sg.Arena, seed: int) -> list[dict[str, float]]:
    """Let eight robots dock while they drive, part and dock anew; return the figures of every change."""
    world = DynamicWorld(arena, 8)
    world.reset(make_row(8, np.random.default_rng(seed)))
    together, rows = latch_row(8, SPEED), []
    apart = together._replace(latch=np.zeros((8, 4), bool))
    for commands, decisions in ((together, 35), (apart, 1), (together, 20)):
        for _ in range(decisions):
            world.step(commands)
            if world.conversion is not None:
                rows.append(_compare(world))
                world.conversion = None
    return rows


def _compare(world: DynamicWorld) -> dict[str, float]:
    assert world.conversion is not None
    before, after = world.conversion
    position, angle, velocity = find_jump(before, after)
    momenta = [find_momentum(motion, world.scout) for motion in (before, after)]
    energies = [find_kinetic_energy(motion, world.scout).sum() for motion in (before, after)]
    lost = np.linalg.norm(momenta[1][0] - momenta[0][0])
    return {
        "jump_mm": 1e3 * position,
        "jump_deg": float(np.rad2deg(angle)),
        "jump_mm_per_s": 1e3 * velocity,
        "momentum_share": float(lost / max(np.linalg.norm(momenta[0][0]), _LEAST_MOMENTUM)),
        "energy_added_mj": float(1e3 * (energies[1] - energies[0])),
    }


def measure_drift(arena: sg.Arena) -> dict[str, float]:
    """Pull and twist a latch, held by a weld, with its largest load in all directions."""
    position, angle, load = [], [], []
    for axis in range(3):
        for kind in ("force", "torque"):
            world = DynamicWorld(arena, 2, docks=DockConfig(mating_time=_NEVER))
            world.reset(np.array([_PLACE, _PLACE - [world.scout.pitch, 0.0, 0.0]]))
            commands = latch_row(2)
            for _ in range(15):
                world.step(commands)
            for _ in range(10):
                pull(world, axis, kind)
                world.step(commands, 0.02)
            error = find_error(world.assembly, world.data, world.state.links[0], world.scout)
            position.append(1e3 * float(np.linalg.norm(error[0])))
            angle.append(float(np.rad2deg(np.linalg.norm(error[1]))))
            load.append(float(world.state.load.max()))
    return {"drift_mm": max(position), "drift_deg": max(angle), "load_read_n": max(load)}


def pull(world: DynamicWorld, axis: int, kind: str, force: float = FORCE) -> None:
    """Apply a force along an axis of the first dock to both sides of the first latch, or the torque that it has at a
    dock's distance from the center of a module."""
    link = world.state.links[0]
    data, model = world.data, world.assembly.model
    docks = [world.assembly.docks[robot, SIDES.index(side)] for robot, side in link.ends]
    direction = data.site_xmat[docks[0]].reshape(3, 3)[:, axis]
    place = data.site_xpos[docks].mean(axis=0)
    data.xfrc_applied[:] = 0.0
    for dock, sign in zip(docks, (-1.0, 1.0), strict=True):
        body = model.site_bodyid[dock]
        push = sign * force * direction
        if kind == "torque":
            data.xfrc_applied[body, 3:] += world.scout.dock_reach * push
        else:
            data.xfrc_applied[body, :3] += push
            data.xfrc_applied[body, 3:] += np.cross(place - data.xipos[body], push)


def measure_speed(quick: bool) -> dict[str, Any]:
    """Measure how many times faster than real time eight free robots are simulated, with their state and loads."""
    found = {}
    for name in ("truth", "gsrm"):
        world = DynamicWorld(sg.load_arena(name), 8)
        world.reset(np.array([[-2.2 + 0.3 * (i % 4), -0.4 + 0.4 * (i // 4), 0.3 * i] for i in range(8)]))
        turn = [[SPEED, -SPEED]] * 4 + [[SPEED, SPEED]] * 4
        commands = SwarmCommands.make_idle(8)._replace(tracks=np.array(turn))
        world.step(commands)
        seconds = []
        for _ in range(2 if quick else 7):
            begun = time.process_time()
            for _ in range(20):
                world.step(commands)
            seconds.append((time.process_time() - begun) / 2.0)
        found[name] = 1.0 / float(np.median(seconds))
    return {
        "free_robots": 8,
        "times_real_time": found,
        "missed": min(found.values()) < BARS["times_real_time"],
    }
