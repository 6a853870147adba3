"""A cloud of points with what is known about it: colors, the sensor's positions, the place in the world."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from numpy.typing import ArrayLike

from reconstruction._src.base.errors import ScanError


@dataclass(frozen=True, eq=False, repr=False)
class Cloud:
    """Points of one or several scans, in one frame.

    Iterating gives points, colors and viewpoints: ``points, colors, viewpoints = rc.load_cloud("scan.ply")``. NumPy
    takes a cloud as its points.

    Attributes:
        points: `[N, 3]` positions [m].
        colors: `[N, 3]` red, green and blue from 0 to 255, or None.
        viewpoints: `[K, 3]` positions of the sensor, in the frame of the points [m], or None where none is known.
        seen_from: `[N]` index of the viewpoint that each point was seen from, or None where that is unknown. With
            a single viewpoint it is filled in.
        offset: `[3]` what was subtracted from the file's coordinates: points + offset stand where the file says [m].
        up: axis of the file that points up, as the user or the file says, or as the points tell beyond doubt; None:
            nothing says it.

    Raises:
        ScanError: arrays of other shapes, values that are not finite, or an index without a viewpoint.
    """

    points: Float[np.ndarray, "N 3"]
    colors: UInt8[np.ndarray, "N 3"] | None = None
    viewpoints: Float[np.ndarray, "K 3"] | None = None
    seen_from: Int[np.ndarray, " N"] | None = None
    offset: Float[np.ndarray, " 3"] = field(default_factory=lambda: np.zeros(3))
    up: str | None = None

    def __post_init__(self) -> None:
        points = _as_positions("points", self.points)
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "offset", _as_positions("offset", np.reshape(self.offset, (1, -1)))[0])
        if self.colors is not None:
            colors = np.asarray(self.colors)
            if colors.dtype != np.uint8 or colors.shape != points.shape:
                raise ScanError(
                    f"colors must be bytes for {len(points)} points, not {colors.dtype} {colors.shape}"
                )
            object.__setattr__(self, "colors", colors)
        if self.viewpoints is None:
            if self.seen_from is not None:
                raise ScanError("seen_from needs viewpoints; give the positions [K, 3] that it names")
            return
        viewpoints = _as_positions("viewpoints", np.atleast_2d(self.viewpoints))
        if not len(viewpoints):
            raise ScanError("viewpoints is empty; leave it out where no position of the sensor is known")
        object.__setattr__(self, "viewpoints", viewpoints)
        if self.seen_from is not None:
            object.__setattr__(self, "seen_from", _as_indices(self.seen_from, len(points), len(viewpoints)))
        elif len(viewpoints) == 1:
            object.__setattr__(self, "seen_from", np.zeros(len(points), np.int64))

    def __iter__(self) -> Iterator[np.ndarray | None]:
        yield from (self.points, self.colors, self.viewpoints)

    def __array__(self, dtype: np.dtype | None = None, copy: bool | None = None) -> np.ndarray:
        return np.array(self.points, dtype, copy=copy)

    def __repr__(self) -> str:
        return f"Cloud({self.describe()})"

    def describe(self) -> str:
        """Return what the cloud holds, in words."""
        parts = [f"{self.num_points} points"]
        if self.colors is not None:
            parts.append("colors")
        if self.viewpoints is not None:
            known = "" if self.seen_from is not None else " (which point from which is unknown)"
            count = len(self.viewpoints)
            parts.append(f"{count} viewpoint{'s' * (count > 1)}{known}")
        if self.offset.any():
            parts.append(f"offset {self.offset.tolist()} m")
        return ", ".join(parts)

    @property
    def num_points(self) -> int:
        """Number of points."""
        return len(self.points)

    @property
    def origins(self) -> Float[np.ndarray, "N 3"] | None:
        """Position of the sensor at each point [m], or None where it is unknown."""
        if self.viewpoints is None or self.seen_from is None:
            return None
        return self.viewpoints[self.seen_from]

    def select(self, chosen: Bool[np.ndarray, " N"] | Int[np.ndarray, " M"]) -> Cloud:
        """Return the cloud of some points, with their colors and viewpoints.

        Args:
            chosen: whether each point is kept, or the indices of those kept.
        """
        return replace(
            self,
            points=self.points[chosen],
            colors=None if self.colors is None else self.colors[chosen],
            seen_from=None if self.seen_from is None else self.seen_from[chosen],
        )

    def shift(self, offset: Float[np.ndarray, " 3"]) -> Cloud:
        """Return the cloud with an offset subtracted from its positions, and added to its own offset [m]."""
        viewpoints = None if self.viewpoints is None else self.viewpoints - offset
        return self.replace(points=self.points - offset, viewpoints=viewpoints, offset=self.offset + offset)

    def in_frame_of(self, other: Cloud) -> Cloud:
        """Return the cloud in the frame of another, with its viewpoints where it has none."""
        shifted = self.shift(other.offset - self.offset)
        return shifted if self.viewpoints is not None else shifted.replace(viewpoints=other.viewpoints)

    def replace(self, **changes: object) -> Cloud:
        """Return a copy with some attributes changed."""
        return replace(self, **changes)  # type: ignore[arg-type]


def _as_positions(name: str, value: ArrayLike) -> Float[np.ndarray, "M 3"]:
    try:
        array = np.ascontiguousarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ScanError(f"{name} must be numbers: {error}") from error
    if array.ndim != 2 or array.shape[1] != 3:
        raise ScanError(f"{name} must be positions x, y, z, not of shape {array.shape}")
    if not np.isfinite(array).all():
        raise ScanError(f"{name} must be finite; drop the others: points[np.isfinite(points).all(axis=1)]")
    return array


def _as_indices(value: ArrayLike, num_points: int, num_viewpoints: int) -> Int[np.ndarray, " N"]:
    indices = np.asarray(value)
    if indices.dtype.kind not in "iu" or indices.shape != (num_points,):
        found = f"{indices.dtype} of shape {indices.shape}"
        raise ScanError(f"seen_from must be one whole number for each of {num_points} points, not {found}")
    if len(indices) and not (indices.min() >= 0 and indices.max() < num_viewpoints):
        low, high = indices.min(), indices.max()
        raise ScanError(f"seen_from has the indices {low} to {high}; there are {num_viewpoints} viewpoints")
    return indices.astype(np.int64, copy=False)
