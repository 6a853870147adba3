"""`symbrion objects`: find known objects in a scan, and add them to an arena."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

import reconstruction as rc
import symbrion_gym as sg
from evolution._src.cli.command import UsageError, require_file, require_writable_folder
from evolution._src.cli.console import Console
from evolution._src.cli.scan_source import ScanCommand
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.quantities import format_count


@dataclasses.dataclass(frozen=True, kw_only=True)
class Objects(ScanCommand):
    """Find known objects (sockets, docking stations, boxes) in a scan, by their meshes; also in the faces of a mesh.

    Example: symbrion objects room.e57 --object socket.stl --add-to arenas/room
    """

    object: tuple[str, ...] = ()
    """Meshes of the objects in meters, as FILE or NAME=FILE; the name is that of the file without its ending. Their x
    axis points to the front."""
    add_to: Path | None = None
    """Folder of an arena of the same scan: objects of these names in it are replaced by those found."""
    noise: float | None = None
    """Standard deviation of the ranges [m]. Default: measured on the walls and the floor."""
    min_score: float = rc.ObjectsConfig.min_score
    """Share of the beams that must agree with an object. Lower: more false finds."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.object:
            raise UsageError("no object to find; give --object socket.stl")
        for name, path in self._list_files().items():
            require_file(path, f"--object {name}:")
        if self.add_to is not None:
            if not (self.add_to / "arena.json").is_file():
                raise UsageError(f"--add-to {self.add_to} is no arena; make one by symbrion arena")
            require_writable_folder(self.add_to, "--add-to")
        try:
            self._make_config()
        except rc.ReconstructionError as error:
            raise UsageError(str(error)) from error

    def run(self, console: Console) -> dict[str, Any]:
        """Find the objects.

        Raises:
            ScanError: a file cannot be read.
        """
        require_extras("`symbrion objects`", "objects")
        meshes = {name: rc.load_mesh(path) for name, path in self._list_files().items()}
        arena = None if self.add_to is None else sg.Arena.load(self.add_to)
        with console.track("Known objects") as step:
            found = rc.find_objects(
                self._read(), meshes, self._make_config(), seed=self.seed, progress=step.progress
            )
        columns = ["object", "x", "y", "z [m]", "score", "coverage", "beams"]
        rows: list[list[object]] = [
            [
                each.name,
                *(f"{x:.3f}" for x in each.position),
                f"{each.score:.2f}",
                f"{each.coverage:.2f}",
                each.num_beams,
            ]
            for each in found
        ]
        console.show_table(f"{format_count(len(found), 'object')} in {self.source}", columns, rows)
        if arena is not None and self.add_to is not None:
            sg.place_objects(arena, found, meshes).save(self.add_to)
            console.print_line(f"{self.add_to}: {format_count(len(found), 'object')} added")
        listed = [
            {
                **each._asdict(),
                "position": np.asarray(each.position).tolist(),
                "rotation": np.asarray(each.rotation).tolist(),
            }
            for each in found
        ]
        return {"source": self.source, "objects": listed, "added_to": self.add_to}

    def _make_config(self) -> rc.ObjectsConfig:
        return rc.ObjectsConfig(noise=self.noise, min_score=self.min_score)

    def _list_files(self) -> dict[str, Path]:
        """Return name -> file of the objects.

        Raises:
            UsageError: two have one name.
        """
        files: dict[str, Path] = {}
        for each in self.object:
            name, _, path = each.rpartition("=")
            name = name or Path(path).stem
            if name in files:
                raise UsageError(f"--object: two objects are called {name!r}; give NAME=FILE")
            files[name] = Path(path)
        return files

    def _read(self) -> Any:
        """Return the scan without pre-processing, which would move beams, or the mesh that SCAN is."""
        if self.intrinsics is None and not self.vertices and rc.is_mesh(self.source, self._max_bytes):
            return rc.load_mesh(self.source, self.unit, self.up, self.scale, self._max_bytes)
        return dataclasses.replace(self, raw=True, thin=self.thin).read_scan().readings
