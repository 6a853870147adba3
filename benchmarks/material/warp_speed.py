"""What a device takes: speed by number of simulations, the parts of a control step, a generation, the networks."""

import time
from typing import Any

import numpy as np

from symbrion_gym._src.assets import NAMED_ARENAS
from symbrion_gym._src.environment.making import make_vector_env
from symbrion_gym._src.errors import OptionError

TICKS = 50
"""Of a measurement, after as many to warm up and to reach the ground."""
GENOTYPES, TRIALS = 4096, 3
"""Of the generation."""
NETWORK_POINTS = 600_000
NETWORK_SIZES = {"gsrm": {"units": 2200}, "gg": {"triangles": 13860}}


def find_task(arena: str) -> dict[str, Any]:
    """Return the options with which an arena is driven: across its pit, or, in a folder, from one place to another."""
    return {} if arena in NAMED_ARENAS else {"task": "traverse", "track_control": "body"}


def find_array(device: str) -> str:
    """Return "jax" where JAX sees a device of Warp, and "numpy" where only Warp does."""
    from symbrion_gym._src.environment.warp.batch import find_device
    from symbrion_gym._src.environment.warp.device_vector_env import find_jax_device

    try:
        find_jax_device(find_device(device))
    except OptionError as error:
        print(f"measured with array='numpy': {error}", flush=True)
        return "numpy"
    return "jax"


def measure_host(arena: str) -> dict[str, float]:
    """Return the speed of one thread of the C engine, with 16 simulations."""
    envs = make_vector_env(16, arena=arena, num_threads=1, **find_task(arena))
    envs.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, envs.action_space.shape or ())
    for _ in range(TICKS):
        envs.step(actions)
    start = time.perf_counter()
    for _ in range(TICKS):
        envs.step(actions)
    return _summarize(envs, time.perf_counter() - start)


def measure_device(
    arena: str, count: int, device: str, array: str = "jax", ticks: int = TICKS
) -> dict[str, float]:
    """Return the speed on a device, the time to the first step, and memory.

    Args:
        arena: name or folder.
        count: number of simulations.
        device: of Warp.
        array: "jax" or "torch" keep everything on the device; "numpy" only the physics.
        ticks: of the measurement, after as many to warm up.
    """
    began = time.perf_counter()
    options = {"arena": arena, "autoreset_mode": "SameStep", **find_task(arena)}
    before = _find_memory(device)
    envs: Any = make_vector_env(count, backend="warp", array=array, device=device, **options)
    made = time.perf_counter()
    envs.reset(seed=0)
    laid = time.perf_counter()
    actions = make_actions(envs, array)
    envs.step(actions)
    first = wait(envs)
    for _ in range(ticks):
        envs.step(actions)
    start = wait(envs)
    for _ in range(ticks):
        envs.step(actions)
    row = _summarize(envs, wait(envs) - start, ticks)
    row |= {
        "seconds_to_make": made - began,
        "seconds_to_lay_down": laid - made,
        "seconds_of_first_step": first - laid,
        "bytes_of_device": _find_memory(device),
        "bytes_before": before,
    }
    envs.close()
    return {name: float(value) for name, value in row.items()}


def make_actions(envs: Any, array: str) -> Any:
    """Return random actions of the kind that an environment takes, on its device."""
    values = np.random.default_rng(0).uniform(-1.0, 1.0, envs.action_space.shape).astype(np.float32)
    if array == "numpy":
        return values
    import jax

    found = jax.device_put(values, envs.batch.jax_device)
    if array == "torch":
        import torch

        return torch.utils.dlpack.from_dlpack(jax.block_until_ready(found))
    return found


def wait(envs: Any) -> float:
    """Return the time once the device has finished [s]."""
    if hasattr(envs, "find_running"):
        import jax

        jax.block_until_ready(envs.find_running())
    return time.perf_counter()


def _find_memory(device: str) -> float:
    """Return the memory in use on a GPU, of all its processes [bytes]; 0 on the processor."""
    from symbrion_gym._src.environment.warp.batch import find_device

    found = find_device(device)
    return 0.0 if found.is_cpu else float(found.total_memory - found.free_memory)


def _summarize(envs: Any, seconds: float, ticks: int = TICKS) -> dict[str, float]:
    return {
        "robot_seconds_per_second": envs.num_envs * ticks * envs.config.dt / seconds,
        "ms_per_tick": 1e3 * seconds / ticks,
    }


def measure_generation(genotypes: int = GENOTYPES, trials: int = TRIALS, **options: Any) -> dict[str, float]:
    """Return the time of a generation of the path law, the first with compilation, and the shares of success.

    `options` of the environment shorten what only has to run.
    """
    from evolution._src.backends.rollout import simulate_on_device
    from evolution._src.backends.trials import Job, Trials, find_trial_controller
    from evolution._src.search.config import EvolutionConfig

    config = EvolutionConfig(arena="truth", start="pit", controller="path")
    conditions = Trials(
        arena="truth",
        start="pit",
        controller="path",
        count=trials,
        randomization=_find_unstretched(config),
        **options,
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

    from benchmarks.evidence.surfaces import make_course_cloud
    from reconstruction._src.reconstruct import reconstruct

    cloud, rows = make_course_cloud(points)[0], {}
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
