"""Scans: what a robot with two laser scanners brings home, and its file."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reconstruction.errors import ScanError
from reconstruction.files.atomic_write import write_atomically
from reconstruction.files.bounded_read import MAX_BYTES, UnreadableFileError, read_npz

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HorizontalScans:
    """What localises the robot: a horizontal scanner and the wheels' odometry, one row a vertical scan.

    Attributes:
        ranges: `[S, C]` [m]; nan: no return.
        angles: `[C]` [rad], 0 ahead, counter-clockwise seen from above.
        mount: `[4, 4]` scanner -> robot.
        odometry: `[S, 3]` x, y [m] and yaw [rad] as the wheels count them, from the start pose on.
        start: `[3]` x, y, yaw of the robot in the world where the drive begins (a mark on the ground).
    """

    ranges: Array
    angles: Array
    mount: Array
    odometry: Array
    start: Array


@dataclass(frozen=True, eq=False)
class ScanTruth:
    """What only a simulation knows; for judging alone, no step of the processing reads it.

    Attributes:
        robot_poses: `[S, 4, 4]` robot -> world with all its shaking.
        is_mixed: `[S, B]` the beam met an edge and returned a mix of two surfaces.
    """

    robot_poses: Array
    is_mixed: NDArray[np.bool_]


@dataclass(frozen=True, eq=False, repr=False)
class ScanLog:
    """Vertical scans in the order they were taken, and where they were taken from.

    A beam leaves the sensor in its x-y plane: at angle a and range r it ends at (r cos a, r sin a, 0).

    Attributes:
        ranges: `[S, B]` [m]; nan: no return (inf, zero and negative values are turned into nan).
        angles: `[B]` [rad].
        poses: `[S, 4, 4]` sensor -> world.
        mount: `[4, 4]` sensor -> robot; the robot stands on the plane z = 0 of its own frame.
        box: `[2, 3]` lowest and highest corner of the region of interest in the world [m], or None.
        horizontal: the scans and odometry that localise the robot, or None.
        truth: what a simulation knows, or None.
        report: figures about how the log came to be (localisation error, seed, ...).
    """

    ranges: Array
    angles: Array
    poses: Array
    mount: Array = field(default_factory=lambda: np.eye(4))
    box: Array | None = None
    horizontal: HorizontalScans | None = None
    truth: ScanTruth | None = None
    report: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        ranges = _as_floats("ranges", self.ranges, 2).copy()
        angles = _as_floats("angles", self.angles, 1)
        poses = _as_floats("poses", self.poses, 3)
        num_scans, num_beams = ranges.shape
        if angles.shape != (num_beams,):
            raise ScanError(
                f"angles has {len(angles)} entries, but ranges {ranges.shape} has {num_beams} beams a scan"
            )
        if poses.shape != (num_scans, 4, 4):
            raise ScanError(f"poses has shape {poses.shape}; ranges {ranges.shape} needs ({num_scans}, 4, 4)")
        if not (np.isfinite(angles).all() and np.isfinite(poses).all()):
            raise ScanError("angles and poses must be finite; drop the scans whose pose is unknown")
        rotation = poses[:, :3, :3]
        if num_scans and np.abs(rotation @ rotation.transpose(0, 2, 1) - np.eye(3)).max() > 1e-3:
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

    def __repr__(self) -> str:
        num_scans, num_beams = self.ranges.shape
        extras = [name for name in ("horizontal", "truth") if getattr(self, name) is not None]
        return f"ScanLog({' with '.join([f'{num_scans} scans of {num_beams} beams', *extras])})"

    @property
    def is_valid(self) -> NDArray[np.bool_]:
        """Which beams returned, `[S, B]`."""
        return np.isfinite(self.ranges)

    def grid(self) -> Array:
        """Find where every beam ends in the world, `[S, B, 3]` [m]; nan: no return."""
        planar = np.stack([np.cos(self.angles), np.sin(self.angles)])
        ends = np.einsum("sik,kb->sbi", self.poses[:, :3, :2], planar)
        ends *= self.ranges[:, :, None]
        ends += self.poses[:, None, :3, 3]
        return ends

    def points(self) -> Array:
        """Find where the beams that returned end in the world, `[N, 3]` [m], scan after scan."""
        return self.grid()[self.is_valid]

    def replace(self, **changes: object) -> ScanLog:
        """Make a copy with some attributes changed."""
        return replace(self, **changes)  # type: ignore[arg-type]

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the log as a compressed .npz (numbers alone, no pickle), beside and then renamed.

        Raises:
            ScanError: the folder cannot be written to.
        """
        arrays: dict[str, ArrayLike] = {
            "ranges": self.ranges,
            "angles": self.angles,
            "poses": self.poses,
            "mount": self.mount,
            "report_names": np.array(list(self.report), dtype="U"),
            "report_values": np.array(list(self.report.values()), dtype=float),
        }
        if self.box is not None:
            arrays["box"] = self.box
        for prefix, part in (("horizontal", self.horizontal), ("truth", self.truth)):
            if part is not None:
                arrays |= {f"{prefix}.{name}": value for name, value in vars(part).items()}
        return write_npz(path, arrays)


def load_scan_log(path: str | os.PathLike[str], max_bytes: float = MAX_BYTES) -> ScanLog:
    """Read a log that `ScanLog.save` wrote, or a raw one in the 3DTK form (`scan000.3d` with `scan000.pose`).

    Args:
        path: .npz or .3d.
        max_bytes: the most that the file may hold once unpacked.

    Raises:
        ScanError: naming the file and the reason.
    """
    path = Path(path)
    if path.suffix == ".3d":
        from reconstruction.scans.scan_3dtk import load_3dtk

        return load_3dtk(path, max_bytes=max_bytes)
    try:
        arrays = read_npz(path, max_bytes=max_bytes)
    except UnreadableFileError as error:
        raise ScanError(f"{path}: {error}") from error
    try:
        parts = {}
        for name, kind in (("horizontal", HorizontalScans), ("truth", ScanTruth)):
            found = {
                key.removeprefix(f"{name}."): value
                for key, value in arrays.items()
                if key.startswith(f"{name}.")
            }
            parts[name] = kind(**found) if found else None
        report = dict(zip(arrays["report_names"].tolist(), arrays["report_values"].tolist(), strict=True))
        return ScanLog(
            arrays["ranges"],
            arrays["angles"],
            arrays["poses"],
            arrays["mount"],
            arrays.get("box"),
            **parts,
            report=report,
        )
    except (KeyError, TypeError, ValueError) as error:
        raise ScanError(f"{path}: not a scan log: {error}") from error


def write_npz(path: str | os.PathLike[str], arrays: dict[str, ArrayLike]) -> Path:
    """Write arrays as compressed .npz, beside and then renamed."""
    path = Path(path)
    if path.suffix != ".npz":
        raise ScanError(f"{path}: a scan log is written as .npz, not {path.suffix or 'without a suffix'}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with write_atomically(path) as beside:
            np.savez_compressed(beside, **arrays)  # type: ignore[arg-type]
    except OSError as error:
        raise ScanError(f"{path}: cannot be written: {error}") from error
    return path


def _as_floats(name: str, value: ArrayLike, num_axes: int) -> Array:
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ScanError(f"{name} must be numbers: {error}") from error
    if array.ndim != num_axes:
        raise ScanError(f"{name} must have {num_axes} axes, not shape {array.shape}")
    return array
