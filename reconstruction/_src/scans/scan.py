"""Scan logs: the readings of a robot with two laser scanners, and the poses they were taken from; and their files."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, UInt8
from numpy.typing import ArrayLike

from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.bounded_read import (
    MAX_BYTES,
    BoundedFile,
    UnreadableFileError,
    find_npz_names,
    name_file,
    open_bounded,
    read_npz,
)
from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.slip_readings import SlipReadings
from reconstruction._src.scans.text_points import read_text

_RIGID_TOLERANCE = 1e-3  # Largest error of R R^T - 1: poses may come from text with four digits
_ARRAYS = ("ranges", "angles", "poses", "mount", "box", "colors")  # Arrays of a log as its file has them
_3DTK_AXES = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rows: ahead, left and up in 3DTK's coordinates: left-handed, in centimeters, x to the right, y up, z ahead."""
_3DTK_UNITS_PER_METER = 100.0
_3DTK_RANGES = 0.2, 32.0  # Least and largest range of a beam that returned [m]
_3DTK_POSE_BYTES = 10_000  # Largest .pose: it holds six numbers
_3DTK_NEW_SWEEP = -np.pi / 4
"""Change of the angle within the sweep [rad] that begins a new one: beams of one sweep turn the other way."""


@dataclass(frozen=True, eq=False)
class HorizontalScans:
    """Readings for the localization: a horizontal scanner and wheel odometry, one row a vertical scan."""

    ranges: Float[np.ndarray, "*axes"]  # [m]; nan: no return
    angles: Float[np.ndarray, " C"]  # [rad], 0 ahead, counter-clockwise seen from above
    mount: Float[np.ndarray, "*axes"]  # scanner -> robot
    odometry: Float[np.ndarray, "*axes"]  # x, y [m] and yaw [rad] from wheel odometry, from the start pose on
    # x, y [m] and yaw [rad] of the robot in the world at its first scan (a mark on the ground)
    start: Float[np.ndarray, " 3"]


@dataclass(frozen=True, eq=False)
class ScanTruth:
    """Ground truth of a simulated log, to measure errors; no step of the processing reads it."""

    robot_poses: Float[np.ndarray, "S 4 4"]  # robot -> world, with all vibration
    is_mixed: Bool[np.ndarray, "S B"]  # the beam met an edge and returned a mix of two surfaces


@dataclass(frozen=True, eq=False, repr=False)
class ScanLog:
    """Vertical scans in the order they were taken, and the poses they were taken from.

    A beam leaves the sensor in its x-y plane: at angle a and range r it ends at (r cos a, r sin a, 0).

    Attributes:
        ranges: [m]; nan: no return (inf, zero and negative values are turned into nan).
        angles: [rad].
        poses: sensor -> world.
        mount: sensor -> robot; the robot stands on the plane z = 0 of its own frame.
        box: lowest and highest corner of the region of interest in the world [m], or None.
        horizontal: the scans and odometry that localize the robot, or None.
        truth: ground truth of a simulation, or None.
        report: figures about how the log was made (localization error, seed, ...).
        colors: red, green and blue of every reading, 0 to 255, from a camera beside the scanner; or None. Zeros where a
            beam did not return.
        slip: what a robot read that dragged its tracks over the ground, or None.

    Raises:
        ScanError: arrays of other shapes, no numbers, angles or poses that are not finite, poses that are not
            rigid, or corners of the box in another order.
    """

    ranges: Float[np.ndarray, "*axes"]
    angles: Float[np.ndarray, " B"]
    poses: Float[np.ndarray, "S 4 4"]
    mount: Float[np.ndarray, "*axes"] = field(default_factory=lambda: np.eye(4))
    box: Float[np.ndarray, "*axes"] | None = None
    horizontal: HorizontalScans | None = None
    truth: ScanTruth | None = None
    report: dict[str, float] = field(default_factory=dict)
    colors: UInt8[np.ndarray, "S B 3"] | None = None
    slip: SlipReadings | None = None

    def __post_init__(self) -> None:
        ranges = _as_floats("ranges", self.ranges, 2).copy()
        angles = _as_floats("angles", self.angles, 1)
        poses = _as_floats("poses", self.poses, 3)
        num_scans, num_beams = ranges.shape
        if angles.shape != (num_beams,):
            raise ScanError(
                f"angles has {len(angles)} entries, ranges {ranges.shape} has {num_beams} beams a scan"
            )
        if poses.shape != (num_scans, 4, 4):
            raise ScanError(f"poses has shape {poses.shape}; ranges {ranges.shape} needs ({num_scans}, 4, 4)")
        if not (np.isfinite(angles).all() and np.isfinite(poses).all()):
            raise ScanError("angles and poses must be finite; drop the scans whose pose is unknown")
        rotation = poses[:, :3, :3]
        if num_scans and np.abs(rotation @ rotation.transpose(0, 2, 1) - np.eye(3)).max() > _RIGID_TOLERANCE:
            raise ScanError("poses must be rigid (orthonormal rotation, sensor -> world)")
        ranges[~np.isfinite(ranges) | (ranges <= 0)] = np.nan
        for name, value in (("ranges", ranges), ("angles", angles), ("poses", poses)):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "mount", _as_floats("mount", self.mount, 2))
        if self.box is not None:
            box = _as_floats("box", self.box, 2)
            if box.shape != (2, 3) or not (box[0] <= box[1]).all():
                raise ScanError(f"box must be [[lowest], [highest]] corner, shape (2, 3), not {self.box}")
            object.__setattr__(self, "box", box)
        object.__setattr__(self, "report", dict(self.report))
        if self.colors is not None:
            colors = np.asarray(self.colors)
            if colors.dtype != np.uint8 or colors.shape != (*ranges.shape, 3):
                raise ScanError(
                    f"colors must be bytes of shape {(*ranges.shape, 3)}, not {colors.dtype} {colors.shape}"
                )
            object.__setattr__(self, "colors", colors)

    def __repr__(self) -> str:
        num_scans, num_beams = self.ranges.shape
        names = ("horizontal", "truth", "colors", "slip")
        extras = [name for name in names if getattr(self, name) is not None]
        return f"ScanLog({' with '.join([f'{num_scans} scans of {num_beams} beams', *extras])})"

    @property
    def is_valid(self) -> Bool[np.ndarray, "S B"]:
        """Whether each beam returned."""
        return np.isfinite(self.ranges)

    def grid(self) -> Float[np.ndarray, "S B 3"]:
        """Return the end point of every beam in the world [m]; nan: no return."""
        planar = np.stack([np.cos(self.angles), np.sin(self.angles)])
        ends = np.einsum("sik,kb->sbi", self.poses[:, :3, :2], planar)
        ends *= self.ranges[:, :, None]
        ends += self.poses[:, None, :3, 3]
        return ends

    def points(self) -> Float[np.ndarray, "*axes"]:
        """Return the end points of the beams that returned, in the world [m], scan after scan."""
        return self.grid()[self.is_valid]

    @property
    def point_colors(self) -> UInt8[np.ndarray, "N 3"] | None:
        """Colors of `points()`, or None."""
        return None if self.colors is None else self.colors[self.is_valid]

    def replace(self, **changes: object) -> ScanLog:
        """Return a copy with some attributes changed."""
        return replace(self, **changes)  # type: ignore[arg-type]

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the log as a compressed .npz (plain arrays, no pickle), atomically.

        Raises:
            ScanError: another suffix, or the folder cannot be written to.
        """
        path = Path(path)
        if path.suffix != ".npz":
            raise ScanError(f"{path}: a scan log is written as .npz, not {path.suffix or 'without a suffix'}")
        arrays: dict[str, Any] = {name: getattr(self, name) for name in _ARRAYS}
        arrays["report_names"] = np.array(list(self.report), dtype="U")
        arrays["report_values"] = np.array(list(self.report.values()), dtype=float)
        for name, kind in _PARTS.items():
            part = getattr(self, name)
            if part is not None:
                arrays |= {f"{name}.{key}": getattr(part, key) for key in kind.__dataclass_fields__}
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with write_atomically(path) as temporary:
                np.savez_compressed(temporary, **{k: v for k, v in arrays.items() if v is not None})
        except OSError as error:
            raise ScanError(f"{path}: cannot be written: {error}") from error
        return path


_PARTS = {"horizontal": HorizontalScans, "truth": ScanTruth, "slip": SlipReadings}
"""Parts of a log -> their class; in its file, the arrays of a part are named ``part.field``."""


def _as_floats(name: str, value: ArrayLike, num_axes: int) -> Float[np.ndarray, "*axes"]:
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ScanError(f"{name} must be numbers: {error}") from error
    if array.ndim != num_axes:
        raise ScanError(f"{name} must have {num_axes} axes, not shape {array.shape}")
    return array


def is_scan_log(path: str | os.PathLike[str]) -> bool:
    """Return whether a file contains scans with poses, rather than points."""
    path = Path(path)
    if path.suffix == ".3d":
        return path.with_suffix(".pose").is_file()
    try:
        return path.suffix == ".npz" and "ranges" in find_npz_names(path)
    except UnreadableFileError:
        return False


def load_scan_log(path: str | os.PathLike[str], max_bytes: float = MAX_BYTES) -> ScanLog:
    """Read a log written by `ScanLog.save`, or a raw one in the form of 3DTK (`scan000.3d` with `scan000.pose`).

    Args:
        path: .npz or .3d.
        max_bytes: most bytes that the file may hold once unpacked.

    Raises:
        ScanError: naming the file and the reason.
    """
    path = Path(path)
    if path.suffix == ".3d":
        return load_3dtk(path, max_bytes)
    with name_file(path):
        arrays = read_npz(path, max_bytes=max_bytes)
    try:
        names, values = arrays["report_names"].tolist(), arrays["report_values"].tolist()
        parts: dict[str, Any] = {name: arrays.get(name) for name in ("box", "colors")}
        for part, kind in _PARTS.items():
            own = {name[len(part) + 1 :]: arrays[name] for name in arrays if name.startswith(f"{part}.")}
            parts[part] = kind(**own) if own else None
        parts["report"] = dict(zip(names, values, strict=True))
        return ScanLog(arrays["ranges"], arrays["angles"], arrays["poses"], arrays["mount"], **parts)
    except (KeyError, TypeError, ValueError) as error:
        raise ScanError(f"{path}: not a scan log: {error}") from error


def load_3dtk(path: Path, max_bytes: float = MAX_BYTES) -> ScanLog:
    """Read the raw ordered scan of a tilting planar scanner in the form of 3DTK as a log: one scan a sweep."""
    with name_file(path), open_bounded(path, max_bytes) as file:
        points = read_3dtk_points(file)
    pose = read_3dtk_pose(path.with_suffix(".pose"))
    num_beams = _count_beams(path, points)
    sweeps = points.reshape(-1, num_beams, 3)
    ranges = np.linalg.norm(sweeps, axis=2)
    ahead = np.hypot(sweeps[..., 0], sweeps[..., 2])
    angles = np.median(np.arctan2(ahead, -sweeps[..., 1]), axis=0)
    middle = slice(num_beams // 4, 3 * num_beams // 4)
    tilt = np.median(np.arctan2(sweeps[:, middle, 2], sweeps[:, middle, 0]), axis=1)
    ranges[(ranges < _3DTK_RANGES[0]) | (ranges > _3DTK_RANGES[1])] = np.nan
    # Angle 0 of a scan plane is to the right, 90 degrees ahead and up by the tilt.
    zero, one = np.zeros_like(tilt), np.ones_like(tilt)
    right, up = np.stack([zero, -one, zero], 1), np.stack([np.cos(tilt), zero, np.sin(tilt)], 1)
    planes = np.tile(np.eye(4), (len(tilt), 1, 1))
    planes[:, :3, :3] = np.stack([right, up, np.cross(right, up)], axis=2)
    return ScanLog(ranges, angles, pose @ planes)


def read_3dtk_points(file: BoundedFile) -> Float[np.ndarray, "N 3"]:
    """Read the points of a `.3d` as x ahead, y left, z up [m]."""
    return read_text(file).points @ _3DTK_AXES.T / _3DTK_UNITS_PER_METER


def _count_beams(path: Path, points: Float[np.ndarray, "N 3"]) -> int:
    """Find the beams of a sweep: the angle within the sweep falls back where the next one begins."""
    angle = np.arctan2(np.hypot(points[:, 0], points[:, 2]), -points[:, 1])
    starts = np.flatnonzero(np.diff(angle) < _3DTK_NEW_SWEEP) + 1
    num_beams = int(starts[0]) if len(starts) else 0
    if num_beams < 2 or not np.array_equal(
        np.append(starts, len(points)), num_beams * np.arange(1, len(starts) + 2)
    ):
        raise ScanError(f"{path}: {len(points)} points that are not ordered in sweeps of equal length")
    return num_beams


def read_3dtk_pose(path: Path) -> Float[np.ndarray, "4 4"]:
    """Read position [cm] and Euler angles [deg] about x, y, z (left-handed) as a pose, sensor -> world."""
    try:
        with open_bounded(path, _3DTK_POSE_BYTES) as file:
            values = np.array(file.read_exactly(file.size).split(), dtype=float)
    except ValueError as error:
        raise ScanError(f"{path}: {error}") from error
    if values.shape != (6,) or not np.isfinite(values).all():
        raise ScanError(f"{path}: needs 6 finite numbers (position, angles), has {len(values)}")
    (cx, cy, cz), (sx, sy, sz) = np.cos(np.radians(values[3:])), np.sin(np.radians(values[3:]))
    turn_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    turn_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    turn_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    pose = np.eye(4)
    pose[:3, :3] = _3DTK_AXES @ turn_x @ turn_y @ turn_z @ _3DTK_AXES.T
    pose[:3, 3] = _3DTK_AXES @ values[:3] / _3DTK_UNITS_PER_METER
    return pose
