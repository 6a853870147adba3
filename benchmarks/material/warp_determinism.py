"""The deterministic mode of Warp: whether equal seeds give equal bits with it and without it, and what it costs."""

import time
from typing import Any

import numpy as np

from benchmarks.material.warp_speed import find_array, find_task, make_actions, wait
from symbrion_gym._src.environment.making import make_vector_env

ROUNDS, TICKS = 7, 10
"""Of the paired measurement: both environments take turns."""
MODES = {"usual": False, "deterministic": True}


def measure_determinism(arena: str, count: int, device: str, rounds: int = ROUNDS) -> dict[str, Any]:
    """Compare the usual mode with the deterministic one, alternating.

    Returns:
        For each mode the median times of a control step, of the processor and of the clock [ms], and in how many
        simulations two episodes from equal seeds end in equal bits; and the median ratio of both modes' times.
    """
    array = find_array(device)
    options = {"arena": arena, "autoreset_mode": "Disabled", **find_task(arena)}
    envs = {
        name: make_vector_env(
            count, backend="warp", array=array, device=device, is_deterministic=is_deterministic, **options
        )
        for name, is_deterministic in MODES.items()
    }
    row: dict[str, Any] = {"simulations": count, "rounds": rounds, "ticks": TICKS, "array": array}
    for name, each in envs.items():
        ends = [_run(each, array, rounds) for _ in range(2)]
        row[name] = {"equal": int((ends[0] == ends[1]).all(axis=1).sum())}
    taken: dict[str, list[tuple[float, float]]] = {name: [] for name in envs}
    for each in envs.values():
        each.reset(seed=0)
    for _ in range(rounds):
        for name, each in envs.items():
            taken[name].append(_time(each, array))
    arrays = {name: np.array(values) for name, values in taken.items()}
    for name, values in arrays.items():
        row[name] |= dict(zip(("processor_ms", "ms"), np.median(values, axis=0).tolist(), strict=True))
    ratio = np.median(arrays["deterministic"] / arrays["usual"], axis=0)
    for each in envs.values():
        each.close()
    return row | {"processor_ratio": float(ratio[0]), "ratio": float(ratio[1])}


def _run(envs: Any, array: str, rounds: int) -> np.ndarray:
    """Return the observations at the end of an episode's first ticks."""
    observation, _ = envs.reset(seed=0)
    actions = make_actions(envs, array)
    for _ in range(rounds * TICKS):
        observation, *_ = envs.step(actions)
    return np.asarray(observation)


def _time(envs: Any, array: str) -> tuple[float, float]:
    """Return the time of a control step, of the processor and of the clock [ms]."""
    actions = make_actions(envs, array)
    wait(envs)
    began = time.process_time(), time.perf_counter()
    for _ in range(TICKS):
        envs.step(actions)
    ended = wait(envs)
    return 1e3 * (time.process_time() - began[0]) / TICKS, 1e3 * (ended - began[1]) / TICKS
