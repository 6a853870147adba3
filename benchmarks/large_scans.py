"""A scan too large for memory: a made landscape of 1/f noise, reconstructed in tiles.

Run as `python -m benchmarks.large_scans [--quick]`. The whole square kilometer of 100 million points is streamed from a
file with 2 workers; a square of 500 m is done with 1, 2 and 4 workers. A row has the time, the peak of the memory of
all processes together, the distance of the surface from the true heights, and the steps at the seams of the tiles:
heights on both sides of a border, a micrometer apart.
"""

import argparse
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.material.landscape import Landscape, make_landscape, write_scan
from benchmarks.report import write_results
from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.tiles.folder import TiledSurface
from reconstruction._src.tiles.point_stream import TilesConfig
from reconstruction._src.tiles.tiling import reconstruct_tiles

DENSITY = 100
"""Points in a square meter: of a good aerial scan."""
NOISE = 0.02
"""Standard deviation of the heights of the points [m]."""
RELIEF = 10.0
"""Standard deviation of the heights of the landscape [m]."""
CONFIG = TilesConfig(tile=50.0, halo=5.0, units_per_area=0.5)
WORKERS = (1, 2, 4)
_SIDE_STEP = 1e-6
"""Distance from a border at which its sides are compared [m]."""


def run(quick: bool = False) -> dict[str, Any]:
    """Measure, write and return everything.

    Args:
        quick: a hundredth of the area.
    """
    results: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        results["whole"] = measure(100.0 if quick else 1000.0, 2, Path(folder))
        results["workers"] = {
            f"{workers}": measure(100.0 if quick else 500.0, workers, Path(folder)) for workers in WORKERS
        }
    write_results("large_scans", results)
    return results


def measure(extent: float, workers: int, folder: Path) -> dict[str, Any]:
    """Reconstruct a square of the landscape and return the figures of a row.

    Args:
        extent: edge of the square [m].
        workers: processes.
        folder: for the scan, which is made once for each extent, and the tiles.
    """
    landscape = make_landscape(extent, 0.5, RELIEF * extent / 1000)
    count = round(DENSITY * extent**2)
    source = folder / f"scan_{extent:g}.npy"
    if not source.exists():
        write_scan(source, landscape, count, NOISE)
    with tempfile.TemporaryDirectory(dir=folder) as tiles:
        with PeakMemory() as memory:
            begin, spent = time.perf_counter(), _find_processor_time()
            # There are no isolated points that a filter would find.
            surface = reconstruct_tiles(source, Path(tiles) / "tiles", CONFIG, workers=workers, is_raw=True)
            seconds, spent = time.perf_counter() - begin, _find_processor_time() - spent
        row = {
            "points": count,
            "workers": workers,
            "tiles": len(surface.places),
            "seconds": seconds,
            "cpu_seconds": spent,
            "gigabytes": memory.peak / 1e9,
            **measure_surface(surface, landscape),
        }
    print({name: round(value, 5) for name, value in row.items()}, flush=True)
    return row


def measure_surface(surface: TiledSurface, landscape: Landscape) -> dict[str, float]:
    """Return distances from the true heights and steps at the seams [m], 20 tiles by chance and their neighbors."""
    rng = np.random.default_rng(0)
    steps, errors, rims = [], [], []
    for index in rng.permutation(len(surface.places))[:20]:
        column, row = surface.places[index]
        corner = np.array([column, row]) * surface.tile
        around = Elevation(surface.mesh(corner + surface.tile / 2, 0.75 * surface.tile))
        x, y = corner[:, None] + rng.uniform(0.01, surface.tile - 0.01, (2, 5000))
        gap = np.abs(around.height(x, y) - landscape.height(x, y))
        depth = np.minimum(
            *(np.minimum(v - c, c + surface.tile - v) for v, c in zip((x, y), corner, strict=True))
        )
        errors.append(gap)
        rims.append(gap[depth < 0.5])
        along = rng.uniform(0.01, surface.tile - 0.01, 2000)
        for axis in (0, 1):
            place = np.repeat(corner[:, None], len(along), axis=1)
            place[1 - axis] += along
            sides = []
            for side in (-_SIDE_STEP, _SIDE_STEP):
                shifted = place.copy()
                shifted[axis] += side
                sides.append(around.height(*shifted))
            steps.append(np.abs(sides[0] - sides[1]))
    found = {"error": errors, "error_at_seams": rims, "step": steps}
    figures = {}
    for name, parts in found.items():
        values = np.concatenate(parts)
        values = values[np.isfinite(values)]
        figures |= {f"{name}_mean": float(values.mean()), f"{name}_p99": float(np.percentile(values, 99))}
        figures[f"{name}_max"] = float(values.max())
    return figures


class PeakMemory:
    """The most memory that this process and its children hold at once [bytes], looked at five times a second."""

    def __init__(self) -> None:
        self.peak = 0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> "PeakMemory":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._ended.wait(0.2):
            self.peak = max(self.peak, sum(_find_resident(process) for process in _find_family()))


def _find_family() -> list[Path]:
    """Return the folders of this process and its children in /proc."""
    own = Path("/proc/self").resolve()
    children = [path.read_text().split() for path in own.glob("task/*/children")]
    return [own, *(own.parent / number for numbers in children for number in numbers)]


def _find_resident(process: Path) -> int:
    """Return the memory of a process that no file backs [bytes]."""
    try:
        fields = dict(line.split(":", 1) for line in (process / "status").read_text().splitlines())
        return 1024 * int(fields["RssAnon"].split()[0])
    except (OSError, KeyError):  # it has just ended
        return 0


def _find_processor_time() -> float:
    """Return the processor time of this process and its ended children [s]."""
    import resource

    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.large_scans", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a hundredth of the area")
    run(parser.parse_args().quick)


if __name__ == "__main__":
    main()
