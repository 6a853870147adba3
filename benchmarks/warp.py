"""MuJoCo Warp against MuJoCo's C engine: the same episodes, and speed by number of simulations.

    python -m benchmarks.warp [--quick] [--device cuda:0] [--worlds 64 ...] [--only ticks crossings speed]

It needs the extra `gpu`. Without a GPU it runs on the processor, which shows that both engines agree, and nothing about
the speed of a GPU.
"""

import argparse
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.evolution_runs import Results
from benchmarks.material.warp_parity import ARENAS, compare_crossings, compare_ticks
from reconstruction.extras import find_missing, require_extras
from symbrion_gym.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym.warp.making import make_vector_env

PARTS = ("ticks", "crossings", "speed")
WORLDS = (64, 256, 1024, 4096, 16384)
QUICK_WORLDS = (16, 64)
CONTROLLERS, CROSSINGS = 20, 30
STEPS = 200
"""Physics steps of the comparison of ticks."""
SPEED_ARENAS = ("truth", "gsrm")
TICKS = 50
"""Of a measurement of speed, after as many to warm up and to reach the ground."""


def measure_ticks(results: Results, device: str) -> None:
    """Compare random controllers on all arenas."""
    rows = {}
    for arena in ARENAS:
        rows[arena] = compare_ticks(arena, CONTROLLERS, STEPS // 4, device)
        print(f"{arena:8s} {rows[arena]}", flush=True)
    results.put("ticks", {"device": device, **rows})


def measure_crossings(results: Results, device: str, quick: bool) -> None:
    """Compare how random controllers cross the pit."""
    rows = {}
    for arena in ("truth",):
        rows[arena] = compare_crossings(arena, CROSSINGS, device)
        print(f"{arena:8s} {rows[arena]}", flush=True)
    results.put("crossings", {"device": device, **rows})


def measure_speed(results: Results, device: str, worlds: Sequence[int]) -> None:
    """Measure simulated seconds per second, on a device and on one thread of the C engine."""
    rows: dict[str, Any] = {}
    for arena in SPEED_ARENAS:
        rows[arena] = {"C, one thread": _measure(make_vector_env(16, arena=arena, num_threads=1))}
        print(f"{arena:8s} C, one thread: {rows[arena]['C, one thread']}", flush=True)
        for count in worlds:
            began = time.perf_counter()
            envs = make_vector_env(count, backend="warp", device=device, arena=arena)
            row = _measure(envs, began)
            rows[arena][f"{count} worlds"] = row
            print(f"{arena:8s} {count:6d} worlds: {row}", flush=True)
    results.put("speed", {"device": device, **rows})


def _measure(envs: OrganismVectorEnv, began: float | None = None) -> dict[str, float]:
    """Return the speed of an environment, and what its physics alone takes."""
    rng = np.random.default_rng(0)
    envs.reset(seed=0)
    actions = rng.uniform(-1.0, 1.0, envs.action_space.shape or ())
    envs.step(actions)
    first = time.perf_counter()
    for _ in range(TICKS):
        envs.step(actions)
    start = time.perf_counter()
    for tick in range(TICKS):
        if tick % 25 == 0:
            actions = rng.uniform(-1.0, 1.0, actions.shape)
        envs.step(actions)
    seconds = time.perf_counter() - start
    start = time.perf_counter()
    for _ in range(TICKS):
        envs.batch.step(None, nstep=envs.config.frame_skip)
    physics = time.perf_counter() - start
    row = {
        "robot_seconds_per_second": envs.num_envs * TICKS * envs.config.dt / seconds,
        "ms_per_tick": 1e3 * seconds / TICKS,
        "ms_of_physics": 1e3 * physics / TICKS,
    }
    envs.close()
    return row if began is None else row | {"seconds_to_first_step": first - began}


def run(
    quick: bool = False, device: str | None = None, worlds: Sequence[int] = (), only: Sequence[str] = ()
) -> None:
    """Run the parts; write results/warp.json part by part."""
    if find_missing("gpu"):
        print("skipped: pip install 'symbrion-gym[gpu]'")
        return
    results, parts = Results("warp"), only or PARTS
    device = device or _find_device()
    if "ticks" in parts:
        measure_ticks(results, device)
    if "crossings" in parts:
        measure_crossings(results, device, quick)
    if "speed" in parts:
        few = quick or device == "cpu"
        measure_speed(results, device, worlds or (QUICK_WORLDS if few else WORLDS))


def _find_device() -> str:
    from symbrion_gym.warp.requirements import find_device, import_warp

    return find_device(import_warp()[0], None).alias


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="one arena of crossings, few simulations")
    parser.add_argument("--device", help="of Warp, such as cuda:0 or cpu (default: a GPU if there is one)")
    parser.add_argument("--worlds", type=int, nargs="*", default=(), help="numbers of simulations")
    parser.add_argument("--only", nargs="*", default=(), choices=PARTS, help="parts to measure")
    options = parser.parse_args()
    require_extras("`python -m benchmarks.warp`", "gpu")
    run(options.quick, options.device, options.worlds, options.only)
