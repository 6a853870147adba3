"""Controllers for the benchmarks of the environment, and their outcomes, with an audit of each success."""

from collections.abc import Callable
from typing import Any, NamedTuple

import cma
import numpy as np

from evolution._src.controllers.controller import make_controller
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym._src.tasks.audit import Trajectory, audit

KNOTS = np.linspace(-0.55, 1.10, 12)
"""Knots of the posture along the course, from the middle of the pit [m]."""
LAWS = ("posture of places", "reactive", "path")
"""Kinds of controllers: ours, with 12 knots, and two of `evolution`."""
Act = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""From observations `[P, O]` and x of the heads `[P]` [m] to actions `[P, h]`."""


class Crossing(NamedTuple):
    """The outcome of one controller.

    Attributes:
        success: by the environment's own check.
        progress: [m].
        seconds: simulated.
        faults: found by the audit of a success.
        qpos: `[T, nq]`, if recorded.
    """

    success: bool
    progress: float
    seconds: float
    faults: tuple[str, ...]
    qpos: np.ndarray | None


def follow_the_leader(head: np.ndarray, genotypes: np.ndarray, num_hinges: int) -> np.ndarray:
    """Return actions `[P, h]`: each hinge takes the angle of its position along the course.

    Args:
        head: `[P]` x of the heads [m].
        genotypes: `[P, 12]` angles at the knots [rad].
        num_hinges: of the body.
    """
    places = head[:, None] - (np.arange(num_hinges) + 0.5) * 0.1254
    angles = [np.interp(p, KNOTS, g, left=0.0, right=0.0) for p, g in zip(places, genotypes, strict=True)]
    return np.array(angles) / (np.pi / 2)


def find_start(law: str, modules: int) -> np.ndarray:
    """Return the starting point of the search for a controller."""
    if law == LAWS[0]:
        return np.zeros(len(KNOTS))
    return np.array(make_controller(law, modules).initial)


def make_act(envs: OrganismVectorEnv, genotypes: np.ndarray, law: str = LAWS[0]) -> Act:
    """Return the function that computes the actions of controllers, one per simulation."""
    hinges, structure = envs.world.num_hinges, envs.observation_structure
    if law == LAWS[0]:
        return lambda _, head: follow_the_leader(head, genotypes, hinges)
    controller = make_controller(law, envs.world.num_modules)
    state = controller.begin(envs.num_envs)

    def act(observation: np.ndarray, _: np.ndarray) -> np.ndarray:
        nonlocal state
        actions, state = controller.act(observation, genotypes, structure, state)
        return actions

    return act


def cross(
    envs: OrganismVectorEnv,
    genotypes: np.ndarray,
    conditions: dict[str, Any],
    keep: bool = False,
    law: str = LAWS[0],
) -> list[Crossing]:
    """Run one controller in each simulation, each under its own conditions."""
    observation, info = envs.reset(seed=0, options=conditions)
    act = make_act(envs, genotypes, law)
    qpos, finished = envs.batch.bind("qpos"), np.zeros(envs.num_envs, dtype=bool)
    recorded = [qpos.copy()]
    while not finished.all():
        observation, _, terminated, truncated, info = envs.step(act(observation, info["x_position"]))
        recorded.append(qpos.copy())
        finished |= terminated | truncated
    states, dt = np.array(recorded), envs.config.dt
    crossings = []
    for i in range(envs.num_envs):
        count = round(info["time"][i] / dt) + 1
        own = states[:count, i, : 7 + envs.world.num_hinges]
        faults: tuple[str, ...] = ()
        if info["success"][i]:
            recording, world = Trajectory(np.arange(count) * dt, own), envs.world
            faults = audit(recording, world.task, world.scene, envs.config.track_speed).faults
        crossings.append(
            Crossing(
                bool(info["success"][i]),
                float(info["progress"][i]),
                float(info["time"][i]),
                faults,
                own.copy() if keep else None,
            )
        )
    return crossings


def draw_conditions(rng: np.random.Generator, count: int) -> dict[str, np.ndarray]:
    """Return random friction, torque, start and heading for `count` trials."""
    return {
        "friction": rng.uniform(0.55, 0.9, count),
        "torque_scale": rng.uniform(0.9, 1.1, count),
        "start_offset": rng.uniform(-0.05, 0.05, count),
        "yaw": rng.uniform(-0.0873, 0.0873, count),
    }


def draw_controllers(seed: int, count: int) -> np.ndarray:
    """Return random genotypes `[count, 12]`."""
    return np.clip(np.random.default_rng(seed).normal(0.0, 0.35, (count, 12)), -1.5, 1.5)


def evolve(
    envs: OrganismVectorEnv, seed: int, generations: int, law: str = LAWS[0], keep: bool = False
) -> list[list[tuple[np.ndarray, Crossing]]]:
    """Run CMA-ES, half as many genotypes as simulations, two trials each; return generations of trials."""
    population = envs.num_envs // 2
    options = {"popsize": population, "bounds": [-1.5, 1.5], "seed": seed + 1, "verbose": -9}
    strategy = cma.CMAEvolutionStrategy(find_start(law, envs.world.num_modules), 0.3, options)
    rng, trials = np.random.default_rng(seed), []
    for _ in range(generations):
        genotypes = np.array(strategy.ask())
        conditions = {name: np.tile(v, population) for name, v in draw_conditions(rng, 2).items()}
        doubled = np.repeat(genotypes, 2, axis=0)
        outcomes = cross(envs, doubled, conditions, keep, law)
        fitness = np.array([one.progress + one.success for one in outcomes]).reshape(-1, 2).mean(axis=1)
        strategy.tell(list(genotypes), list(-fitness))
        trials.append(list(zip(doubled, outcomes, strict=True)))
    return trials
