"""Scan logs: the readings of a robot with two laser scanners, and the poses they were taken from."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, UInt8
from numpy.typing import ArrayLike, NDArray

from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.slip_readings import SlipReadings

Array = NDArray[np.float64]


_RIGID_TOLERANCE = 1e-3  # Largest error of R R^T - 1: poses may come from text with four digits


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
                f"angles has {len(angles)} entries, but ranges {ranges.shape} has {num_beams} beams a scan"
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
                    f"colors must be bytes red, green, blue of shape {(*ranges.shape, 3)}, "
                    f"not {colors.dtype} of {colors.shape}"
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
        if self.colors is not None:
            arrays["colors"] = self.colors
        for prefix, part in (("horizontal", self.horizontal), ("truth", self.truth)):
            if part is not None:
                arrays |= {f"{prefix}.{name}": value for name, value in vars(part).items()}
        if self.slip is not None:
            arrays |= {f"slip.{name}": value for name, value in self.slip.as_arrays().items()}
        return _write_npz(path, arrays)


def _write_npz(path: str | os.PathLike[str], arrays: dict[str, ArrayLike]) -> Path:
    path = Path(path)
    if path.suffix != ".npz":
        raise ScanError(f"{path}: a scan log is written as .npz, not {path.suffix or 'without a suffix'}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with write_atomically(path) as temporary:
            np.savez_compressed(temporary, **arrays)  # type: ignore[arg-type]
    except OSError as error:
        raise ScanError(f"{path}: cannot be written: {error}") from error
    return path


def _as_floats(name: str, value: ArrayLike, num_axes: int) -> Float[np.ndarray, "*axes"]:
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ScanError(f"{name} must be numbers: {error}") from error
    if array.ndim != num_axes:
        raise ScanError(f"{name} must have {num_axes} axes, not shape {array.shape}")
    return array
