"""`symbrion arena`: turn a surface into geometry for MuJoCo."""

import dataclasses
import math
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import tyro

import reconstruction as rc
import symbrion_gym as sg
from evolution._src.cli.command import (
    MISSED,
    SeededCommand,
    UsageError,
    require_file,
    require_writable_file,
    require_writable_folder,
)
from evolution._src.cli.console import Console
from evolution._src.cli.quality_rows import describe_accuracy, make_quality_rows
from evolution._src.cli.scan_source import is_scan_log
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.range_checks import format_count, format_extents


@dataclasses.dataclass(frozen=True, kw_only=True)
class Arena(SeededCommand):
    """Decompose a surface into convex pieces for contact, keep the exact surface for rays, and write both as a folder.

    The table says how far contact is from the surface, in all directions and both ways, and, where the position of
    the scanner is known, how many of its beams still end where they did. A missed accuracy is a warning.

    Example: symbrion arena surface.npz --out arenas/pit --picture pit.png
    """

    mesh: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="MESH")]
    """A reconstruction by `symbrion reconstruct` (.npz) or a mesh file (.ply .obj .stl .off .glb)."""
    out: Path = Path("arena")
    """Output folder: MJCF for MuJoCo's viewer, meshes, arena.json. An arena in it is replaced, other files are kept."""
    accuracy: float | None = None
    """Target of the mean distance between contact geometry and surface [m]. Default: follows the data."""
    kind: Literal["auto", "convex", "hfield", "prisms", "mixed"] = "auto"
    """Contact geometry: convex pieces, a height field, one prism per triangle (slow), or boxes where planes fit.
    Mixed: boxes, spheres, cylinders and rectangles in place of triangles, for rays, too."""
    max_pieces: int | None = None
    """Largest number of convex pieces. More follow rough ground better and make a step slower."""
    viewpoint: tuple[tuple[float, float, float], ...] = ()
    """Position X Y Z of the scanner [m], in the frame of the file with z up; several: X Y Z X Y Z. Contact grows away
    from it."""
    unit: Literal["m", "cm", "mm", "ft", "us-ft", "in"] | None = None
    """Length unit of a mesh file. Default: what the file says (.glb, .gltf, .dae), otherwise meters."""
    up: Literal["x", "y", "z", "-x", "-y", "-z"] | None = None
    """Axis of a mesh file that points up. Default: what the file says, otherwise z."""
    scale: float = 1.0
    """Factor on all lengths of a mesh file."""
    object: tuple[str, ...] = ()
    """Meshes of known objects in meters, as FILE or NAME=FILE, found in --scan and placed; x points to their front."""
    scan: Path | None = None
    """Scan log, cloud or mesh file in which known objects are found, in the frame of MESH."""
    picture: Path | None = None
    """Draw where contact and surface differ in this file (.png)."""
    strict: bool = False
    """End with exit code 3 where the accuracy is missed."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_file(self.mesh, "MESH")
        self._check_mesh()
        require_writable_folder(self.out, "--out")
        self._check_objects()
        try:
            from symbrion_gym._src.arenas.saving import find_own_files

            find_own_files(self.out)
        except sg.ArenaError as error:
            raise UsageError(f"--out {error}") from error
        if self.accuracy is not None and not self.accuracy > 0:
            raise UsageError(
                f"--accuracy {self.accuracy} is not a distance; give meters above 0, for example 0.003"
            )
        self.require_least(max_pieces=1)
        if not np.isfinite(np.ravel(self.viewpoint)).all():
            raise UsageError(f"--viewpoint {self.viewpoint} is not finite; give positions in meters")
        if self.picture is not None:
            require_writable_file(self.picture, "--picture", (".png",))

    def _check_mesh(self) -> None:
        """Refuse points, which have no surface, and a frame for a reconstruction, which knows its own."""
        if not 0 < self.scale < math.inf:
            raise UsageError(f"--scale {self.scale} is not a factor; give a number above 0")
        from symbrion_gym._src.arenas.surface_file import check_has_surface

        try:
            check_has_surface(self.mesh)
        except sg.ArenaError as error:
            raise UsageError(f"MESH {error}") from error
        if self.mesh.suffix.lower() == ".npz" and (self.unit or self.up or self.scale != 1.0):
            raise UsageError(
                f"MESH {self.mesh} is a reconstruction, in meters with z up; give --unit, --up and --scale to "
                "symbrion reconstruct"
            )

    def _check_objects(self) -> None:
        """Refuse objects without a scan, and files that are not there."""
        if bool(self.object) != (self.scan is not None):
            raise UsageError("--object and --scan belong together: give both or none")
        for name, path in self._list_object_files().items():
            require_file(path, f"--object {name}:")
        if self.scan is not None:
            require_file(self.scan, "--scan")

    def run(self, console: Console) -> dict[str, Any]:
        """Make the arena, write it, print its quality.

        Raises:
            MissingExtraError: a picture is wanted and the extra is not installed.
        """
        if self.picture is not None:
            require_extras("`symbrion arena --picture`", "report")
        if self.object:
            require_extras("`symbrion arena --object`", "objects")
        with console.track(f"Arena from {self.mesh.name}") as step:
            arena = self._place_objects(self._make(step.progress), step.progress)
            arena.save(self.out)
        if self.picture is not None:
            with console.track(f"Picture {self.picture.name}"):
                self._draw(arena)
        contact = format_count(len(arena.pieces), "piece") if arena.height_field is None else "a height field"
        console.print_line(f"{contact} in {self.out}; to view it: symbrion view {self.out}")
        console.print_line(f"it extends over {format_extents(*arena.surface.bounds.tolist())}")
        for each in arena.objects:
            console.print_line(f"{each.name} at {', '.join(f'{x:.3f}' for x in each.position)} m")
        rows, accuracy = make_quality_rows(arena), describe_accuracy(arena)
        console.show_table("Quality of the contact geometry", ["measure", "value"], rows)
        summary = {
            "folder": self.out,
            "pieces": len(arena.pieces),
            "bounds": arena.surface.bounds.tolist(),
            "seconds": step.seconds,
            "quality": arena.quality.as_dict(),
            "accuracy": accuracy,
            "picture": self.picture,
        }
        return summary | ({"exit_code": MISSED} if self.strict and not accuracy["is_reached"] else {})

    def _make(self, progress: "rc.Progress") -> "sg.Arena":
        options: dict[str, Any] = {} if self.max_pieces is None else {"max_pieces": self.max_pieces}
        return sg.make_arena(
            self.mesh,
            accuracy=self.accuracy,
            kind=self.kind,
            viewpoints=np.array(self.viewpoint) if self.viewpoint else None,
            unit=self.unit,
            up=self.up,
            scale=self.scale,
            seed=self.seed,
            progress=progress,
            **options,
        )

    def _place_objects(self, arena: "sg.Arena", progress: "rc.Progress") -> "sg.Arena":
        """Return the arena with the objects found in the scan."""
        if self.scan is None:
            return arena
        meshes = {name: rc.load_mesh(path) for name, path in self._list_object_files().items()}
        if rc.is_mesh(self.scan):
            scan = rc.load_mesh(self.scan)
        else:
            scan = rc.load_scan_log(self.scan) if is_scan_log(self.scan) else rc.load_cloud(self.scan)
        return sg.place_objects(
            arena, rc.find_objects(scan, meshes, seed=self.seed, progress=progress), meshes
        )

    def _list_object_files(self) -> dict[str, Path]:
        """Return name -> file of the objects."""
        files: dict[str, Path] = {}
        for each in self.object:
            name, _, path = each.rpartition("=")
            name = name or Path(path).stem
            if name in files:
                raise UsageError(f"--object: two objects are called {name!r}; give NAME=FILE")
            files[name] = Path(path)
        return files

    def _draw(self, arena: "sg.Arena") -> None:
        assert self.picture is not None
        from evolution._src.report.error_map import draw_error_map
        from evolution._src.report.figures import to_png

        self.picture.parent.mkdir(parents=True, exist_ok=True)
        with write_atomically(self.picture) as beside:
            beside.write_bytes(to_png(draw_error_map(arena), is_reduced=False))
