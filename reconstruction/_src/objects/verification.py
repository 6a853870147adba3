"""Whether a scan agrees with an object at a pose: beams end on it, and none passes through it."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.geometry.rows import compute_lengths, sum_rows
from reconstruction._src.objects.model import ObjectModel
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.selection import compute_cell_keys

Pose = Float[np.ndarray, "4 4"]  # Of the object in the scan

MARGIN = 0.03
"""Readings nearer to the object than this that it does not explain speak against it [m]: it would be a part of
something larger."""
_POSE_ERROR = 0.003
"""What a fitted pose may be off along a normal [m]; at a grazing angle it shows the more in the range."""
_MIN_COSINE = 0.25
"""Beams that meet the surface at a smaller cosine are treated as if they met it at this one."""
_PART = 0.25  # Deviations are averaged over parts of the object of this share of its radius


class Beams(NamedTuple):
    """Beams of a scan."""

    rows: Int[np.ndarray, " B"]  # which readings
    origins: Float[np.ndarray, "B 3"]  # positions of the sensor [m]
    directions: Float[np.ndarray, "B 3"]  # unit vectors
    ranges: Float[np.ndarray, " B"]  # [m]

    def select_near(self, center: Float[np.ndarray, " 3"], radius: float, most: int | None = None) -> "Beams":
        """Return those that pass a ball ahead of the sensor [m]; of more than `most` every second, third, ..."""
        offset = center - self.origins
        along = sum_rows(offset * self.directions)
        passes = (along > 0) & (sum_rows(offset**2) - along**2 <= radius**2)
        chosen = np.flatnonzero(passes & (self.ranges > (along - radius) / 2))
        if most is not None and len(chosen) > most:
            chosen = chosen[:: -(-len(chosen) // most)]
        return Beams(*(each[chosen] for each in self))


class Verdict(NamedTuple):
    """What the scan says about an object at a pose."""

    score: float  # share of the beams that agree, of those that say something
    coverage: float  # share of the beams at the object that end on it; what stands before it hides the others
    num_beams: int  # beams that end on it


def make_beams(cloud: Cloud) -> Beams | None:
    """Return the beams of a cloud; None where their origins are not known."""
    origins = cloud.origins
    if origins is None:
        return None
    ways = cloud.points - origins
    ranges = np.maximum(compute_lengths(ways), 1e-9)
    return Beams(np.arange(cloud.num_points), origins, ways / ranges[:, None], ranges)


def cast(
    model: ObjectModel, pose: Pose, beams: Beams
) -> tuple[Float[np.ndarray, " B"], Float[np.ndarray, " B"]]:
    """Return where beams would first meet an object [m], infinite where they miss it, and the cosine of incidence."""
    if not len(beams.ranges):
        return np.zeros(0), np.zeros(0)
    origins = np.ascontiguousarray((beams.origins - pose[:3, 3]) @ pose[:3, :3])
    directions = np.ascontiguousarray(beams.directions @ pose[:3, :3])
    found = model.tree.intersect_ray_first(model.vertices, model.faces, origins, directions, np.inf)
    face, hit = np.asarray(found[0]), np.asarray(found[1])
    cosine = np.abs(sum_rows(directions * model.normals[np.maximum(face, 0)]))
    return np.where(face >= 0, hit, np.inf), np.where(face >= 0, cosine, 1.0)


def verify_by_beams(
    model: ObjectModel, pose: Pose, beams: Beams, is_background: Bool[np.ndarray, " B"], tolerance: float
) -> Verdict:
    """Compare the beams that pass an object with the ranges that it would give, within a tolerance [m].

    Four kinds of beams count: those that end on it, that pass through it, that end shortly before it (it would lie
    inside something), and that end beside it on something that is neither the object nor a large plane. What ends
    farther before it hides it, and says nothing.
    """
    expected, cosine = cast(model, pose, beams)
    hits = np.isfinite(expected)
    off = np.where(hits, beams.ranges - np.where(hits, expected, 0.0), 0.0)
    slack = _POSE_ERROR / np.maximum(cosine, _MIN_COSINE)
    ends_on = hits & (np.abs(off) <= tolerance + slack)
    agrees = ends_on.copy()
    if ends_on.any():
        # The noise of the mean over a part of the object is smaller, so that it shows another shape.
        ends = beams.origins[ends_on] + beams.directions[ends_on] * expected[ends_on, None]
        keys = compute_cell_keys((ends - pose[:3, 3]) @ pose[:3, :3], _PART * model.radius)
        _, part, count = np.unique(keys, return_inverse=True, return_counts=True)
        mean = np.bincount(part, off[ends_on]) / count
        agrees[ends_on] = np.abs(mean[part]) <= (tolerance / np.sqrt(count))[part] + slack[ends_on]
    passes_through = hits & (off > tolerance + slack)
    ends_before = hits & (off < -tolerance - slack) & (off > -model.radius)
    others = ~hits & ~is_background
    ends = beams.origins[others] + beams.directions[others] * beams.ranges[others, None]
    local = (ends - pose[:3, 3]) @ pose[:3, :3]
    away = model.measure_distances(local[compute_lengths(local - model.center) < model.radius + MARGIN])
    num_beside = int(((away > tolerance + _POSE_ERROR) & (away <= MARGIN)).sum())
    against = int(passes_through.sum() + ends_before.sum() + (ends_on & ~agrees).sum()) + num_beside
    num_beams = int(agrees.sum())
    return Verdict(num_beams / max(num_beams + against, 1), num_beams / max(int(hits.sum()), 1), num_beams)


def verify_by_distance(
    model: ObjectModel,
    pose: Pose,
    points: Float[np.ndarray, "M 3"],
    is_background: Bool[np.ndarray, " M"],
    tolerance: float,
    spacing: float,
) -> Verdict:
    """Compare readings without viewpoints with an object: those on it agree, those within or beside it do not."""
    allowed = tolerance + _POSE_ERROR
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    away = model.measure_distances(local)
    agrees = away <= allowed
    against = int(((away > allowed) & (away <= MARGIN) & ~is_background).sum())
    num_beams = int(agrees.sum())
    covered = 0.0
    if num_beams:
        nearest, _ = cKDTree(local[agrees]).query(model.points)
        covered = float(np.mean(nearest <= max(2 * spacing, allowed)))
    return Verdict(num_beams / max(num_beams + against, 1), covered, num_beams)
