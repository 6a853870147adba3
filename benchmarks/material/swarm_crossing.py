"""A champion that was evolved as an organism crosses the pit in robots that have docked, and in the organism itself."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.stats import fisher_exact

from benchmarks.material.swarm_docks import assemble
from evolution._src.backends.parts import BodyConfig, ControlConfig
from evolution._src.backends.trials import Randomization
from evolution._src.champions.docked import DockedChampion
from evolution._src.search.validation import Champion
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.environment.snake_pit import SnakePitEnv
from symbrion_gym._src.robot.scout_constants import ScoutConfig
from symbrion_gym._src.swarm.docks import make_docking, sort_links
from symbrion_gym._src.swarm.dynamic.motion import FOLDED, Motion
from symbrion_gym._src.swarm.dynamic.world import DynamicWorld
from symbrion_gym._src.swarm.organism_senses import find_modules
from symbrion_gym._src.swarm.world import SwarmCommands

TRIALS = 20
GENOTYPE = (
    -0.10418004679615045, 0.024322134400873385, -1.245920462945829, 0.1645471449718099, 0.04798004197433092,
    -0.6974449973060655, -0.7051600397561786, -0.7353106287949772, 0.30187644434995853, 1.4383059496837838,
    0.9668436048344291, 0.5918840229765239,
)  # fmt: skip
"""Champion of `evolve(EvolutionConfig(arena="truth", seed=0))`: pit 0.45 m, the path law, 8 modules."""
_SEED = (21, 20)
_DURATION, _HOLD = 90.0, 0.3
"""Longest trial, and time for which a success lasts [s], as of the environment."""
_CENTER = (0.02, 0.075)
"""Heights of centers above the ground that count as on it [m], likewise."""
_UPRIGHT = 0.5
"""Least z of an up axis, likewise."""
SIGNIFICANT = 0.05
"""Two shares differ by more than chance below this probability (Fisher's exact test)."""


def make_champion() -> Champion:
    """Return the champion of the benchmark."""
    return Champion(
        genotype=GENOTYPE,
        names=tuple(f"slope_{k}" for k in range(len(GENOTYPE))),
        arena="truth",
        generation=9,
        fitness=0.0,
        successes=48,
        trials=48,
        body=BodyConfig(modules=8),
        control=ControlConfig(controller="path"),
    )


def measure_crossing(quick: bool) -> dict[str, Any]:
    """Let the champion cross in bodies assembled by docking and in bodies that were placed, under equal conditions."""
    count = 3 if quick else TRIALS
    arena = Arena.from_course(Course(pit=0.45))
    drawn = Randomization(stretch=(1.0,)).draw(_SEED, TRIALS)
    begun, crossed = time.process_time(), {}
    for kind in ("assembled", "placed"):
        outcomes = []
        for trial in range(count):
            conditions = {name: float(values[trial]) for name, values in drawn.items()}
            outcomes.append(cross(arena, conditions, trial, is_placed=kind == "placed"))
            print(kind, trial, outcomes[-1], flush=True)
        crossed[kind] = sum(outcomes)
    table = [[crossed[kind], count - crossed[kind]] for kind in crossed]
    chance = float(np.asarray(fisher_exact(table))[1])
    return {
        **crossed,
        "trials": count,
        "probability_of_chance": chance,
        "cpu_s": time.process_time() - begun,
        "missed": chance < SIGNIFICANT,
    }


def cross(arena: Arena, conditions: dict[str, float], seed: int, is_placed: bool) -> bool:
    """Return whether the champion crosses under drawn conditions."""
    environment = SnakePitEnv(arena=arena, modules=8)
    moved = {name: conditions[name] for name in ("start_offset", "yaw")}
    environment.reset(seed=seed, options=moved)
    scout = ScoutConfig(friction=conditions["friction"])
    scout = replace(scout, hinge_torque=scout.hinge_torque * conditions["torque_scale"])
    world = DynamicWorld(arena, 8, scout)
    physics = environment.physics
    if is_placed:
        place_organism(world, physics.position[0], physics.rotation[0].reshape(-1, 3, 3))
    else:
        yaw = np.arctan2(physics.rotation[0, 0, 3], physics.rotation[0, 0, 0])
        assemble(world, np.append(physics.position[0, 0, :2], yaw), seed)
    modules = find_modules(world, range(8))
    driver = DockedChampion(make_champion(), world, modules, environment.world.scene.start_on_map)
    held, idle = 0.0, SwarmCommands.make_idle(8)
    while world.time < _DURATION:
        driver.step(idle)
        held = held + driver.dt if is_across(world) else 0.0
        if held >= _HOLD:
            return True
    return False


def place_organism(
    world: DynamicWorld, position: Float[np.ndarray, "N 3"], rotation: Float[np.ndarray, "N 3 3"]
) -> None:
    """Begin with all robots docked into a straight snake."""
    count, still = len(position), np.zeros((len(position), 3))
    hinge = np.zeros(count)
    hinge[0] = FOLDED
    links = sort_links([make_docking(i, "back", i + 1, "front") for i in range(count - 1)])
    world.begin(Motion(position.copy(), rotation.copy(), still, still, hinge, np.zeros(count)), links)


def is_across(world: DynamicWorld) -> bool:
    """Return whether all robots are past the pit, at ground height and upright."""
    course = world.arena.course
    assert isinstance(course, Course)
    position = world.state.position
    height = position[:, 2] - world.arena.height(position[:, 0], position[:, 1])
    return bool(
        (position[:, 0] > course.pit / 2 + world.scout.size[0] / 2).all()
        and ((height > _CENTER[0]) & (height < _CENTER[1])).all()
        and (world.state.rotation[:, 2, 2] > _UPRIGHT).all()
    )
