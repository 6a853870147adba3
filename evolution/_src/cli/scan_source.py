"""The options of commands that read a scan, and the cloud that they describe."""

import dataclasses
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import numpy as np
import tyro
from jaxtyping import Float

import reconstruction as rc
from evolution._src.cli.command import SeededCommand, UsageError, require_file
from reconstruction._src.base.bounded_read import MAX_BYTES
from reconstruction._src.base.range_checks import format_extents

Box = tuple[float, float, float, float, float, float]
Position = tuple[float, float, float]

PICTURES = (".png", ".tif", ".tiff")  # Depth images; .npy is one where intrinsics are given


class Scan(NamedTuple):
    """What is known of a scan."""

    readings: rc.Cloud  # all points, in the box where one is given
    points: rc.Cloud  # those that pre-processing and thinning leave
    slip: rc.SlipReadings | None  # what a robot read that felt the ground, where the scan is a log with some


@dataclasses.dataclass(frozen=True, kw_only=True)
class FrameCommand(SeededCommand):
    """A subcommand that reads coordinates of any frame and unit."""

    unit: Literal["m", "cm", "mm", "ft", "us-ft", "in"] | None = None
    """Length unit of the file. Default: what the file says (.las, .e57, .glb, .gltf, .dae), otherwise meters."""
    up: Literal["x", "y", "z", "-x", "-y", "-z"] | None = None
    """Axis of the file that points up. Default: what the file says, otherwise z, unless the surface tells."""
    scale: float = 1.0
    """Factor on all lengths, for files whose unit has no name."""
    viewpoint: tuple[Position, ...] = ()
    """Where the scanner stood: X Y Z, or several positions one after the other [m], in the coordinates of the file
    with z up. Default: what the file says, or the origin where hardly a reading hides another from it. The surface
    faces it, and contact grows away from it."""

    def check(self) -> None:
        super().check()
        self.require_positive("scale")
        if not np.isfinite(np.array(self.viewpoint, float)).all():
            raise UsageError(f"--viewpoint {self.viewpoint} is not finite; give X Y Z [m]")


@dataclasses.dataclass(frozen=True, kw_only=True)
class ScanCommand(FrameCommand):
    """A subcommand that reads a scan."""

    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCAN")]
    """A scan log (.npz, .3d), points (.xyz .txt .csv .asc .dat .pts .npy .npz .ply .pcd .vtk .obj .las .laz .bin,
    also as .gz or .bz2; .e57), a depth image (.png .tif .npy, with --intrinsics), or with --vertices a mesh."""
    classes: tuple[int, ...] = ()
    """Classes of a .las or .laz file that are used, such as 2 (ground). Default: all but noise, water, high vegetation
    and wires."""
    crop: Literal["auto"] | Box | None = None
    """Use only the points in this box: XMIN XMAX YMIN YMAX ZMIN ZMAX [m], in the coordinates of the file with z up.
    auto: the box without the few points far from all others."""
    intrinsics: tuple[float, float, float, float] | None = None
    """Camera of a depth image: FX FY CX CY [pixels]."""
    depth_scale: float | None = None
    """Meters in a unit of a depth image. Default: 0.001, and 1 for floating point numbers."""
    color_image: Path | None = None
    """Picture that is aligned with a depth image."""
    vertices: bool = False
    """Use the vertices of a mesh as points. Without it a mesh is refused: it needs no reconstruction."""
    thin: float | None = None
    """Keep one point per cube of this edge length [m]. Default: 0.015 for scan logs, no thinning for points."""
    max_gigabytes: float = MAX_BYTES / 1e9
    """Largest size of SCAN after decompression, and of its points in memory (24 bytes each) [10^9 bytes]."""
    raw: bool = False
    """Use the points without pre-processing (leveling, smoothing, filters)."""

    def check(self) -> None:
        super().check()
        require_file(self.source, "SCAN")
        if self.color_image is not None:
            require_file(self.color_image, "--color-image")
        self.require_positive("max_gigabytes", "thin")
        if isinstance(self.crop, tuple):
            check_box(self.crop)
        kind, is_depth = self.source.suffix.lower(), self.intrinsics is not None
        if kind in PICTURES and not is_depth:
            raise UsageError(f"SCAN {self.source} is a picture; give the camera by --intrinsics FX FY CX CY")
        if is_depth and kind not in (*PICTURES, ".npy"):
            raise UsageError(
                f"--intrinsics belong to a depth image ({' '.join(PICTURES)} .npy), not {self.source}"
            )
        if not is_depth and (self.depth_scale is not None or self.color_image is not None):
            raise UsageError(
                "--depth-scale and --color-image belong to a depth image; give --intrinsics, too"
            )
        if is_depth and (self.unit or self.up or self.viewpoint):
            raise UsageError(
                "a depth image has no --unit, --up or --viewpoint: its camera says all; see --depth-scale"
            )

    def read_scan(self) -> Scan:
        """Return the points of SCAN, pre-processed, cropped and thinned as the options say."""
        log = self._read_log()
        readings = self._read_cloud() if log is None else rc.recenter(rc.make_log_cloud(rc.level_floor(log)))
        box = np.reshape(self.crop, (3, 2)).T if isinstance(self.crop, tuple) else None
        if self.crop == "auto":
            box = rc.find_crop_box(readings) + readings.offset
            if log is None:  # strays would decide how dense the filters take the cloud to be
                readings = crop_cloud(readings, box, self.source)
        points = readings if self.raw else rc.preprocess_cloud(readings if log is None else log)
        readings, points = (crop_cloud(each, box, self.source) for each in (readings, points))
        from symbrion_gym._src.sensing.survey import SPACING

        spacing = SPACING if self.thin is None and log is not None else self.thin
        slip = None if log is None else log.slip
        return Scan(readings, points if spacing is None else rc.thin(points, spacing), slip)

    @property
    def _max_bytes(self) -> float:
        return 1e9 * self.max_gigabytes

    def _read_log(self) -> rc.ScanLog | None:
        """Return the scan log that SCAN is, or None where it is something else."""
        if self.intrinsics is not None or not rc.is_scan_log(self.source):
            return None
        given = [name for name in ("up", "viewpoint") if getattr(self, name)] + ["scale"] * (self.scale != 1)
        if given:
            raise UsageError(
                f"SCAN {self.source} is a scan log, which says all about its frame; omit --{given[0]}"
            )
        return rc.load_scan_log(self.source, self._max_bytes)

    def _read_cloud(self) -> rc.Cloud:
        """Return all points of a file that is no log."""
        if self.intrinsics is not None:
            camera = rc.Intrinsics(*self.intrinsics)
            meters = None if self.depth_scale is None else self.depth_scale * self.scale
            return rc.load_depth_image(
                self.source, camera, meters, self.color_image, max_bytes=self._max_bytes
            )
        if not self.vertices and rc.is_mesh(self.source, self._max_bytes):
            raise UsageError(
                f"SCAN {self.source} is a mesh and needs no reconstruction: symbrion arena {self.source} --out "
                f"arenas/{self.source.stem} (--vertices reconstructs it from its vertices)"
            )
        frame = self.unit, self.up, self.scale
        limit, seen_from, classes = self._max_bytes, self.viewpoint or None, self.classes or None
        cloud = rc.load_cloud(self.source, *frame, limit, seen_from, any_size=True, classes=classes)
        odd = rc.describe_odd_size(cloud.points)
        if odd and not (self.unit or self.crop or self.scale != 1):
            raise UsageError(
                f"SCAN {self.source}: {odd}; if that is right, say so by --unit m, otherwise give its --unit or "
                "--scale; --crop auto drops stray points"
            )
        return cloud


def check_box(box: Box) -> None:
    """Refuse a box without inside."""
    if not np.all(np.diff(np.reshape(box, (3, 2))) > 0):
        raise UsageError(f"--crop {' '.join(map(str, box))} is empty; give XMIN XMAX YMIN YMAX ZMIN ZMAX")


def crop_cloud(cloud: rc.Cloud, box: Float[np.ndarray, "2 3"] | None, path: Path) -> rc.Cloud:
    """Return the points of a file in a box in its coordinates; a box without any is refused."""
    if box is None:
        return cloud
    inside = rc.crop(cloud, box - cloud.offset)
    if not inside.num_points:
        ends = (edge(axis=0) + cloud.offset for edge in (cloud.points.min, cloud.points.max))
        raise UsageError(f"--crop leaves none of the points of {path}; they are at {format_extents(*ends)}")
    return inside
