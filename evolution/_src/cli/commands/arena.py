"""`symbrion arena`: turn a surface into geometry for MuJoCo."""

import dataclasses
import math
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

import reconstruction as rc
import symbrion_gym as sg
from evolution._src.cli.command import UsageError, require_file, require_writable_folder
from evolution._src.cli.console import Console
from evolution._src.cli.scan_source import FrameCommand
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.range_checks import format_count, format_distance, format_extents, format_share

MISSED = 3  # Exit code where the arena is made, but is not good for a robot throughout, under `--strict`


@dataclasses.dataclass(frozen=True, kw_only=True)
class Arena(FrameCommand):
    """Decompose a surface into convex pieces for contact, keep the exact surface for rays, and write both as a folder.

    The table says how far contact is from the surface, in all directions and both ways, and, where the position of
    the scanner is known, how many of its beams still end where they did. The last line says whether the arena is good
    for a robot, and why not.

    Example: symbrion arena surface.npz --out arenas/pit
    """

    mesh: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="MESH")]
    """A reconstruction by `symbrion reconstruct` (.npz) or a mesh file (.ply .obj .stl .off .glb)."""
    out: Path = Path("arena")
    """Output folder: MJCF for MuJoCo's viewer, meshes, arena.json. An arena in it is replaced, other files are kept."""
    accuracy: float | None = None
    """Target of the mean distance between contact geometry and surface [m]. Default: follows data and robot."""
    reach: float | Literal["none"] | None = 1.2
    """Height above ground up to which that accuracy is wanted [m]; higher up it is 5 cm. none: everywhere."""
    for_size: float = 0.105
    """Size of the smallest wheel or body that will drive there [m]; contact is accurate to a tenth of it or better."""
    kind: Literal["auto", "convex", "hfield", "prisms", "mixed"] = "auto"
    """Contact geometry: convex pieces, a height field, one prism per triangle (slow), or boxes where planes fit.
    Mixed: boxes, spheres, cylinders and rectangles in place of triangles, for rays, too."""
    max_pieces: int = 2200
    """Largest number of convex pieces. More follow rough ground better and make a step slower."""
    object: tuple[str, ...] = ()
    """Meshes of known objects in meters, as FILE or NAME=FILE, found in --scan and placed; x points to their front."""
    scan: Path | None = None
    """Scan log, cloud or mesh file in which known objects are found, in the frame of MESH."""
    strict: bool = False
    """End with exit code 3 unless the arena is good for a robot: "yes"."""

    def check(self) -> None:
        super().check()
        from symbrion_gym._src.arenas.saving import find_own_files
        from symbrion_gym._src.arenas.surface_file import check_has_surface

        require_file(self.mesh, "MESH")
        check_has_surface(self.mesh)
        if self.mesh.suffix.lower() == ".npz" and (self.unit or self.up or self.scale != 1.0):
            raise UsageError(
                f"MESH {self.mesh} is a reconstruction, in meters with z up; give --unit, --up and --scale to "
                "symbrion reconstruct"
            )
        require_writable_folder(self.out, "--out")
        find_own_files(self.out)
        self.require_positive("accuracy", "for_size", *(("reach",) if self.reach != "none" else ()))
        self.require_least(max_pieces=1)
        if bool(self.object) != (self.scan is not None):
            raise UsageError("--object and --scan belong together: give both or none")
        for name, path in self._list_object_files().items():
            require_file(path, f"--object {name}:")
        if self.scan is not None:
            require_file(self.scan, "--scan")

    def run(self, console: Console) -> dict[str, Any]:
        if self.object:
            require_extras("`symbrion arena --object`", "objects")
        with console.track(f"Arena from {self.mesh.name}") as step:
            arena = self._make(step.progress)
            arena.save(self.out)
        bounds = arena.surface.bounds.tolist()
        contact = format_count(len(arena.pieces), "piece") if arena.height_field is None else "a height field"
        console.print_line(f"{contact} in {self.out}; to view it: symbrion view {self.out}")
        console.print_line(f"it extends over {format_extents(*bounds)}")
        for each in arena.objects:
            console.print_line(f"{each.name} at {', '.join(f'{x:.3f}' for x in each.position)} m")
        rows, accuracy = _make_quality_rows(arena), _describe_accuracy(arena)
        console.show_table("Quality of the contact geometry", ["measure", "value"], rows)
        console.print_line(str(arena.verdict))
        is_missed = self.accuracy is not None and bool(accuracy) and not accuracy["is_reached"]
        is_good = arena.verdict.answer == "yes" and not is_missed
        return {
            "folder": self.out,
            "pieces": len(arena.pieces),
            "bounds": bounds,
            "seconds": step.seconds,
            "quality": arena.quality.as_dict(),
            "accuracy": accuracy,
            "verdict": dataclasses.asdict(arena.verdict),
            "exit_code": MISSED if self.strict and not is_good else 0,
        }

    def _make(self, progress: "rc.Progress") -> "sg.Arena":
        """Return the arena with the objects that are found in the scan."""
        arena = sg.make_arena(
            self.mesh,
            accuracy=self.accuracy,
            reach=None if self.reach == "none" else self.reach,
            for_size=self.for_size,
            kind=self.kind,
            viewpoints=self.viewpoint or None,
            unit=self.unit,
            up=self.up,
            scale=self.scale,
            seed=self.seed,
            max_pieces=self.max_pieces,
            progress=progress,
        )
        if self.scan is None:
            return arena
        meshes = {name: rc.load_mesh(path) for name, path in self._list_object_files().items()}
        if rc.is_mesh(self.scan):
            scan = rc.load_mesh(self.scan)
        else:
            scan = rc.load_scan_log(self.scan) if rc.is_scan_log(self.scan) else rc.load_cloud(self.scan)
        found = rc.find_objects(scan, meshes, seed=self.seed, progress=progress)
        return sg.place_objects(arena, found, meshes)

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


def _describe_accuracy(arena: "sg.Arena") -> dict[str, Any]:
    """Return the accuracy of an arena, wanted and reached, as its making has noted it; None for what is not finite."""
    notes, reached = arena.provenance, arena.quality.mean
    return {
        "wanted": notes["accuracy"],
        "reached": reached if math.isfinite(reached) else None,
        "is_reached": notes["is_reached"],
        "worst": notes["worst"]["place"],
        "distance": notes["worst"]["distance"],
        "warnings": notes["warnings"],
    }


def _make_quality_rows(arena: "sg.Arena") -> list[list[object]]:
    """Return measure and value of what is known about the contact geometry."""
    from symbrion_gym._src.contact.kinds import ACCEPTANCE_P95, UNCOVERED

    notes, quality = arena.provenance, arena.quality
    most = notes.get("options", {}).get("max_pieces")
    pieces = f"{quality.num_pieces}{f' of at most {most}' if most else ''}"
    wanted = notes["accuracy"]
    limits = {"mean": wanted, "p95": ACCEPTANCE_P95 * wanted, "uncovered": UNCOVERED}
    missed = {name: " (missed)" if getattr(quality, name) > limit else "" for name, limit in limits.items()}
    distances = {
        "accuracy wanted": wanted,
        f"accuracy reached{missed['mean']}": quality.mean,
        f"surface to contact: 95 %{missed['p95']}": quality.p95,
        "surface to contact: largest": quality.max,
        "readings of level ground to surface: median": quality.readings,
        "contact to surface: mean": quality.protrusion_mean,
        "contact to surface: 95 %": quality.protrusion_p95,
        "contact to surface: largest": quality.protrusion_max,
    }
    shares = {
        f"surface without contact{missed['uncovered']}": quality.uncovered,
        "beams that end at their reading: contact": quality.beams_contact,
        "beams that end at their reading: surface": quality.beams_surface,
        "free space seen that is solid": quality.free_space,
        "readings dropped by pre-processing": quality.dropped,
    }
    return [
        *([name, format_distance(value)] for name, value in distances.items() if value is not None),
        *([name, format_share(value)] for name, value in shares.items() if value is not None),
        ["pieces", pieces if arena.height_field is None else "none: a height field"],
        ["time to build", f"{quality.seconds:.1f} s"],
    ]
