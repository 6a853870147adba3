"""What a device takes: speed by number of simulations, the parts of a control step, a generation, the networks."""

import time
from typing import Any

import numpy as np

from symbrion_gym.warp.making import make_vector_env

TICKS = 50
"""Of a measurement, after as many to warm up and to reach the ground."""
GENOTYPES, TRIALS = 4096, 3
"""Of the generation."""
NETWORK_POINTS = 600_000
NETWORK_SIZES = {"gsrm": {"units": 2200}, "gg": {"triangles": 13860}}


def measure_host(arena: str) -> dict[str, float]:
    """Return the speed of one thread of the C engine, with 16 simulations."""
    envs = make_vector_env(16, arena=arena, num_threads=1)
    envs.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, envs.action_space.shape or ())
    for _ in range(TICKS):
        envs.step(actions)
    start = time.perf_counter()
    for _ in range(TICKS):
        envs.step(actions)
    return _summarize(envs, time.perf_counter() - start)


def measure_device(arena: str, count: int, device: str) -> dict[str, float]:
    """Return the speed with everything on the device, the parts of a control step, and memory.

    A part is waited for before the next begins, so that the parts together take longer than a step.
    """
    import jax

    began = time.perf_counter()
    envs: Any = make_vector_env(
        count, backend="warp", array="jax", device=device, arena=arena, autoreset_mode="SameStep"
    )
    made = time.perf_counter()
    envs.reset(seed=0)
    laid = time.perf_counter()
    key = jax.random.key(0)
    with jax.default_device(envs.batch.jax_device):
        actions = jax.random.uniform(key, envs.action_space.shape, minval=-1.0)
        jax.block_until_ready(envs.step(actions)[0])
        first = time.perf_counter()
        for _ in range(TICKS):
            envs.step(actions)
        start = _wait(envs)
        for _ in range(TICKS):
            envs.step(actions)
        row = _summarize(envs, _wait(envs) - start)
        parts = np.array([envs.time_parts(actions) for _ in range(TICKS)])
    row |= {
        "seconds_to_make": made - began,
        "seconds_to_lay_down": laid - made,
        "seconds_of_first_step": first - laid,
        **dict(
            zip(
                ("ms_of_commands", "ms_of_physics", "ms_of_terms"),
                1e3 * np.median(parts, axis=0),
                strict=True,
            )
        ),
        "bytes_of_device": _find_memory(envs),
    }
    envs.close()
    return {name: float(value) for name, value in row.items()}


def _wait(envs: Any) -> float:
    """Return the time once the device has finished [s]."""
    import jax

    jax.block_until_ready(envs.find_running())
    return time.perf_counter()


def _find_memory(envs: Any) -> float:
    """Return the memory in use on a GPU, of all its processes [bytes]; 0 on the processor."""
    device = envs.batch.warp_device
    return 0.0 if device.is_cpu else float(device.total_memory - device.free_memory)


def _summarize(envs: Any, seconds: float) -> dict[str, float]:
    return {
        "robot_seconds_per_second": envs.num_envs * TICKS * envs.config.dt / seconds,
        "ms_per_tick": 1e3 * seconds / TICKS,
    }


def measure_generation(genotypes: int = GENOTYPES, trials: int = TRIALS) -> dict[str, float]:
    """Return the time of a generation of the travelling law, the first with compilation, and the shares of success."""
    from evolution.backends.rollout import simulate_on_device
    from evolution.backends.trials import Job, Trials, find_trial_controller
    from evolution.search.config import EvolutionConfig

    config = EvolutionConfig(arena="truth", start="pit", controller="travelling")
    conditions = Trials(
        arena="truth",
        start="pit",
        controller="travelling",
        count=trials,
        randomization=_find_unstretched(config),
    )
    initial = np.array(find_trial_controller(conditions).initial)
    rng, row = np.random.default_rng(0), {"genotypes": float(genotypes), "trials": float(trials)}
    for name in ("seconds_of_first", "seconds"):
        jobs = [Job(initial + rng.normal(0.0, 0.3, len(initial)), conditions) for _ in range(genotypes)]
        start = time.perf_counter()
        outcomes = simulate_on_device(jobs)
        row[name] = time.perf_counter() - start
        row["success_share"] = float(np.mean([outcome.succeeded for outcome in outcomes]))
        row["errors"] = float(sum(bool(outcome.error) for outcome in outcomes))
    return row


def _find_unstretched(config: Any) -> Any:
    """Return the randomization of a run without stretches, so that one batch holds all trials."""
    from dataclasses import replace

    return replace(config.randomization, stretch=(1.0,))


def measure_networks(points: int = NETWORK_POINTS) -> dict[str, dict[str, float]]:
    """Return the times of the networks on the processor and on the first GPU that JAX sees, warm [s]."""
    import jax

    from benchmarks.material.clouds import make_arena
    from reconstruction.reconstruct import reconstruct

    cloud, rows = make_arena(points).points, {}
    kinds = {device.platform: device for device in (*jax.devices("cpu"), *jax.devices())}
    for method, options in NETWORK_SIZES.items():
        rows[method] = {"points": float(len(cloud))}
        for kind, device in kinds.items():
            with jax.default_device(device):
                reconstruct(cloud, method, seed=0, **options)
                start = time.perf_counter()
                reconstruct(cloud, method, seed=0, **options)
                rows[method][f"seconds on {kind}"] = time.perf_counter() - start
    return rows
