"""The kinematic level of a swarm: how fast 50 robots with all sensors are, and whether it agrees with full contact."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from jaxtyping import Float

import symbrion_gym as sg
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.swarm.dynamic.world import DynamicWorld
from symbrion_gym._src.swarm.kinematic.config import KinematicConfig
from symbrion_gym._src.swarm.kinematic.kinematic_world import KinematicWorld
from symbrion_gym._src.swarm.senses import Senses
from symbrion_gym._src.swarm.signals.signals import Signals, Transmissions
from symbrion_gym._src.swarm.world import DECISION, SwarmCommands, SwarmState, SwarmWorld

NUM_ROBOTS = 50
SPEED_BAR = 20.0
"""Simulated time over processor time of one core."""
TIME_BAR = 0.10
"""Largest relative difference of the time to a place."""
_RECRUITING = 5
"""One robot of so many has its front beacon on and sends messages on all sides."""
_NEAR = 0.05
"""A robot has arrived within this distance [m]."""
_LIMIT = 120.0
"""Drives that take longer have failed [s]."""
_GROUNDS = {"flat": (-3.2, -1.85), "ramp": (-1.63, -0.87)}
"""x from and to [m] in the true course, whose first ramp begins at 1.6 m from its end."""
_SLOPES = (6.0, 12.0, 16.0)
"""Slopes of other ramps [deg]; nothing was developed on them."""
_RAMP, _RIM = 2.0, 0.1
"""Length along x of such a ramp, and its rim without starts and goals [m]."""


def measure_kinematic(quick: bool = False) -> dict[str, Any]:
    """Return the speed in three arenas and the agreement of both levels of physics.

    Args:
        quick: fewer steps and drives.
    """
    speed = {name: measure_speed(sg.load_arena(name), 3 if quick else 10) for name in ("truth", "gsrm", "gg")}
    count = 3 if quick else 20
    truth = sg.load_arena("truth")
    times = {name: compare_levels(truth, *bounds, count) for name, bounds in _GROUNDS.items()}
    times |= {f"{slope:g} deg": compare_levels(*make_ramp(slope), count) for slope in _SLOPES}
    return {
        "num_robots": NUM_ROBOTS,
        "speed": speed,
        "speed_bar": SPEED_BAR,
        "is_fast": min(each["times_real_time"] for each in speed.values()) >= SPEED_BAR,
        "times": times,
        "time_bar": TIME_BAR,
        "largest_difference": max(each["largest_difference"] for each in times.values()),
        "is_alike": all(each["largest_difference"] <= TIME_BAR for each in times.values()),
    }


def scatter(arena: Arena, num_robots: int, seed: int) -> KinematicWorld:
    """Return a world whose robots stand at random places of both floors and plateaus, apart from each other."""
    rng = np.random.default_rng(seed)
    world = KinematicWorld(arena, num_robots)
    low, high = np.asarray(arena.surface.bounds)[:, :2]
    poses: list[np.ndarray] = []
    single = KinematicWorld(arena, 1)
    while len(poses) < num_robots:
        pose = np.array([*rng.uniform(low, high), rng.uniform(-np.pi, np.pi)])
        if all(np.hypot(*(pose - other)[:2]) > 0.15 for other in poses):
            try:
                single.reset(pose[None])
            except sg.ArenaError:
                continue
            poses.append(pose)
    world.reset(np.array(poses), seed)
    return world


def measure_speed(arena: Arena, blocks: int) -> dict[str, float]:
    """Return how many times faster than real time 50 robots are that move, sense and signal all the time.

    Args:
        arena: where.
        blocks: of 50 decisions; the median counts, the best is stated as well.
    """
    world = scatter(arena, NUM_ROBOTS, 0)
    senses, signals = Senses(world, laser=True), Signals(world)
    rng = np.random.default_rng(1)
    sent = Transmissions.make_silent(NUM_ROBOTS)
    sent.beacon[::_RECRUITING, 0] = True
    sent.message[::_RECRUITING] = 1
    shares, decisions = [], 50
    tracks = np.zeros((NUM_ROBOTS, 2))
    for _ in range(blocks):
        parts = np.zeros(3)
        for step in range(decisions):
            if step % 25 == 0:
                tracks = rng.uniform(-0.1, 0.1, (NUM_ROBOTS, 2))
            commands = SwarmCommands(tracks, np.zeros(NUM_ROBOTS), np.zeros((NUM_ROBOTS, 4), bool))
            clock = [time.process_time()]
            for work in (lambda c=commands: world.step(c), senses.read, lambda: signals.exchange(sent)):
                work()
                clock.append(time.process_time())
            parts += np.diff(clock)
        shares.append(parts / decisions)
    part, totals = np.median(shares, axis=0), np.sum(shares, axis=1)
    return {
        "times_real_time": float(DECISION / np.median(totals)),
        "best_times_real_time": float(DECISION / np.min(totals)),
        "step_ms": float(1e3 * part[0]),
        "senses_ms": float(1e3 * part[1]),
        "signals_ms": float(1e3 * part[2]),
    }


def make_ramp(slope: float) -> tuple[Arena, float, float]:
    """Return a course with a ramp of a slope [deg], and x from and to on that ramp [m]."""
    course = Course(height=float(np.tan(np.deg2rad(slope)) * _RAMP), ramp=_RAMP)
    high = -course.pit / 2 - course.plateau
    return Arena.from_course(course), high - _RAMP + _RIM, high - _RIM


def compare_levels(arena: Arena, low: float, high: float, count: int) -> dict[str, Any]:
    """Return the times to random places at both levels.

    Args:
        arena: where.
        low: smallest x of starts and goals [m].
        high: largest x.
        count: number of drives.
    """
    worlds: dict[str, SwarmWorld] = {
        "kinematic": KinematicWorld(arena, 1, config=KinematicConfig(slip=0.0)),
        "dynamic": DynamicWorld(arena, 1),
    }
    rng = np.random.default_rng(3)
    times: dict[str, list[float]] = {name: [] for name in worlds}
    while len(times["dynamic"]) < count:
        start, goal = (rng.uniform([low, -0.8], [high, 0.8]) for _ in range(2))
        pose = np.array([*start, rng.uniform(-np.pi, np.pi)])
        if np.linalg.norm(goal - start) < 0.3:
            continue
        for name, world in worlds.items():
            world.reset(pose[None])
            times[name].append(drive(world, goal))
    kinematic, dynamic = (np.array(times[name]) for name in ("kinematic", "dynamic"))
    difference = kinematic / dynamic - 1.0
    return {
        "kinematic": kinematic.tolist(),
        "dynamic": dynamic.tolist(),
        "median_difference": float(np.median(difference)),
        "largest_difference": float(np.abs(difference).max()),
    }


def drive(world: SwarmWorld, goal: Float[np.ndarray, " 2"]) -> float:
    """Return how long robot 0 takes to a place by its true pose [s]; nan if it does not get there."""
    while world.time < _LIMIT:
        off = goal - world.state.position[0, :2]
        if np.hypot(*off) < _NEAR:
            return world.time
        world.step(SwarmCommands(find_tracks(world.state, off), np.zeros(1), np.zeros((1, 4), bool)))
    return float("nan")


def find_tracks(state: SwarmState, off: Float[np.ndarray, " 2"]) -> Float[np.ndarray, "1 2"]:
    """Return speeds of the tracks towards a place that is off by a vector [m]."""
    ahead = state.rotation[0, :2, 0]
    turn = np.arctan2(ahead[0] * off[1] - ahead[1] * off[0], ahead @ off)
    speed = max(0.0, np.cos(turn)) ** 2
    return 0.1 * np.clip([[speed - turn, speed + turn]], -1.0, 1.0)
