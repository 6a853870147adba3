"""Options of `symbrion reconstruct` for scans too large for memory."""

import dataclasses
from pathlib import Path
from typing import Any

import reconstruction as rc
from evolution._src.cli.command import UsageError, require_writable_folder
from evolution._src.cli.console import Console
from reconstruction._src.base.range_checks import format_count
from reconstruction._src.scans.frames import UNITS

_NOT_IN_TILES = ("crop", "thin", "units", "up", "scale", "intrinsics", "vertices")
"""Options that a tiled reconstruction does not have, where the command has them."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class TileOptions:
    """How a large scan is divided."""

    tile: float | None = None
    """Reconstruct in square tiles with this edge [m]: for .las .laz .npy larger than memory. --out is then a folder."""
    units_per_area: float | None = None
    """With --tile: units of the network in a square meter. Default: one for 20 points."""
    workers: int = 1
    """With --tile: number of processes."""
    address: str | None = None
    """With --tile: address of an existing Ray cluster, whose nodes see the folder --out at the same place."""

    def check_tiles(self, out: Path) -> None:
        """Refuse impossible tiles and options that go only without them."""
        require_writable_folder(out, "--out")
        if self.workers < 1:
            raise UsageError(f"--workers {self.workers} is too few; give 1 or more")
        for name in _NOT_IN_TILES:
            default = {field.name: field.default for field in dataclasses.fields(self)}.get(name)
            if getattr(self, name, default) != default:
                remedy = "use --units-per-area" if name == "units" else "leave it out"
                raise UsageError(f"--{name} does not go with --tile; {remedy}")
        try:
            self.make_config()
        except rc.ReconstructionError as error:
            raise UsageError(f"--tile: {error}") from error

    def make_config(self) -> rc.TilesConfig:
        """Return the division."""
        assert self.tile is not None
        return rc.TilesConfig(tile=self.tile, units_per_area=self.units_per_area)

    def run_tiles(
        self,
        console: Console,
        source: Path,
        out: Path,
        *,
        method: str,
        seed: int,
        unit: str | None,
        viewpoints: tuple[tuple[float, float, float], ...],
        is_raw: bool,
    ) -> dict[str, Any]:
        """Reconstruct a scan in tiles and return the summary."""
        run_jobs = None
        if self.address is not None:
            from evolution._src.backends.cluster import run_in_cluster

            run_jobs = run_in_cluster(self.workers, self.address)
        with console.track(f"Tiles of {source.name}") as step:
            tiles = rc.reconstruct_tiles(
                source,
                out,
                self.make_config(),
                method=method,
                seed=seed,
                meters=None if unit is None else UNITS[unit],
                viewpoints=viewpoints or None,
                is_raw=is_raw,
                workers=self.workers,
                run_jobs=run_jobs,
                progress=step.progress,
            )
        console.print_line(f"{format_count(len(tiles.places), 'tile')} of {tiles.tile:g} m in {out}")
        return {
            "tiles": out,
            "number": len(tiles.places),
            "offset": list(tiles.offset),
            "seconds": step.seconds,
        }
