"""Depth images (RGB-D cameras, rendered depth) as clouds: every pixel a reading from one viewpoint, the camera."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Shaped
from numpy.typing import ArrayLike

from reconstruction._src.base.bounded_read import MAX_BYTES, check_size, open_bounded, read_array
from reconstruction._src.base.errors import ScanError
from reconstruction._src.base.extras import MissingExtraError, require_extras
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.cloud_file import recenter
from reconstruction._src.scans.frames import CAMERA_AXES
from reconstruction._src.scans.point_rows import POINT_BYTES
from reconstruction._src.scans.sensor_frame import find_upright

_DEPTH_ENDINGS = (".png", ".tif", ".tiff", ".npy")  # Files that may hold a depth image
_PICTURES = ("PNG", "TIFF", "JPEG")
"""Of the kinds that Pillow reads, whatever the ending says: it hands EPS to another program."""
_MILLIMETER = 0.001
_MIN_PIXELS = 3
_RIGID_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Intrinsics:
    """A pinhole camera without distortion: pixel u, v sees along ((u - cx) / fx, (v - cy) / fy, 1).

    Attributes:
        fx, fy: focal lengths [pixels].
        cx, cy: where the optical axis meets the image [pixels], the middle of the first pixel being 0, 0.
    """

    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (self.fx, self.fy, self.cx, self.cy))):
            raise ScanError(f"intrinsics must be finite, got {self}")
        if not (self.fx > 0 and self.fy > 0):
            raise ScanError(f"focal lengths must be above 0, got fx {self.fx} and fy {self.fy}")


def load_depth_image(
    path: str | os.PathLike[str],
    intrinsics: Intrinsics,
    depth_scale: float | None = None,
    color: str | os.PathLike[str] | None = None,
    pose: ArrayLike | None = None,
    max_depth: float = math.inf,
    max_bytes: float = MAX_BYTES,
) -> Cloud:
    """Read a depth image as a cloud seen from its camera.

    Depth is measured along the optical axis, as depth cameras store it, not along the ray. Pixels of depth 0 or of
    no finite depth did not return.

    Args:
        path: .png or .tif of one channel with 16 bits or more, or .npy.
        intrinsics: of the depth camera.
        depth_scale: meters in a unit of the image; None: 0.001 for whole numbers, 1 for floating point numbers.
        color: a picture aligned with the depth image, of the same size.
        pose: `[4, 4]` camera -> world, the camera's axes being right, down and ahead; the world has z up. None: a
            camera at the origin that looks along x, y being left, turned until the floor that it sees is level.
        max_depth: greater depths are left out [m]; noise of depth cameras grows with the square of depth.
        max_bytes: most bytes of the file, and of the points (24 bytes a pixel).

    Raises:
        ScanError: a file is absent, broken, too large, of another kind, or shows nothing; sizes that differ; or a
            pose that is none.
        MissingExtraError: Pillow is not installed.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind not in _DEPTH_ENDINGS:
        raise ScanError(f"{path}: {kind or 'no ending'} is no depth image; use {', '.join(_DEPTH_ENDINGS)}")
    depth = _read_image(path, max_bytes)
    if depth.ndim != 2 or depth.dtype.kind not in "fiu" or depth.dtype.itemsize < 2:
        raise ScanError(f"{path}: {depth.dtype} of shape {depth.shape}, not one channel of 16 bits or more")
    factor = depth_scale if depth_scale is not None else 1.0 if depth.dtype.kind == "f" else _MILLIMETER
    if not 0 < factor < math.inf:
        raise ScanError(f"{path}: depth_scale must be above 0, got {depth_scale}")
    colors = None if color is None else _read_image(Path(color), max_bytes, "RGB")
    if colors is not None and colors.shape[:2] != depth.shape:
        raise ScanError(
            f"{color}: has {colors.shape[1]} x {colors.shape[0]} pixels, the depth image {depth.shape[1]} x "
            f"{depth.shape[0]}; align them first"
        )
    to_world, position = (None, np.zeros(3)) if pose is None else _find_pose(path, pose)
    meters = depth.astype(np.float64) * factor
    is_seen = np.isfinite(meters) & (meters > 0) & (meters <= max_depth)
    if is_seen.sum() < _MIN_PIXELS:
        raise ScanError(f"{path}: {is_seen.sum()} of {depth.size} pixels have a depth; is the scale right?")
    v, u = np.nonzero(is_seen)
    ahead = meters[is_seen]
    rays = np.stack(
        [(u - intrinsics.cx) / intrinsics.fx, (v - intrinsics.cy) / intrinsics.fy, np.ones(len(u))], axis=1
    )
    points = rays * ahead[:, None]
    if to_world is None and (to_world := find_upright(points)) is None:
        to_world = CAMERA_AXES
    points = points @ to_world.T + position
    return recenter(Cloud(points, None if colors is None else colors[is_seen], position[None]))


def _find_pose(path: Path, pose: ArrayLike) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, " 3"]]:
    try:
        matrix = np.asarray(pose, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ScanError(f"{path}: pose must be numbers: {error}") from error
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise ScanError(f"{path}: pose must be 4 x 4 finite numbers, not of shape {matrix.shape}")
    rotation = matrix[:3, :3]
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > _RIGID_TOLERANCE or np.linalg.det(rotation) < 0:
        raise ScanError(f"{path}: pose must be rigid (orthonormal rotation, camera -> world)")
    return rotation, matrix[:3, 3]


def _read_image(path: Path, max_bytes: float, mode: str | None = None) -> Shaped[np.ndarray, "*axes"]:
    """Return the pixels of an image whose size is within the limit, as they are or in a mode of Pillow."""
    try:
        with open_bounded(path, max_bytes) as file:
            if path.suffix.lower() == ".npy":
                array = read_array(file.stream, file.size)
                check_size(array.size * POINT_BYTES, max_bytes)
                return array
        require_extras("a picture", "formats")
        from PIL import Image

        with Image.open(path, formats=_PICTURES) as image:
            check_size(image.width * image.height * POINT_BYTES, max_bytes)
            return np.asarray(image.convert(mode) if mode else image)
    except MissingExtraError:
        raise
    except Exception as error:  # damaged bytes make the libraries raise every kind of error
        raise ScanError(f"{path}: cannot be used as a picture: {error}") from error
