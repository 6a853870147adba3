"""Many small swarms at once: how much faster than one after the other, and whether they are equal to the bit."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from jaxtyping import Float

import symbrion_gym as sg
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.swarm.kinematic.batch import KinematicBatch
from symbrion_gym._src.swarm.kinematic.kinematic_world import KinematicWorld
from symbrion_gym._src.swarm.starts import find_field, scatter
from symbrion_gym._src.swarm.world import SwarmCommands, SwarmState

NUM_ROBOTS = 8
SIZES = (8, 32, 64)
"""Swarms in a batch."""
DECISIONS = 60
_CHANGE = 20
"""Decisions between new commands."""


def measure_batch(quick: bool) -> dict[str, Any]:
    """Return processor times a swarm and decision in batches and alone, and how many numbers of the states differ."""
    arena, found = sg.load_arena("gsrm"), {}
    single = KinematicWorld(arena, NUM_ROBOTS)
    for size in SIZES[: 1 if quick else None]:
        together, states = step_together(arena, size)
        alone, different = 0.0, 0
        for seed, seen in enumerate(states):
            seconds, own = step_alone(single, seed)
            alone += seconds
            different += sum(count_differences(*pair) for pair in zip(seen, own, strict=True))
        steps = DECISIONS * size
        found[str(size)] = {
            "alone_ms": 1e3 * alone / steps,
            "together_ms": 1e3 * together / steps,
            "times_faster": alone / together,
            "different_numbers": different,
        }
    return {
        "num_robots": NUM_ROBOTS,
        "sizes": found,
        "times_faster": max(each["times_faster"] for each in found.values()),
        "different_numbers": sum(each["different_numbers"] for each in found.values()),
    }


def step_together(arena: Arena, size: int) -> tuple[float, list[list[SwarmState]]]:
    """Return the processor time of a batch [s], and the states of each swarm."""
    seeds = list(range(size))
    batch = KinematicBatch(arena, size, NUM_ROBOTS)
    batch.reset(np.stack([draw_poses(arena, seed) for seed in seeds]), seeds)
    commands = list(zip(*(draw_commands(seed) for seed in seeds), strict=True))
    begun, rows = time.process_time(), []
    for each in commands:
        batch.step(each)
        rows.append(batch.states)
    return time.process_time() - begun, [list(states) for states in zip(*rows, strict=True)]


def step_alone(world: KinematicWorld, seed: int) -> tuple[float, list[SwarmState]]:
    """Return the processor time of a swarm in a world of its own [s], and its states."""
    world.reset(draw_poses(world.arena, seed), seed)
    commands, states = draw_commands(seed), []
    begun = time.process_time()
    for each in commands:
        world.step(each)
        states.append(world.state)
    return time.process_time() - begun, states


def draw_poses(arena: Arena, seed: int) -> Float[np.ndarray, "N 3"]:
    """Return where a swarm starts."""
    return scatter(find_field(arena), NUM_ROBOTS, arena, np.random.default_rng(seed))


def draw_commands(seed: int) -> list[SwarmCommands]:
    """Return random commands of a swarm whose docks all latch."""
    rng, commands = np.random.default_rng((seed, 1)), []
    for _ in range(DECISIONS // _CHANGE):
        tracks = rng.uniform(-0.1, 0.1, (NUM_ROBOTS, 2))
        one = SwarmCommands(tracks, np.zeros(NUM_ROBOTS), np.ones((NUM_ROBOTS, 4), bool))
        commands += [one] * _CHANGE
    return commands


def count_differences(one: SwarmState, other: SwarmState) -> int:
    """Return how many numbers of two states differ; links count as one each."""
    found = len(set(one.links) ^ set(other.links))
    for name, values in other._asdict().items():
        if isinstance(values, np.ndarray):
            found += int(np.count_nonzero(values != getattr(one, name)))
    return found
