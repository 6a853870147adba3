"""Where an object may be: the scan without its large planes (walls, floor, table tops), in overlapping regions."""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import ndimage
from scipy.spatial import cKDTree

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.geometry.manifold import label_parts
from reconstruction._src.geometry.rows import Points, compute_lengths, sum_by_owner
from reconstruction._src.geometry.sampling import sample_surface
from reconstruction._src.input_cloud import make_cloud
from reconstruction._src.objects.model import ObjectModel, compute_spread
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.cloud_file import make_log_cloud
from reconstruction._src.scans.scan import ScanLog
from reconstruction._src.scans.selection import compute_cell_keys

SPACING = 0.008
"""Readings are averaged in cells of this width for the search [m]. Wider: faster, and small parts of an object are
lost. The verification uses every beam."""
_MAX_SAMPLES = 2_000_000  # A mesh is sampled with no more points than this
_PATCH = 0.06  # Planes are sought among patches of this width [m]
_MIN_PATCH = 6  # A patch with fewer points has no normal
_FLATNESS = 0.03  # A patch is flat where the least variance is below this share of the middle one
_COSINE = 0.94  # Normals of patches of one plane deviate by less than 20 degrees
_NUM_TRIALS = 150  # Planes tried for each that is found
_MAX_PLANES = 60
_RASTER = 0.06  # Connected parts of a plane are found on a raster of this width [m]
_SPREAD = 2  # Parts of a plane grow by as many fields of the raster: patches at corners and rims are not flat
_MAD = 1.4826  # From the median absolute deviation to the standard deviation of a normal distribution
_COARSE = 0.03  # Half the thickness of a plane before the noise is known [m]
_NOISE_SAMPLE, _MIN_ON_PLANE = 40_000, 50  # Readings that measure the noise; fewest of one plane
_GAP = 2.5  # Cells closer than this many spacings belong together
_MIN_EXTENT = 0.5  # What is smaller than this share of the object's radius is no part of it
_MIN_SPREAD = 0.4  # Along each principal axis a region is as wide as this share of the object
_MIN_CELLS = 12  # Of a region


class Plane(NamedTuple):
    """A large plane: normal · x = offset, and where it is."""

    normal: Float[np.ndarray, " 3"]
    offset: float  # [m]
    axes: Float[np.ndarray, "2 3"]  # of the raster
    low: Float[np.ndarray, " 2"]  # corner of the raster, in its axes [m]
    is_there: Bool[np.ndarray, "A B"]  # which fields of the raster belong to it

    def find_on(self, points: Points, thickness: float) -> Bool[np.ndarray, " N"]:
        """Return which points are within half a thickness of the plane and on its fields [m]."""
        near = np.abs(points @ self.normal - self.offset) <= thickness
        rows = np.flatnonzero(near)
        field = np.floor((points[rows] @ self.axes.T - self.low) / _RASTER).astype(np.int64)
        inside = ((field >= 0) & (field < self.is_there.shape)).all(axis=1)
        near[rows[~inside]] = False
        near[rows[inside]] = self.is_there[field[inside, 0], field[inside, 1]]
        return near


class Region(NamedTuple):
    """A part of the scan that may hold an object."""

    center: Float[np.ndarray, " 3"]  # [m]
    rows: Int[np.ndarray, " M"]  # cells that are not background, within a diameter


def read_scan(scan: Any, seed: int) -> tuple[Cloud, Float[np.ndarray, "N 3"] | None]:
    """Return what is searched as a cloud near the origin of its frame, and the normals of a mesh at its points."""
    from reconstruction._src.reconstruction import Reconstruction

    if isinstance(scan, Reconstruction):
        return make_cloud(scan.readings), None
    if isinstance(scan, ScanLog):
        return make_cloud(make_log_cloud(scan)), None
    if not (hasattr(scan, "faces") and hasattr(scan, "vertices")):
        return make_cloud(scan), None
    if not len(scan.faces):
        raise ReconstructionError("the mesh that is searched has no faces")
    count = int(np.clip(4 * float(scan.area) / SPACING**2, 100, _MAX_SAMPLES))
    points, faces = sample_surface(scan, count, seed)
    return make_cloud(points), np.asarray(scan.face_normals)[faces]


def find_planes(points: Points, min_area: float, rng: np.random.Generator) -> list[Plane]:
    """Find planes with a connected part of at least an area [m²], the largest first (RANSAC over flat patches)."""
    centers, normals = _make_patches(points)
    planes: list[Plane] = []
    min_patches = max(int(0.5 * min_area / _PATCH**2), 4)

    def find_on(normal: np.ndarray, offset: float) -> np.ndarray:
        near = np.abs(centers @ normal - offset) < _COARSE / 2
        return near & (np.abs(normals @ normal) > _COSINE)

    while len(planes) < _MAX_PLANES and len(centers) >= min_patches:
        trials = rng.choice(len(centers), min(_NUM_TRIALS, len(centers)), replace=False)
        counts = [find_on(normals[i], float(centers[i] @ normals[i])).sum() for i in trials]
        if max(counts) < min_patches:
            break
        best = trials[int(np.argmax(counts))]
        normal, offset = normals[best], float(centers[best] @ normals[best])
        for _ in range(2):
            near = centers[find_on(normal, offset)]
            if len(near) >= min_patches:
                middle = near.mean(axis=0)
                normal = np.linalg.eigh((near - middle).T @ (near - middle))[1][:, 0]
                offset = float(middle @ normal)
        on = find_on(normal, offset)
        plane = _make_plane(centers[on], normal, offset, min_area) if on.any() else None
        if plane is not None:
            planes.append(plane)
        on[best] = True  # the search ends, whatever the fit did
        centers, normals = centers[~on], normals[~on]
    return planes


def find_background(points: Points, planes: list[Plane], thickness: float) -> Bool[np.ndarray, " N"]:
    """Return which points are on one of the planes, within half a thickness [m]."""
    is_background = np.zeros(len(points), dtype=bool)
    for plane in planes:
        rows = np.flatnonzero(~is_background)
        is_background[rows] = plane.find_on(points[rows], thickness)
    return is_background


def measure_noise(cloud: Cloud, planes: list[Plane]) -> float:
    """Return the standard deviation of the ranges on large planes [m]; 0 where there are none."""
    rows = np.linspace(0, cloud.num_points - 1, min(_NOISE_SAMPLE, cloud.num_points)).astype(np.int64)
    points, origins = cloud.points[rows], cloud.origins
    residuals = []
    for plane in planes:
        on = plane.find_on(points, _COARSE)
        if on.sum() < _MIN_ON_PLANE:
            continue
        away = points[on] @ plane.normal - plane.offset
        away = away - np.median(away)
        if origins is not None:
            ray = points[on] - origins[rows[on]]
            cosine = np.abs(ray @ plane.normal) / np.maximum(compute_lengths(ray), 1e-9)
            away = away[cosine > 0.5] / cosine[cosine > 0.5]
        residuals.append(away)
    found = np.concatenate(residuals) if residuals else np.zeros(0)
    return _MAD * float(np.median(np.abs(found))) if len(found) else 0.0


def find_regions(points: Float[np.ndarray, "C 3"], model: ObjectModel) -> list[Region]:
    """Return the regions in which an object is searched.

    Parts smaller than the object give one region; larger ones are covered by several that overlap.
    """
    if len(points) < _MIN_CELLS:
        return []
    tree = cKDTree(points)
    pairs = tree.query_pairs(_GAP * SPACING, output_type="ndarray")
    part = label_parts(pairs, len(points))
    order = np.argsort(part, kind="stable")
    regions: list[Region] = []
    for rows in np.split(order, np.cumsum(np.bincount(part))[:-1]):
        if len(rows) >= _MIN_CELLS and np.ptp(points[rows], axis=0).max() >= _MIN_EXTENT * model.radius:
            regions += _cover(points, rows, tree, model.radius)
    return [each for each in regions if _may_hold(points, each, model)]


def _cover(points: np.ndarray, rows: np.ndarray, tree: cKDTree, radius: float) -> list[Region]:
    """Return regions around places of a part, a radius apart, until all of it is covered."""

    def make_region(center: np.ndarray, reach: float) -> Region:
        return Region(center, np.sort(np.array(tree.query_ball_point(center, reach * radius), np.int64)))

    middle = (points[rows].min(axis=0) + points[rows].max(axis=0)) / 2
    if compute_lengths(points[rows] - middle).max() <= 1.3 * radius:
        return [make_region(middle, 1.5)]
    regions, left = [], rows
    while len(left):
        seed = points[left[int(np.argmin(points[left] @ np.array([1.0, 0.618, 0.382])))]]
        near = compute_lengths(points[left] - seed) <= radius
        regions.append(make_region(points[left[near]].mean(axis=0), 1.4))
        left = left[~near]
    return [each for each in regions if len(each.rows) >= _MIN_CELLS]


def _may_hold(points: np.ndarray, region: Region, model: ObjectModel) -> bool:
    """Return whether what is near the center is no thinner than half the object, as edges and flat sides are."""
    near = points[region.rows]
    near = near[compute_lengths(near - region.center) <= model.radius]
    return len(near) >= _MIN_CELLS and bool((compute_spread(near)[0] >= _MIN_SPREAD * model.spread).all())


def _make_patches(points: Points) -> tuple[Float[np.ndarray, "P 3"], Float[np.ndarray, "P 3"]]:
    _, patch, counts = np.unique(compute_cell_keys(points, _PATCH), return_inverse=True, return_counts=True)
    mean = sum_by_owner(patch, points, len(counts)) / counts[:, None]
    offset = points - mean[patch]
    products = (offset[:, :, None] * offset[:, None]).reshape(-1, 9)
    covariance = (sum_by_owner(patch, products, len(counts)) / counts[:, None]).reshape(-1, 3, 3)
    kept = counts >= _MIN_PATCH
    values, vectors = np.linalg.eigh(covariance[kept])
    flat = values[:, 0] < np.maximum(_FLATNESS * values[:, 1], 0.25 * (_PATCH / 6) ** 2)
    return mean[kept][flat], vectors[flat, :, 0]


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
