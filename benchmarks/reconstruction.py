"""Both networks on many kinds of clouds: time, distances, topology; compared with the authors' own program.

Run as `python -m benchmarks.reconstruction [--quick] [--c-reference PATH]`, PATH being the binary
`gnn-gsrm` of danfis/gnn built outside this repository. Distances in millimeters (micrometers for clouds below a
meter), times in seconds, medians of five runs with different seeds. Runs are warm: before each, the same work is done
once without being counted, for our program and the authors', because an idle core is slow at first.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.material.c_gsrm import run_c_gsrm
from benchmarks.material.clouds import CLOUDS, DATA, REAL, Cloud, make_arena
from benchmarks.material.stairs import compare_stairs
from benchmarks.report import write_results
from reconstruction._src.reconstruct import reconstruct
from reconstruction._src.surfaces.quality import Quality, measure_quality

SIZES: dict[str, tuple[str, dict[str, Any]]] = {
    "gsrm 800": ("gsrm", {"units": 800}),
    "gsrm 2200": ("gsrm", {"units": 2200}),
    "gsrm 5000": ("gsrm", {"units": 5000}),
    "gg 210": ("gg", {"triangles": 210}),
    "gg 1500": ("gg", {"triangles": 1500}),
    "gg 13860": ("gg", {"triangles": 13860}),
}
C_UNITS = {"gsrm 800": 800, "gsrm 2200": 2200, "gsrm 5000": 5000, "gg 13860": 2200}
QUICK_CLOUDS = ("arena", "steps", "sphere")
REPEATS = 5


def run(quick: bool = False, c_reference: str | None = None, only: str | None = None) -> dict[str, Any]:
    """Measure, write and return everything.

    Args:
        quick: two runs per row instead of five, small scaling sizes, three clouds.
        c_reference: the authors' binary, run side by side.
        only: the one part to run ("sizes", "clouds", "stairs", "scaling", "start"); the others keep their results.
    """
    binary = Path(c_reference).resolve() if c_reference else None
    parts: dict[str, Callable[[], Any]] = {
        "sizes": lambda: measure_sizes(2 if quick else REPEATS, binary),
        "clouds": lambda: measure_clouds(2 if quick else REPEATS, QUICK_CLOUDS if quick else tuple(CLOUDS)),
        "stairs": measure_stairs,
        "scaling": lambda: measure_scaling((550, 2200, 5000) if quick else (2200, 7000, 22_000, 50_000)),
        "start": measure_cold_start,
    }
    results = {name: part() for name, part in parts.items() if only in (None, name)}
    write_results("reconstruction", results)
    return results


def measure_sizes(repeats: int, binary: Path | None) -> dict[str, dict]:
    """Measure every size on the arena, alternating with runs of the C program."""
    cloud = make_arena()
    assert cloud.truth is not None
    print(_HEADER)
    rows = {}
    for name, (method, options) in SIZES.items():
        seconds, c_seconds, qualities, c_mesh = [], [], [], None
        for seed in range(repeats):
            if binary and name in C_UNITS:
                run_c_gsrm(binary, cloud.points, C_UNITS[name])
                elapsed, c_mesh = run_c_gsrm(binary, cloud.points, C_UNITS[name])
                c_seconds.append(elapsed)
            reconstruct(cloud.points, method, seed=seed, **options)
            begin = time.perf_counter()
            result = reconstruct(cloud.points, method, seed=seed, **options)
            seconds.append(time.perf_counter() - begin)
            qualities.append(result.quality(cloud.truth))
        rows[name] = _make_row(cloud, seconds, qualities, c_seconds)
        _print_row(name, rows[name])
        if c_mesh is not None:
            row = _make_row(cloud, c_seconds, [measure_quality(c_mesh, cloud.points, cloud.truth)])
            rows[f"{name}: C {C_UNITS[name]}"] = row
            _print_row(f"  C {C_UNITS[name]}", row)
    return rows


def measure_clouds(repeats: int, names: tuple[str, ...]) -> dict[str, dict]:
    """Measure 2200 units on every cloud, by GSRM and, where the cloud is a sheet, by the growing grid."""
    print(_HEADER)
    rows = {}
    for name in names:
        if name in REAL and not DATA.exists():
            print(f"{name}: left out, no {DATA}")
            continue
        cloud = CLOUDS[name]()
        for method in ("gsrm", "gg") if cloud.is_sheet else ("gsrm",):
            seconds, qualities = [], []
            for seed in range(repeats):
                reconstruct(cloud.points, method, units=2200, seed=seed)
                begin = time.perf_counter()
                result = reconstruct(cloud.points, method, units=2200, seed=seed)
                seconds.append(time.perf_counter() - begin)
                qualities.append(result.quality(cloud.truth))
            rows[f"{name}, {method}"] = _make_row(cloud, seconds, qualities)
            _print_row(f"{name}, {method}", rows[f"{name}, {method}"])
    return rows


def measure_stairs() -> dict[str, Any] | None:
    """Measure the heights of the real staircase's steps in the meshes."""
    if not DATA.exists():
        print(f"stairs: left out, no {DATA}")
        return None
    cloud = CLOUDS["stairs scan"]()
    results = {}
    for units in (1200, 2200, 5000):
        mesh = reconstruct(cloud.points, "gsrm", units=units).mesh
        results[f"gsrm {units}"] = found = compare_stairs(mesh, cloud.points)
        print(f"stairs gsrm {units}: {found}")
    return results


def measure_scaling(units: tuple[int, ...], samples_per_unit: int = 30) -> dict[str, dict]:
    """Measure how time grows with the size, 30 samples per unit, and the memory of the largest."""
    results = {}
    for method in ("gsrm", "gg"):
        seconds = []
        for number in units:
            points = make_arena(number * samples_per_unit).points
            reconstruct(points, method, units=number)
            runs = []
            for seed in range(3):
                begin = time.perf_counter()
                reconstruct(points, method, units=number, seed=seed)
                runs.append(time.perf_counter() - begin)
            seconds.append(float(np.median(runs)))
            print(f"{method} {number} units, {len(points)} points: {seconds[-1]:.2f} s")
        exponent = float(np.polyfit(np.log(units), np.log(seconds), 1)[0])
        memory = measure_memory(method, units[-1], samples_per_unit)
        results[method] = {"units": units, "seconds": seconds, "exponent": exponent, "memory_gb": memory}
        print(f"{method}: time exponent {exponent:.2f}, {memory:.2f} GB at {units[-1]} units")
    return results


def measure_memory(method: str, units: int, samples_per_unit: int) -> float:
    """Return the largest resident memory [GB] of a fresh process that reconstructs once."""
    call = f"report_memory({method!r}, {units}, {units * samples_per_unit})"
    return float(_run_fresh(f"from benchmarks.reconstruction import report_memory; {call}"))


def report_memory(method: str, units: int, num_points: int) -> None:
    """Reconstruct, and print this process's largest resident memory [GB]."""
    reconstruct(make_arena(num_points).points, method, units=units)
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20)


def measure_cold_start(repeats: int = 5) -> dict[str, float]:
    """Measure a fresh process including imports, with compiled programs cached by the first."""
    results = {}
    for method in ("gsrm", "gg"):
        code = (
            "import time; begin = time.perf_counter(); import numpy as np; "
            "points = np.load({path!r}); from reconstruction._src.reconstruct import reconstruct; "
            "reconstruct(points, {method!r}, units=2200).mesh; print(time.perf_counter() - begin)"
        )
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "cloud.npy"
            np.save(path, make_arena().points)
            code = code.format(path=str(path), method=method)
            seconds = [float(_run_fresh(code)) for _ in range(repeats + 1)][1:]
        results[method] = float(np.median(seconds))
        print(f"{method}: fresh process {results[method]:.2f} s")
    return results


def _run_fresh(code: str) -> str:
    root = Path(__file__).resolve().parents[1]
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True)
    return done.stdout.strip().splitlines()[-1]


def _make_row(
    cloud: Cloud, seconds: list[float], qualities: list[Quality], c_seconds: list[float] | None = None
) -> dict[str, Any]:
    """Return one line of the table: medians, and the number of runs with correct topology."""
    size = float(np.linalg.norm(np.ptp(cloud.points, axis=0)))
    row: dict[str, Any] = {
        "seconds": float(np.median(seconds)),
        "faces": int(np.median([q.topology.num_faces for q in qualities])),
        "diagonal": size,
    }
    if c_seconds:
        row["time_against_c"] = float(np.median(np.array(seconds) / np.array(c_seconds)))
    for name in ("cloud_to_mesh", "truth_to_mesh", "mesh_to_truth"):
        found = [getattr(q, name) for q in qualities if getattr(q, name) is not None]
        if found:
            parts = ("mean", "p95", "max")
            row[name] = {part: float(np.median([getattr(d, part) for d in found])) for part in parts}
    for name in ("boundary_edges", "boundary_loops", "euler_number", "components", "pinched_vertices"):
        row[name] = [getattr(q.topology, name) for q in qualities]
    for name in ("self_intersections", "folds"):
        row[name] = [getattr(q, name) for q in qualities]
    row["manifold"] = sum(q.topology.is_manifold for q in qualities)
    wanted = (cloud.euler_number, cloud.loops)
    found = [(q.topology.euler_number, q.topology.boundary_loops) for q in qualities]
    row["right_topology"] = sum(wanted in ((None, None), pair) for pair in found)
    row["runs"] = len(qualities)
    return row


_HEADER = (
    f"{'':22}{'s':>7}{'/ C':>6}{'faces':>7}{'cloud>mesh':>14}{'truth>mesh':>14}{'mesh>truth':>14}"
    "  loops    manifold, right, intersecting pairs, folds"
)


def _print_row(name: str, row: dict[str, Any]) -> None:
    unit = 1e3 if row["diagonal"] > 1 else 1e6
    cells = [
        f"{row[k]['mean'] * unit:8.2f}/{row[k]['p95'] * unit:5.1f}" if k in row else " " * 14
        for k in ("cloud_to_mesh", "truth_to_mesh", "mesh_to_truth")
    ]
    against = f"{row['time_against_c']:6.2f}" if "time_against_c" in row else " " * 6
    loops = ",".join(map(str, sorted(set(row["boundary_loops"]))))
    sound = f"{row['manifold']} and {row['right_topology']} of {row['runs']}"
    print(
        f"{name:22}{row['seconds']:7.3f}{against}{row['faces']:7d}{''.join(cells)}  {loops:8} {sound}, "
        f"{max(row['self_intersections'])}, {max(row['folds'])}",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.reconstruction", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer runs, smaller sizes")
    parser.add_argument("--c-reference", metavar="PATH", help="the authors' binary gnn-gsrm, to compare with")
    parser.add_argument("--only", choices=("sizes", "clouds", "stairs", "scaling", "start"), help="one part")
    options = parser.parse_args()
    run(options.quick, options.c_reference, options.only)


if __name__ == "__main__":
    main()
