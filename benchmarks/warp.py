"""MuJoCo Warp against MuJoCo's C engine: the same episodes, and speed by number of simulations.

    python -m benchmarks.warp [--quick] [--device cuda:0] [--worlds 64 ...] [--arenas truth ...] [--array torch]
                             [--only ticks crossings speed generation networks ppo ppo_host]

It needs the extra `gpu`. Without a GPU it runs on the processor, which shows that both engines agree, and nothing about
the speed of a GPU. A part that fails is reported, and the next one begins; what a part has measured is stored at once.
"""

import argparse
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from benchmarks.material import warp_ppo
from benchmarks.material.warp_parity import ARENAS, compare_crossings, compare_ticks
from benchmarks.material.warp_speed import (
    find_array,
    measure_device,
    measure_generation,
    measure_host,
    measure_networks,
)
from benchmarks.report import Results
from reconstruction._src.base.extras import find_missing, require_extras

WORLDS = (64, 256, 1024, 4096, 16384)
QUICK_WORLDS = (16, 64)
TICKS, QUICK_TICKS = 50, 3
"""Control steps that a speed is measured over."""
CONTROLLERS, CROSSINGS = 20, 30
QUICK_CONTROLLERS = 2
STEPS, QUICK_STEPS = 200, 40
"""Physics steps of the comparison of ticks."""
SPEED_ARENAS = ("truth", "gsrm")
ARRAYS = ("jax", "torch", "numpy")


class Setting(NamedTuple):
    """What is measured where.

    Attributes:
        results: file of results.
        device: of Warp.
        quick: whether everything is tiny.
        worlds: numbers of simulations; none for the usual ones.
        arenas: names or folders, of speed.
        array: what environments take and return; None for "jax" where JAX sees the device.
    """

    results: Results
    device: str
    quick: bool
    worlds: tuple[int, ...]
    arenas: tuple[str, ...]
    array: str | None


def measure_ticks(setting: Setting) -> None:
    """Compare random controllers on all arenas."""
    rows, quick = {}, setting.quick
    controllers, steps = (QUICK_CONTROLLERS, QUICK_STEPS) if quick else (CONTROLLERS, STEPS)
    for arena in ARENAS[: 1 if quick else None]:
        rows[arena] = compare_ticks(arena, controllers, steps // 4, setting.device)
        print(f"{arena:8s} {rows[arena]}", flush=True)
    setting.results.put("ticks", {"device": setting.device, **rows})


def measure_crossings(setting: Setting) -> None:
    """Compare how random controllers cross a pit of the truth; scanned arenas have wider ones, which none crosses."""
    row = compare_crossings("truth", QUICK_CONTROLLERS if setting.quick else CROSSINGS, setting.device)
    print(f"crossings {row}", flush=True)
    setting.results.put("crossings", {"device": setting.device, "truth": row})


def list_worlds(setting: Setting) -> tuple[int, ...]:
    """Return the numbers of simulations to measure."""
    return setting.worlds or (QUICK_WORLDS if setting.quick or setting.device == "cpu" else WORLDS)


def measure_speed(setting: Setting) -> None:
    """Measure simulated seconds per second, on a device and on one thread of the C engine."""
    rows: dict[str, Any] = {}
    array = setting.array or find_array(setting.device)
    ticks = QUICK_TICKS if setting.quick else TICKS
    part = "speed" if array == "jax" else f"speed_{array}"
    for arena in setting.arenas:
        rows[arena] = {"C, one thread": measure_host(arena)}
        print(f"{arena:8s} C, one thread: {rows[arena]['C, one thread']}", flush=True)
        for count in list_worlds(setting):
            row = rows[arena][f"{count} worlds"] = measure_device(arena, count, setting.device, array, ticks)
            print(f"{arena:8s} {count:6d} worlds: {row}", flush=True)
            setting.results.put(part, {"device": setting.device, "array": array, **rows})


def measure_one_generation(setting: Setting) -> None:
    """Measure a generation on the device."""
    row = measure_generation(4, 1, duration=0.5) if setting.quick else measure_generation()
    print(f"generation {row}", flush=True)
    setting.results.put("generation", {"device": setting.device, **row})


def measure_both_networks(setting: Setting) -> None:
    """Measure the networks on every kind of device that JAX sees."""
    rows = measure_networks(*((20_000,) if setting.quick else ()))
    print(f"networks {rows}", flush=True)
    setting.results.put("networks", rows)


def measure_learning(setting: Setting) -> None:
    """Measure PPO; a quick run has few updates of short episodes."""
    size = warp_ppo.ON_PROCESSOR if setting.device == "cpu" else warp_ppo.ON_GPU
    quick_options = {"modules": 3, "duration": 1.0}
    size, options = (warp_ppo.QUICK, quick_options) if setting.quick else (size, {})
    row = warp_ppo.measure_ppo(
        setting.device, size, lambda found: setting.results.put("ppo", found), **options
    )
    setting.results.put("ppo", row)


def measure_learning_on_host(setting: Setting) -> None:
    """Measure the same learner with MuJoCo's C engine on one thread, for the first seed that is missing."""
    stored = setting.results.content.get("ppo_host", {})
    runs = list(stored.get("runs", [])) if not setting.quick else []
    seed = next(each for each in range(len(runs) + 1) if each not in {run["seed"] for run in runs})
    quick_options = {"modules": 3, "duration": 1.0}
    size, options = (warp_ppo.QUICK, quick_options) if setting.quick else (warp_ppo.ON_PROCESSOR, {})
    row = warp_ppo.measure_ppo("mujoco", size, lambda found: None, seed, **options)
    setting.results.put("ppo_host", {"runs": [*runs, row]})


PARTS: dict[str, Callable[[Setting], None]] = {
    "ticks": measure_ticks,
    "crossings": measure_crossings,
    "speed": measure_speed,
    "generation": measure_one_generation,
    "networks": measure_both_networks,
    "ppo": measure_learning,
    "ppo_host": measure_learning_on_host,
}


def run(
    quick: bool = False,
    device: str | None = None,
    worlds: Sequence[int] = (),
    only: Sequence[str] = (),
    arenas: Sequence[str] = SPEED_ARENAS,
    array: str | None = None,
) -> list[str]:
    """Run the parts; write results/warp.json part by part, and return the names of those that failed."""
    if find_missing("gpu"):
        print("skipped: pip install 'symbrion-gym[gpu]'")
        return []
    # by default JAX reserves three quarters of a GPU's memory, and Warp finds no room for 16,384 simulations
    os.environ.setdefault("XLA_PYTHON_CLIENT_PREALLOCATE", "false")
    setting = Setting(Results("warp"), device or _find_device(), quick, tuple(worlds), tuple(arenas), array)
    failed = []
    for name in only or PARTS:
        try:
            PARTS[name](setting)
        except Exception:  # a GPU is lent for a while: the other parts are measured nevertheless
            traceback.print_exc()
            failed.append(name)
    return failed


def _find_device() -> str:
    from symbrion_gym._src.environment.warp.batch import find_device

    return find_device(None).alias


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="few simulations, genotypes and points")
    parser.add_argument("--device", help="of Warp, such as cuda:0 or cpu (default: a GPU if there is one)")
    parser.add_argument("--worlds", type=int, nargs="*", default=(), help="numbers of simulations")
    parser.add_argument("--arenas", nargs="*", default=SPEED_ARENAS, help="names or folders, of speed")
    parser.add_argument("--array", choices=ARRAYS, help="of speed (default: jax, numpy where JAX has no GPU)")
    parser.add_argument("--only", nargs="*", default=(), choices=list(PARTS), help="parts to measure")
    options = parser.parse_args()
    require_extras("`python -m benchmarks.warp`", "gpu")
    failed = run(options.quick, options.device, options.worlds, options.only, options.arenas, options.array)
    sys.exit(f"failed: {', '.join(failed)}" if failed else 0)
