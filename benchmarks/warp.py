"""MuJoCo Warp against MuJoCo's C engine: the same episodes, and speed by number of simulations.

    python -m benchmarks.warp [--quick] [--device cuda:0] [--worlds 64 ...] [--arenas truth ...]
                             [--only ticks crossings speed generation networks ppo]

It needs the extra `gpu`. Without a GPU it runs on the processor, which shows that both engines agree, and nothing about
the speed of a GPU.
"""

import argparse
from collections.abc import Sequence
from typing import Any

from benchmarks.evolution_runs import Results
from benchmarks.material import warp_ppo
from benchmarks.material.warp_parity import ARENAS, compare_crossings, compare_ticks
from benchmarks.material.warp_speed import measure_device, measure_generation, measure_host, measure_networks
from reconstruction.extras import find_missing, require_extras

PARTS = ("ticks", "crossings", "speed", "generation", "networks", "ppo")
WORLDS = (64, 256, 1024, 4096, 16384)
QUICK_WORLDS = (16, 64)
CONTROLLERS, CROSSINGS = 20, 30
STEPS = 200
"""Physics steps of the comparison of ticks."""
SPEED_ARENAS = ("truth", "gsrm")


def measure_ticks(results: Results, device: str) -> None:
    """Compare random controllers on all arenas."""
    rows = {}
    for arena in ARENAS:
        rows[arena] = compare_ticks(arena, CONTROLLERS, STEPS // 4, device)
        print(f"{arena:8s} {rows[arena]}", flush=True)
    results.put("ticks", {"device": device, **rows})


def measure_crossings(results: Results, device: str) -> None:
    """Compare how random controllers cross a pit of the truth; scanned arenas have wider ones, which none crosses."""
    row = compare_crossings("truth", CROSSINGS, device)
    print(f"crossings {row}", flush=True)
    results.put("crossings", {"device": device, "truth": row})


def measure_speed(results: Results, device: str, worlds: Sequence[int], arenas: Sequence[str]) -> None:
    """Measure simulated seconds per second, on a device and on one thread of the C engine."""
    rows: dict[str, Any] = {}
    for arena in arenas:
        rows[arena] = {"C, one thread": measure_host(arena)}
        print(f"{arena:8s} C, one thread: {rows[arena]['C, one thread']}", flush=True)
        for count in worlds:
            row = rows[arena][f"{count} worlds"] = measure_device(arena, count, device)
            print(f"{arena:8s} {count:6d} worlds: {row}", flush=True)
    results.put("speed", {"device": device, **rows})


def measure_others(results: Results, device: str, parts: Sequence[str], quick: bool) -> None:
    """Measure a generation and the networks."""
    if "generation" in parts:
        row = measure_generation(*((4, 1) if quick else ()))
        print(f"generation {row}", flush=True)
        results.put("generation", {"device": device, **row})
    if "networks" in parts:
        rows = measure_networks(*((20_000,) if quick else ()))
        print(f"networks {rows}", flush=True)
        results.put("networks", rows)


def measure_learning(results: Results, device: str, quick: bool) -> None:
    """Measure PPO; a quick run has few updates of short episodes."""
    size = warp_ppo.ON_PROCESSOR if device == "cpu" else warp_ppo.ON_GPU
    size, options = (warp_ppo.QUICK, {"modules": 3, "duration": 1.0}) if quick else (size, {})
    row = warp_ppo.measure_ppo(device, size, lambda found: results.put("ppo", found), **options)
    results.put("ppo", row)


def run(
    quick: bool = False,
    device: str | None = None,
    worlds: Sequence[int] = (),
    only: Sequence[str] = (),
    arenas: Sequence[str] = SPEED_ARENAS,
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
        measure_crossings(results, device)
    if "speed" in parts:
        few = quick or device == "cpu"
        measure_speed(results, device, worlds or (QUICK_WORLDS if few else WORLDS), arenas)
    measure_others(results, device, parts, quick)
    if "ppo" in parts:
        measure_learning(results, device, quick)


def _find_device() -> str:
    from symbrion_gym.warp.requirements import find_device, import_warp

    return find_device(import_warp()[0], None).alias


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="few simulations, genotypes and points")
    parser.add_argument("--device", help="of Warp, such as cuda:0 or cpu (default: a GPU if there is one)")
    parser.add_argument("--worlds", type=int, nargs="*", default=(), help="numbers of simulations")
    parser.add_argument("--arenas", nargs="*", default=SPEED_ARENAS, help="names or folders, of speed")
    parser.add_argument("--only", nargs="*", default=(), choices=PARTS, help="parts to measure")
    options = parser.parse_args()
    require_extras("`python -m benchmarks.warp`", "gpu")
    run(options.quick, options.device, options.worlds, options.only, options.arenas)
