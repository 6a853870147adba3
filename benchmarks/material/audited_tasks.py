"""Audited episodes of every task: random and evolved controllers of many bodies in many arenas, in rounds.

A round is one cell of bodies x tasks x arenas; the cells come in an order that is drawn once, so that a part of a pass
is a sample of them.
"""

from collections import Counter
from collections.abc import Callable
from functools import cache
from itertools import product
from typing import Any, NamedTuple

import cma
import numpy as np

from evolution._src.backends.parts import count_tracks
from evolution._src.controllers.controller import OwnController, make_law
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.arenas.loading import load_arena
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym._src.errors import ArenaError, TaskError
from symbrion_gym._src.robot.organism import Organism, cross, letter_h, snake
from symbrion_gym._src.robot.random_organism import make_random_organism
from symbrion_gym._src.tasks.audit import Trajectory
from symbrion_gym._src.tasks.second_judge import audit_task

BODIES: dict[str, Organism] = {
    **{f"snake {count}": snake(count) for count in range(2, 10)},
    "cross": cross(1),
    "H": letter_h(),
    "tree": make_random_organism(6, np.random.default_rng(4)),
}
TASKS = ("cross_gap", "climb", "reach", "traverse", "explore", "recover")
ARENAS = ("truth", "gsrm", "gg", "wide")
RANDOM_LANES = 40
"""Random episodes of a round."""
POPULATION = 6
GENERATIONS = 3
"""Generations of a short evolution; those after the first are audited."""
DURATION, STUCK_TIME = 30.0, 3.0
"""Episodes are cut off after so long, and after so long without progress [s]."""
_LAWS = ("reactive", "travelling", "path", "posture")
_SENSORS = ("hinge_angle", "pitch", "roll", "contact", "track_odometry")
_TRACK_CONTROLS = ("constant", "body", "modules", "skid")
_RANDOMIZE = {
    "friction": (0.4, 1.0),
    "torque_scale": (0.9, 1.1),
    "start_offset": (-0.03, 0.03),
    "yaw": (-0.1, 0.1),
}
_HELD_TICKS = 20
"""Random actions are held for so long: those drawn at every tick cancel out."""
Policy = Callable[[np.ndarray], np.ndarray]
"""From observations `[N, O]` to actions `[N, A]`."""


class Cell(NamedTuple):
    """Names of a body, a task and an arena."""

    body: str
    task: str
    arena: str


class Episode(NamedTuple):
    """The end of an episode.

    Attributes:
        success: by the task itself.
        fitness: progress in the task's own unit, and 1 more for a success.
        faults: found by the audit of a success.
    """

    success: bool
    fitness: float
    faults: tuple[str, ...]


@cache
def list_cells() -> tuple[Cell, ...]:
    """Return all cells in an order drawn once."""
    cells = [Cell(*names) for names in product(BODIES, TASKS, ARENAS)]
    return tuple(cells[index] for index in np.random.default_rng(19).permutation(len(cells)))


def try_random(number: int) -> tuple[Counter[str], list[list[Any]]]:
    """Run one round of random controllers, reproducible by its number; return counts and faults found."""
    rng = np.random.default_rng([3, number])
    return _try(number, rng, RANDOM_LANES, "random")


def try_evolved(number: int) -> tuple[Counter[str], list[list[Any]]]:
    """Run one short evolution, reproducible by its number; the generations after the first count."""
    rng = np.random.default_rng([4, number])
    return _try(number, rng, POPULATION, "evolved")


def _try(
    number: int, rng: np.random.Generator, lanes: int, kind: str
) -> tuple[Counter[str], list[list[Any]]]:
    cell = list_cells()[number % len(list_cells())]
    track_control = str(rng.choice(_TRACK_CONTROLS))
    try:
        envs = make_envs(cell, track_control, rng, lanes)
    except (ArenaError, TaskError) as error:
        return Counter({f"{kind} without a way": 1}), [] if "has no" in str(error) else [[*cell, str(error)]]
    law = make_law(
        str(rng.choice(_LAWS)), envs.world.organism, None, count_tracks(track_control, envs.world.num_modules)
    )
    run = run_random if kind == "random" else run_evolution
    episodes = run(envs, law, rng)
    envs.close()
    counts = Counter({f"{kind} episodes": len(episodes)})
    counts[f"{kind} successes"] = sum(one.success for one in episodes)
    counts[f"{kind} successes of {cell.task}"] = counts[f"{kind} successes"]
    faulty = [one.faults for one in episodes if one.faults]
    counts[f"{kind} cheats"] = len(faulty)
    return counts, [[*cell, kind, number, *faults] for faults in faulty]


@cache
def _find_arena(name: str) -> Arena:
    if name == "wide":
        return Arena.from_course(Course(pit=0.3, plateau=1.2, height=0.15, width=3.0), "wide")
    return load_arena(name)


def make_envs(cell: Cell, track_control: str, rng: np.random.Generator, lanes: int) -> OrganismVectorEnv:
    """Make the simulations of a cell; the difficulty of the task is drawn."""
    parameters: dict[str, dict[str, Any]] = {
        "cross_gap": {"start": "pit"},
        "climb": {},
        "reach": {"distance": rng.uniform(0.3, 1.0)},
        "traverse": {"share": rng.uniform(0.1, 0.5)},
        "explore": {"share": rng.uniform(0.1, 0.4)},
        "recover": {"least": 0.3, "most": np.pi},
    }
    arena: Any = _find_arena(cell.arena)
    course: dict[str, Any] = {}
    if cell.arena == "truth":
        arena, course = "truth", {"pit": float(rng.choice([0.20, 0.25, 0.30, 0.35, 0.40]))}
    return OrganismVectorEnv(
        lanes,
        arena=arena,
        task=cell.task,
        organism=BODIES[cell.body],
        track_control=track_control,
        sensors=_SENSORS,
        randomize=_RANDOMIZE,
        duration=DURATION,
        stuck_time=STUCK_TIME,
        autoreset_mode="Disabled",
        num_threads=1,
        **parameters[cell.task],
        **course,
    )


def run_random(envs: OrganismVectorEnv, law: OwnController, rng: np.random.Generator) -> list[Episode]:
    """Run random genotypes of a law, or in one round of four actions that are held for a while."""
    seed = int(rng.integers(2**31))
    if rng.random() < 0.25:
        return run_episodes(envs, _hold_actions(envs, rng), seed)
    genotypes = rng.normal(0.0, rng.uniform(0.05, 0.7), (envs.num_envs, len(law.parameters)))
    genotypes += np.array(law.initial) * (rng.random() < 0.5)
    return run_episodes(envs, _follow(envs, law, np.clip(genotypes, law.lower, law.upper)), seed)


def run_evolution(envs: OrganismVectorEnv, law: OwnController, rng: np.random.Generator) -> list[Episode]:
    """Run CMA-ES, one trial each; return the episodes of the generations after the first."""
    options = {"popsize": envs.num_envs, "bounds": [law.lower[0], law.upper[0]], "verbose": -9}
    options["seed"] = int(rng.integers(1, 2**31))
    strategy = cma.CMAEvolutionStrategy(np.array(law.initial) * (rng.random() < 0.5), 0.3, options)
    found: list[Episode] = []
    for generation in range(GENERATIONS):
        genotypes = np.array(strategy.ask())
        episodes = run_episodes(envs, _follow(envs, law, genotypes), int(rng.integers(2**31)))
        strategy.tell(list(genotypes), [-one.fitness for one in episodes])
        found += episodes if generation else []
    return found


def _follow(envs: OrganismVectorEnv, law: OwnController, genotypes: np.ndarray) -> Policy:
    state: Any = law.begin(envs.num_envs)

    def act(observation: np.ndarray) -> np.ndarray:
        nonlocal state
        actions, state = law.act(observation, genotypes, envs.observation_structure, state)
        return actions

    return act


def _hold_actions(envs: OrganismVectorEnv, rng: np.random.Generator) -> Policy:
    shape, tick = envs.action_space.shape, 0
    actions = np.zeros(shape or ())

    def act(observation: np.ndarray) -> np.ndarray:
        nonlocal tick, actions
        if tick % _HELD_TICKS == 0:
            actions = rng.uniform(-1.0, 1.0, shape)
        tick += 1
        return actions

    return act


def run_episodes(envs: OrganismVectorEnv, act: Policy, seed: int) -> list[Episode]:
    """Run an episode in each simulation and audit the successes."""
    observation, info = envs.reset(seed=seed)
    world, dt = envs.world, envs.config.dt
    moves = [*range(7), *world.hinge_qpos]
    qpos, finished = envs.batch.bind("qpos"), np.zeros(envs.num_envs, dtype=bool)
    recorded = [qpos[:, moves].copy()]
    while not finished.all():
        observation, _, terminated, truncated, info = envs.step(act(observation))
        recorded.append(qpos[:, moves].copy())
        finished |= terminated | truncated
    states, episodes = np.array(recorded), []
    for row in range(envs.num_envs):
        faults: tuple[str, ...] = ()
        if info["success"][row]:
            count = round(info["time"][row] / dt) + 1
            recording = Trajectory(np.arange(count) * dt, states[:count, row])
            faults = audit_task(recording, world.task, world.scene, envs.config.track_speed).faults
        success = bool(info["success"][row])
        episodes.append(Episode(success, float(info["progress"][row]) + success, faults))
    return episodes
