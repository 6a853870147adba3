"""The same episodes on MuJoCo's C engine and on MuJoCo Warp, side by side."""

from typing import Any, NamedTuple

import numpy as np

from benchmarks.material.crossings import cross, draw_conditions, draw_controllers
from benchmarks.material.warp_steps import compare, find_same, make_setting, run_reference, run_warp
from symbrion_gym._src.environment.making import make_vector_env
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv

ARENAS = ("truth", "simple", "gsrm", "gg")
OFFSET = 1e-6
"""Of the start beside which the C engine is run again [m], [rad]: what Warp differs by before contacts differ."""
PIT = 0.30
"""Width of the pit [m]."""
SHARE = 0.2
"""Of the random angles of other benchmarks: with all of it one of 30 controllers crosses, without any of it all do."""
STUCK_TIME = 3.0
"""A controller that makes no progress for so long does not cross [s]."""
TICKS_PER_ACTION = 25
"""Random actions are held for so long: half a second."""
FORCES = ("acceleration", "contact")
"""Parts of the observation that change by much where a contact changes by little."""


class Differences(NamedTuple):
    """Largest differences between the engines over one kind of ticks, of all controllers.

    Attributes:
        qpos: [m] and [rad].
        observation: of the range of each number, without `FORCES`.
        force: likewise of `FORCES`.
        reward: reward of a tick.
        endings: ticks with other terminations or truncations.
    """

    qpos: float
    observation: float
    force: float
    reward: float
    endings: int


def make_both(
    arena: str, num_envs: int, device: str, **options: Any
) -> tuple[OrganismVectorEnv, OrganismVectorEnv]:
    """Return the same environments on the C engine and on a device."""
    more = {"arena": arena, "autoreset_mode": "Disabled", **options}
    return (
        make_vector_env(num_envs, **more, num_threads=1),
        make_vector_env(num_envs, backend="warp", device=device, **more),
    )


def compare_ticks(arena: str, controllers: int, ticks: int, device: str, seed: int = 0) -> dict[str, Any]:
    """Step random controllers on both engines; return differences while contacts agree, and over all ticks.

    Contacts of a simulation agree up to the first physics step in which other geoms touch. The same engine beside
    itself shows what such differences are: its state rounded to 32 bits, and begun `OFFSET` beside the start.
    """
    rng = np.random.default_rng(seed)
    reference, other = make_both(arena, controllers, device)
    conditions = draw_conditions(rng, controllers)
    first, second = (envs.reset(seed=seed, options=conditions)[0] for envs in (reference, other))
    scale = reference.single_observation_space.high - reference.single_observation_space.low
    assert np.abs(first - second).max() == 0.0
    is_force = np.zeros(scale.shape, dtype=bool)
    for name in FORCES:
        is_force[reference.observation_structure[name]] = True
    setting = make_setting(arena, controllers, 4 * ticks, seed)
    steps, same_engine = list(run_reference(setting)), {}
    for name, how in (("rounded", {"is_rounded": True}), ("beside", {"offset": OFFSET})):
        same_engine[name] = compare(steps, list(run_reference(setting, **how)))
    stepped = list(run_warp(setting, device))
    is_same = find_same(steps, stepped)[reference.config.frame_skip - 1 :: reference.config.frame_skip]
    running = np.ones(controllers, dtype=bool)
    rows = []
    for tick in range(ticks):
        if tick % TICKS_PER_ACTION == 0:
            actions = rng.uniform(-1.0, 1.0, reference.action_space.shape)
        one, two = reference.step(actions), other.step(actions)
        qpos = np.abs(reference.batch.bind("qpos") - other.batch.bind("qpos")).max(axis=1)
        seen = np.abs(one[0] - two[0]) / scale
        observation, force = seen[:, ~is_force].max(axis=1), seen[:, is_force].max(axis=1)
        endings = (one[2] != two[2]) | (one[3] != two[3])
        gained = np.abs(one[1] - two[1])
        rows.append((qpos, observation, force, gained, endings, is_same[tick], running.copy()))
        running &= ~(one[2] | one[3] | two[2] | two[3])
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    for envs in (reference, other):
        envs.close()
    return {
        "controllers": controllers,
        "ticks": ticks,
        "steps": compare(steps, stepped),
        **{f"steps_{name}": found for name, found in same_engine.items()},
        "agreeing": _summarize(columns, columns[5] & columns[6])._asdict(),
        "all": _summarize(columns, columns[6])._asdict(),
        "contacts_dropped": bool(other.batch.engine.has_overflowed),
    }


def _summarize(columns: list[np.ndarray], mask: np.ndarray) -> Differences:
    *largest, endings = (np.where(mask, column, 0) for column in columns[:5])
    return Differences(*(float(each.max()) for each in largest), int(endings.sum()))


def compare_crossings(arena: str, controllers: int, device: str, seed: int = 0) -> dict[str, Any]:
    """Let random controllers cross the pit on both engines; return in how many the outcome agrees."""
    genotypes = SHARE * draw_controllers(seed, controllers)
    conditions = draw_conditions(np.random.default_rng(seed), controllers)
    options = {"sensors": ("pitch",), "start": "pit", "pit": PIT, "stuck_time": STUCK_TIME}
    one, two = (
        cross(envs, genotypes, conditions) for envs in make_both(arena, controllers, device, **options)
    )
    progress = np.array([[each.progress for each in outcomes] for outcomes in (one, two)])
    return {
        "controllers": controllers,
        "agree": sum(first.success == second.success for first, second in zip(one, two, strict=True)),
        "successes": [sum(each.success for each in outcomes) for outcomes in (one, two)],
        "audit_faults": [sum(bool(each.faults) for each in outcomes) for outcomes in (one, two)],
        "progress_difference_median": float(np.median(np.abs(progress[0] - progress[1]))),
        "progress_difference_max": float(np.abs(progress[0] - progress[1]).max()),
    }
