"""From the frame of a file to ours: meters, z up, and coordinates small enough for single precision."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.point_rows import RawPoints

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "us-ft": 1200 / 3937, "in": 0.0254}
"""Meters in one unit of the file: ft is the international foot, us-ft the foot of American land surveys."""
UP_AXES = {
    "z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "-z": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
    "y": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "-y": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "x": ((0, 1, 0), (0, 0, 1), (1, 0, 0)),
    "-x": ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
}
"""Axis of the file that points up -> rows: our x, y, z in the file's coordinates. All are rotations. y: as glTF files
are; -y: a camera that looks along z, with y down."""


_MAX_DISTANCE = 1000.0
"""A cloud whose middle (median) is farther from the origin than this, and than its own longest side, is moved
to it [m]. At 1 km single precision is still a hundred times finer than a good scanner."""
_MAX_EXTENTS = 1000.0
"""The same, in lengths of the cloud's longest side: at 1,000 of them single precision resolves 0.00006 of the
cloud, finer than any network does. It moves small things far away."""
_OFFSET_STEP = 1.0  # The offset is a multiple of this [m]. Whole meters are easy to add by hand.


@dataclass(frozen=True)
class FrameConfig:
    """When coordinates are moved, and which sizes are asked about.

    MuJoCo and most mesh formats keep coordinates in single precision, 6e-8 of their size: at the 5,400 km of a UTM
    northing a vertex moves by up to 0.25 m, at 1 km by 0.03 mm.

    Attributes:
        smallest, largest: longest side that is not asked about [m]: scenes of robots. A side outside is mostly a
            file in another unit, or one with stray points.
    """

    smallest: float = 0.1
    largest: float = 1000.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not value > 0:
                raise ScanError(f"{name} must be above 0, got {value}")


@dataclass(frozen=True)
class Frame:
    """How coordinates of a file become meters with z up."""

    rotation: Float[np.ndarray, "3 3"]  # the file's axes -> ours
    factor: float  # meters in a unit of the file, with a further scale

    def place(self, positions: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
        """Return positions of the file in meters with z up."""
        if self.factor != 1:
            positions = positions * self.factor
        if np.array_equal(self.rotation, np.eye(3)):
            return positions
        axes, signs = np.abs(self.rotation).argmax(axis=1), self.rotation.sum(axis=1)
        return positions[:, axes] * signs  # no sums of products: exact


def make_frame(raw: RawPoints, unit: str | None = None, up: str | None = None, scale: float = 1.0) -> Frame:
    """Return the frame of a file: what the caller says, else what the file says, else meters with z up."""
    if unit is not None and unit not in UNITS:
        raise ScanError(f"unknown unit {unit!r}; there are: {', '.join(UNITS)}")
    up = up or raw.up or "z"
    if up not in UP_AXES:
        raise ScanError(f"unknown axis up={up!r}; there are: {', '.join(UP_AXES)}")
    if not 0 < scale < math.inf:
        raise ScanError(f"scale must be above 0, got {scale}")
    meters = UNITS[unit] if unit is not None and not raw.has_fixed_unit else raw.meters or 1.0
    return Frame(np.array(UP_AXES[up], float), meters * scale)


def find_offset(
    positions: Float[np.ndarray, "N 3"], config: FrameConfig | None = None
) -> Float[np.ndarray, " 3"]:
    """Return what is subtracted from coordinates far from the origin [m], zeros from others."""
    config = config or FrameConfig()
    center, extent = np.median(positions, axis=0), float(np.ptp(positions, axis=0).max())
    distance = float(np.linalg.norm(center))
    if distance <= max(_MAX_DISTANCE, extent) and distance <= _MAX_EXTENTS * extent:
        return np.zeros(3)
    return np.round(center / _OFFSET_STEP) * _OFFSET_STEP + 0.0


def describe_odd_size(positions: Float[np.ndarray, "N 3"], config: FrameConfig | None = None) -> str | None:
    """Return a sentence about a cloud whose size is none of a robot's scene, or None.

    Args:
        positions: `[N, 3]` [m].
        config: which sizes are asked about.
    """
    config = config or FrameConfig()
    extent = float(np.ptp(positions, axis=0).max())
    if config.smallest <= extent <= config.largest:
        return None
    size = f"{extent:,.0f} m" if extent >= 1 else f"{1000 * extent:.3g} mm"
    bound = (
        f"above {config.largest:g} m" if extent > config.largest else f"below {100 * config.smallest:g} cm"
    )
    return f"its longest side is {size}, {bound}"
