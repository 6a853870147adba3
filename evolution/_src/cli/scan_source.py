"""The options of commands that read a scan, and the cloud that they describe."""

import dataclasses
import math
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro
from jaxtyping import Float

import reconstruction as rc
from evolution._src.cli.command import SeededCommand, UsageError, require_file
from reconstruction._src.base.bounded_read import MAX_BYTES, UnreadableFileError, find_npz_names

Box = tuple[float, float, float, float, float, float]
Position = tuple[float, float, float]

PICTURES = (".png", ".tif", ".tiff")  # Depth images; .npy is one where intrinsics are given


@dataclasses.dataclass(frozen=True)
class Scan:
    """What is known of a scan.

    Attributes:
        readings: all points, in the box where one is given.
        points: those that pre-processing and thinning leave.
        slip: what a robot read that felt the ground, where the scan is a log with some.
    """

    readings: rc.Cloud
    points: rc.Cloud
    slip: rc.SlipReadings | None = None


@dataclasses.dataclass(frozen=True, kw_only=True)
class ScanCommand(SeededCommand):
    """A subcommand that reads a scan."""

    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCAN")]
    """A scan log (.npz, .3d), points (.xyz .txt .csv .asc .dat .pts .npy .npz .ply .pcd .vtk .obj .las .laz, also as
    .gz or .bz2; .e57), a depth image (.png .tif .npy, with --intrinsics), or with --vertices a mesh."""
    unit: Literal["m", "cm", "mm", "ft", "us-ft", "in"] | None = None
    """Length unit of the file. Default: what the file says (.las, .e57), otherwise meters."""
    up: Literal["x", "y", "z", "-x", "-y", "-z"] | None = None
    """Axis of the file that points up. Default: what the file says, otherwise z."""
    scale: float = 1.0
    """Factor on all lengths, for files whose unit has no name."""
    crop: Literal["auto"] | Box | None = None
    """Use only the points in this box: XMIN XMAX YMIN YMAX ZMIN ZMAX [m], in the coordinates of the file with z up.
    auto: the box without the few points far from all others."""
    viewpoint: tuple[Position, ...] = ()
    """Where the scanner stood: X Y Z, or several positions one after the other [m], in the coordinates of the file
    with z up. Default: what the file says. The surface is oriented by it."""
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

    def __post_init__(self) -> None:
        super().__post_init__()
        require_file(self.source, "SCAN")
        if self.color_image is not None:
            require_file(self.color_image, "--color-image")
        if not self.max_gigabytes > 0:
            raise UsageError(f"--max-gigabytes {self.max_gigabytes} is not a limit; give a number above 0")
        if self.thin is not None and not self.thin > 0:
            raise UsageError(f"--thin {self.thin} is not an edge length; give meters above 0")
        if not 0 < self.scale < math.inf:
            raise UsageError(f"--scale {self.scale} is not a factor; give a number above 0")
        if isinstance(self.crop, tuple) and not all(
            low < high for low, high in zip(self.crop[::2], self.crop[1::2], strict=True)
        ):
            raise UsageError(
                f"--crop {' '.join(map(str, self.crop))} is empty; give XMIN XMAX YMIN YMAX ZMIN ZMAX, or auto"
            )
        if not np.isfinite(np.array(self.viewpoint, float)).all():
            raise UsageError(f"--viewpoint {self.viewpoint} is no position; give X Y Z [m]")
        self._check_camera()

    def _check_camera(self) -> None:
        """Refuse options of a depth image for other files, and a depth image without them."""
        is_picture = self.source.suffix.lower() in PICTURES
        if self.intrinsics is None:
            if is_picture:
                raise UsageError(
                    f"SCAN {self.source} is a picture; give the camera by --intrinsics FX FY CX CY"
                )
            if self.depth_scale is not None or self.color_image is not None:
                raise UsageError(
                    "--depth-scale and --color-image belong to a depth image; give --intrinsics, too"
                )
            return
        if not is_picture and self.source.suffix.lower() != ".npy":
            raise UsageError(
                f"--intrinsics belong to a depth image ({' '.join(PICTURES)} .npy), not {self.source}"
            )
        if self.unit or self.up or self.viewpoint:
            raise UsageError(
                "a depth image has no --unit, --up or --viewpoint: its camera says all; see --depth-scale"
            )

    def read_scan(self) -> Scan:
        """Return the points of SCAN, pre-processed, cropped and thinned as the options say."""
        log = self._read_log()
        readings = rc.recenter(rc.make_log_cloud(log)) if log is not None else self._read_cloud()
        box = self._find_box(readings)
        if (
            log is None and self.crop == "auto"
        ):  # strays would decide how dense the filters take the cloud to be
            readings = _crop(readings, box)
        points = readings
        if not self.raw:
            points = rc.preprocess_cloud(readings if log is None else log)
        readings, points = _crop(readings, box), _crop(points, box)
        if not points.num_points:
            raise UsageError(f"--crop leaves none of the points of {self.source}; {self._describe_extent()}")
        from symbrion_gym._src.ready_made import SPACING

        spacing = SPACING if self.thin is None and log is not None else self.thin
        slip = None if log is None else log.slip
        return Scan(readings, points if spacing is None else rc.thin(points, spacing), slip)

    @property
    def _max_bytes(self) -> float:
        return 1e9 * self.max_gigabytes

    def _read_log(self) -> rc.ScanLog | None:
        """Return the scan log that SCAN is, or None where it is something else."""
        if self.intrinsics is not None or not is_scan_log(self.source):
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
            scale = self.depth_scale if self.depth_scale is None else self.depth_scale * self.scale
            return rc.load_depth_image(
                self.source,
                rc.Intrinsics(*self.intrinsics),
                scale,
                self.color_image,
                max_bytes=self._max_bytes,
            )
        if not self.vertices and rc.is_mesh(self.source, self._max_bytes):
            raise UsageError(
                f"SCAN {self.source} is a mesh and needs no reconstruction: symbrion arena {self.source} --out "
                f"arenas/{self.source.stem} (--vertices reconstructs it from its vertices)"
            )
        cloud = rc.load_cloud(
            self.source,
            self.unit,
            self.up,
            self.scale,
            self._max_bytes,
            self.viewpoint or None,
            any_size=True,
        )
        odd = rc.describe_odd_size(cloud.points)
        if odd and not (self.unit or self.crop or self.scale != 1):
            raise UsageError(
                f"SCAN {self.source}: {odd}; if that is right, say so by --unit m, otherwise give its --unit or "
                "--scale; --crop auto drops stray points"
            )
        return cloud

    def _find_box(self, readings: rc.Cloud) -> Float[np.ndarray, "2 3"] | None:
        """Return the corners of the box in the coordinates of the file, or None."""
        if self.crop == "auto":
            return rc.find_crop_box(readings) + readings.offset
        return None if self.crop is None else np.reshape(self.crop, (3, 2)).T.astype(float)

    def _describe_extent(self) -> str:
        """Return a sentence about where the points of SCAN are."""
        log = self._read_log()
        cloud = rc.make_log_cloud(log) if log is not None else self._read_cloud()
        low, high = (corner + cloud.offset for corner in (cloud.points.min(axis=0), cloud.points.max(axis=0)))
        spans = (f"{name} {a:g} to {b:g}" for name, a, b in zip("xyz", low, high, strict=True))
        return f"they are at {', '.join(spans)} m"


def is_scan_log(path: Path) -> bool:
    """Return whether a file contains scans with poses, rather than points."""
    if path.suffix == ".3d":
        return path.with_suffix(".pose").is_file()
    try:
        return path.suffix == ".npz" and "ranges" in find_npz_names(path)
    except UnreadableFileError:
        return False


def _crop(cloud: rc.Cloud, box: Float[np.ndarray, "2 3"] | None) -> rc.Cloud:
    """Return the points in a box in the coordinates of the file."""
    return cloud if box is None else rc.crop(cloud, box - cloud.offset)
