"""The large planes of a scan (walls, floor, table tops), where no object is searched, and the noise of its ranges."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from reconstruction._src.scans.cloud import Cloud

PATCH = 0.06  # Planes are sought among patches of this width [m]
_MIN_PATCH = 6  # A patch with fewer points has no normal
_FLATNESS = 0.03  # A patch is flat where the least variance is below this share of the middle one
_COSINE = 0.94  # Normals of patches of one plane deviate by less than 20 degrees
_NUM_TRIALS = 150  # Planes tried for each that is found
_MAX_PLANES = 60
_RASTER = 0.06  # Connected parts of a plane are found on a raster of this width [m]
_SPREAD = 2  # Parts of a plane grow by as many fields of the raster: patches at corners and rims are not flat
_MAD = 1.4826  # From the median absolute deviation to the standard deviation of a normal distribution
_COARSE = 0.03  # Half the thickness of a plane before the noise is known [m]


class Plane(NamedTuple):
    """A large plane: normal · x = offset, and where it is."""

    normal: Float[np.ndarray, " 3"]  #
    offset: float  # [m]
    axes: Float[np.ndarray, "2 3"]  # of the raster
    low: Float[np.ndarray, " 2"]  # corner of the raster, in its axes [m]
    is_there: Bool[np.ndarray, "A B"]  # which fields of the raster belong to it

    def find_on(self, points: Float[np.ndarray, "N 3"], thickness: float) -> Bool[np.ndarray, " N"]:
        """Return which points are within half a thickness of the plane and on its fields [m]."""
        near = np.abs(points @ self.normal - self.offset) <= thickness
        rows = np.flatnonzero(near)
        field = np.floor((points[rows] @ self.axes.T - self.low) / _RASTER).astype(np.int64)
        inside = ((field >= 0) & (field < self.is_there.shape)).all(axis=1)
        near[rows[~inside]] = False
        near[rows[inside]] = self.is_there[field[inside, 0], field[inside, 1]]
        return near


class _Patches(NamedTuple):
    """Flat patches of the scan: means, normals, and their area, one each."""

    center: np.ndarray
    normal: np.ndarray


def find_planes(points: Float[np.ndarray, "N 3"], min_area: float, rng: np.random.Generator) -> list[Plane]:
    """Find planes with a connected part of at least an area, the largest first (RANSAC over patches)."""
    left = _make_patches(points)
    planes: list[Plane] = []
    min_patches = max(int(0.5 * min_area / PATCH**2), 4)
    while len(planes) < _MAX_PLANES and len(left.center) >= min_patches:
        trials = rng.choice(len(left.center), min(_NUM_TRIALS, len(left.center)), replace=False)
        counts = [
            _find_on(left, left.normal[i], float(left.center[i] @ left.normal[i])).sum() for i in trials
        ]
        best = trials[int(np.argmax(counts))]
        if max(counts) < min_patches:
            break
        normal, offset = left.normal[best], float(left.center[best] @ left.normal[best])
        for _ in range(2):
            near = left.center[_find_on(left, normal, offset)]
            normal, offset = _fit(near) if len(near) >= min_patches else (normal, offset)
        on = _find_on(left, normal, offset)
        plane = _make_plane(left.center[on], normal, offset, min_area) if on.any() else None
        if plane is not None:
            planes.append(plane)
        on[best] = True  # the search ends, whatever the fit did
        left = _Patches(left.center[~on], left.normal[~on])
    return planes


def find_background(
    points: Float[np.ndarray, "N 3"], planes: list[Plane], thickness: float
) -> Bool[np.ndarray, " N"]:
    """Return which points are on one of the planes, within half a thickness [m]."""
    is_background = np.zeros(len(points), dtype=bool)
    for plane in planes:
        rows = np.flatnonzero(~is_background)
        is_background[rows] = plane.find_on(points[rows], thickness)
    return is_background


def measure_noise(cloud: Cloud, planes: list[Plane], sample: int = 40_000) -> float:
    """Return the standard deviation of the ranges on large planes [m]; 0 where there are none."""
    rows = np.linspace(0, cloud.num_points - 1, min(sample, cloud.num_points)).astype(np.int64)
    points, origins = cloud.points[rows], cloud.origins
    residuals = []
    for plane in planes:
        on = plane.find_on(points, _COARSE)
        if on.sum() < 50:
            continue
        away = points[on] @ plane.normal - plane.offset
        away = away - np.median(away)
        if origins is not None:
            ray = points[on] - origins[rows[on]]
            cosine = np.abs(ray @ plane.normal) / np.maximum(np.linalg.norm(ray, axis=1), 1e-9)
            away = away[cosine > 0.5] / cosine[cosine > 0.5]
        residuals.append(away)
    found = np.concatenate(residuals) if residuals else np.zeros(0)
    return _MAD * float(np.median(np.abs(found))) if len(found) else 0.0


def _make_patches(points: np.ndarray) -> _Patches:
    """Return mean and normal of every flat patch."""
    index = np.floor((points - points.min(axis=0)) / PATCH).astype(np.int64)
    shape = index.max(axis=0) + 1
    _, patch, counts = np.unique(
        (index[:, 0] * shape[1] + index[:, 1]) * shape[2] + index[:, 2],
        return_inverse=True,
        return_counts=True,
    )
    mean = np.stack([np.bincount(patch, column) for column in points.T], axis=1) / counts[:, None]
    offset = points - mean[patch]
    covariance = np.empty((len(counts), 3, 3))
    for i in range(3):
        for j in range(i + 1):
            moment = np.bincount(patch, offset[:, i] * offset[:, j], minlength=len(counts)) / counts
            covariance[:, i, j] = covariance[:, j, i] = moment
    kept = counts >= _MIN_PATCH
    values, vectors = np.linalg.eigh(covariance[kept])
    flat = values[:, 0] < np.maximum(_FLATNESS * values[:, 1], 0.25 * (PATCH / 6) ** 2)
    return _Patches(mean[kept][flat], vectors[flat, :, 0])


def _find_on(patches: _Patches, normal: np.ndarray, offset: float) -> np.ndarray:
    near = np.abs(patches.center @ normal - offset) < _COARSE / 2
    return near & (np.abs(patches.normal @ normal) > _COSINE)


def _fit(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the plane with the least squares of distances."""
    mean = points.mean(axis=0)
    normal = np.linalg.eigh((points - mean).T @ (points - mean))[1][:, 0]
    return normal, float(mean @ normal)


def _make_plane(points: np.ndarray, normal: np.ndarray, offset: float, min_area: float) -> Plane | None:
    """Return the plane on the connected parts of its patches that are large enough; None where none is."""
    first = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    first /= np.linalg.norm(first)
    axes = np.stack([first, np.cross(normal, first)])
    places = points @ axes.T
    low = places.min(axis=0) - (_SPREAD + 1) * _RASTER
    field = np.floor((places - low) / _RASTER).astype(np.int64)
    raster = np.zeros(field.max(axis=0) + _SPREAD + 2, dtype=bool)
    raster[field[:, 0], field[:, 1]] = True
    joined = ndimage.binary_dilation(raster, np.ones((3, 3)), iterations=_SPREAD)
    parts = np.empty(joined.shape, np.int64)
    count = int(ndimage.label(joined, output=parts))  # pyright: ignore[reportArgumentType]
    areas = ndimage.sum_labels(raster, parts, np.arange(1, count + 1)) * _RASTER**2
    wanted = np.flatnonzero(areas >= min_area) + 1
    return Plane(normal, offset, axes, low, np.isin(parts, wanted)) if len(wanted) else None
