"""Whether a scan agrees with an object at a pose: beams end on it, and none passes through it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction._src.objects.model import ObjectModel, ObjectsConfig
from reconstruction._src.scans.cloud import Cloud

_CHUNK = 2_000_000  # Pairs of a beam and a face that are treated at once
_PARALLEL = 1e-12


class Beams(NamedTuple):
    """Beams near a place."""

    rows: Int[np.ndarray, " B"]  # which readings
    origins: Float[np.ndarray, "B 3"]  # positions of the sensor [m]
    directions: Float[np.ndarray, "B 3"]  # unit vectors
    ranges: Float[np.ndarray, " B"]  # [m]

    def near(self, center: Float[np.ndarray, " 3"], radius: float, most: int | None = None) -> Beams:
        """Return those whose lines pass a ball [m]; with more than `most` every second, third, ... of them."""
        offset = center - self.origins
        along = (offset * self.directions).sum(axis=1)
        chosen = np.flatnonzero((offset * offset).sum(axis=1) - along**2 <= radius**2)
        if most is not None and len(chosen) > most:
            chosen = chosen[:: -(-len(chosen) // most)]
        return Beams(*(each[chosen] for each in self))


class BeamIndex:
    """The beams of a cloud, by viewpoint, so that those that pass a place are found quickly."""

    def __init__(self, cloud: Cloud) -> None:
        assert cloud.viewpoints is not None
        assert cloud.seen_from is not None
        self._order = np.argsort(cloud.seen_from, kind="stable")
        self._bounds = np.searchsorted(cloud.seen_from[self._order], np.arange(len(cloud.viewpoints) + 1))
        self._viewpoints = cloud.viewpoints
        offset = (cloud.points - cloud.viewpoints[cloud.seen_from])[self._order]
        self._ranges = np.maximum(np.sqrt(np.einsum("ij,ij->i", offset, offset)), 1e-9)
        self._directions = offset / self._ranges[:, None]

    def find(self, center: Float[np.ndarray, " 3"], radius: float) -> Beams:
        """Return the beams whose lines pass a ball ahead of the sensor [m]."""
        parts, origins = [], []
        for number, viewpoint in enumerate(self._viewpoints):
            first, last = self._bounds[number], self._bounds[number + 1]
            away = center - viewpoint
            distance = float(np.linalg.norm(away))
            if last == first or distance <= radius:
                continue
            cosine = np.sqrt(1 - (radius / distance) ** 2)
            rows = first + np.flatnonzero(self._directions[first:last] @ (away / distance) >= cosine)
            rows = rows[self._ranges[rows] > 0.5 * (distance - radius)]
            parts.append(rows)
            origins.append(np.broadcast_to(viewpoint, (len(rows), 3)))
        rows = np.concatenate(parts) if parts else np.zeros(0, np.int64)
        return Beams(
            self._order[rows],
            np.concatenate(origins) if origins else np.zeros((0, 3)),
            self._directions[rows],
            self._ranges[rows],
        )


def cast(
    model: ObjectModel, pose: Float[np.ndarray, "4 4"], beams: Beams
) -> tuple[Float[np.ndarray, " B"], Float[np.ndarray, " B"]]:
    """Return where beams would first meet an object [m], infinite where they miss it, and the cosine of incidence.

    References:
        Möller, Trumbore (1997): Fast, minimum storage ray-triangle intersection.
    """
    origins = (beams.origins - pose[:3, 3]) @ pose[:3, :3]
    directions = beams.directions @ pose[:3, :3]
    a, b, c = (model.vertices[model.faces[:, k]] for k in range(3))
    first, second = b - a, c - a
    hit, cosine = np.full(len(directions), np.inf), np.ones(len(directions))
    size = max(1, _CHUNK // max(len(model.faces), 1))
    for start in range(0, len(directions), size):
        part = slice(start, start + size)
        distance = _meet(origins[part], directions[part], a, first, second)
        face = distance.argmin(axis=1)
        hit[part] = distance[np.arange(len(face)), face]
        cosine[part] = np.abs((directions[part] * model.normals[face]).sum(axis=1))
    return hit, cosine


def _meet(
    origins: np.ndarray, directions: np.ndarray, a: np.ndarray, first: np.ndarray, second: np.ndarray
) -> np.ndarray:
    """Return the distance of every face along every beam `[B, F]` [m], infinite where it is missed.

    All products of the formula are scalar triple products, so that they are matrix products here.
    """
    normal = np.cross(first, second)
    facing = directions @ normal.T
    across = np.cross(origins, directions)
    # (o - a) . (d x e) = e . (o x d) + d . (a x e): the moment o x d of the line (Plücker), once for all faces.
    u = -(across @ second.T + directions @ np.cross(a, second).T)
    v = across @ first.T + directions @ np.cross(a, first).T
    t = (a * normal).sum(axis=1) - origins @ normal.T
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(np.abs(facing) > _PARALLEL, 1 / facing, 0.0)
        u, v, t = u * inverse, v * inverse, t * inverse
    inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (inverse != 0)
    return np.where(inside, t, np.inf)


MARGIN = 0.03
"""Readings nearer to the object than this that it does not explain speak against it [m]: it would be a part of
something larger."""
_POSE_ERROR = 0.003
"""What a fitted pose may be off along a normal [m]; at a grazing angle it shows the more in the range."""
_MIN_COSINE = 0.25
"""Beams that meet the surface at a smaller cosine are treated as if they met it at this one."""

_PART = 0.25  # Deviations are averaged over parts of the object of this share of its radius


class Verdict(NamedTuple):
    """What the scan says about an object at a pose."""

    score: float  # share of the beams that agree, of those that say something
    coverage: float  # share of the beams at the object that end on it; what stands before it hides the others
    num_beams: int  # beams that end on it
    error: float  # standard deviation of their ranges from the object [m]


def find_reach(model: ObjectModel) -> float:
    """Return the radius of the ball about an object in which readings matter [m]."""
    return model.radius + MARGIN


def verify_by_beams(
    model: ObjectModel,
    pose: Float[np.ndarray, "4 4"],
    beams: Beams,
    is_background: Bool[np.ndarray, " B"],
    noise: float,
    config: ObjectsConfig,
) -> Verdict:
    """Compare the beams that pass an object with the ranges that it would give.

    Four kinds of beams count: those that end on it, that pass through it, that end shortly before it (it would lie
    inside something), and that end beside it on something that is neither the object nor a large plane. What ends
    farther before it hides it, and says nothing.
    """
    expected, cosine = cast(model, pose, beams)
    hits = np.isfinite(expected)
    off = np.where(hits, beams.ranges - np.where(hits, expected, 0.0), 0.0)
    allowed = config.tolerance * noise + _POSE_ERROR / np.maximum(cosine, _MIN_COSINE)
    slack = _POSE_ERROR / np.maximum(cosine, _MIN_COSINE)
    mean, count = _average(model, pose, beams, expected, off, hits & (np.abs(off) <= allowed))
    agrees = (
        hits & (np.abs(off) <= allowed) & (np.abs(mean) <= config.tolerance * noise / np.sqrt(count) + slack)
    )
    through = hits & (off > allowed)
    before = hits & (off < -allowed) & (off > -model.radius)
    ends = beams.origins + beams.directions * beams.ranges[:, None]
    beside = _find_beside(model, pose, ends, ~hits & ~is_background, config.tolerance * noise + _POSE_ERROR)
    against = int(through.sum() + before.sum() + beside.sum())
    against += int((hits & (np.abs(off) <= allowed) & ~agrees).sum())
    num_beams = int(agrees.sum())
    return Verdict(
        num_beams / max(num_beams + against, 1),
        num_beams / max(int(hits.sum()), 1),
        num_beams,
        float(np.std(off[agrees])) if num_beams else float("inf"),
    )


def verify_by_distance(
    model: ObjectModel,
    pose: Float[np.ndarray, "4 4"],
    points: Float[np.ndarray, "M 3"],
    is_background: Bool[np.ndarray, " M"],
    noise: float,
    spacing: float,
    config: ObjectsConfig,
) -> Verdict:
    """Compare readings without viewpoints with an object: those on it agree, those within or beside it do not."""
    from scipy.spatial import cKDTree

    allowed = config.tolerance * noise + _POSE_ERROR
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    away = _compute_distances(model, local)
    agrees = away <= allowed
    against = int(((away > allowed) & (away <= MARGIN) & ~is_background).sum())
    num_beams = int(agrees.sum())
    covered = 0.0
    if num_beams:
        nearest, _ = cKDTree(local[agrees]).query(model.points)
        covered = float(np.mean(nearest <= max(2 * spacing, allowed)))
    error = float(np.sqrt(np.mean(away[agrees] ** 2))) if num_beams else float("inf")
    return Verdict(num_beams / max(num_beams + against, 1), covered, num_beams, error)


def _average(
    model: ObjectModel,
    pose: np.ndarray,
    beams: Beams,
    expected: np.ndarray,
    off: np.ndarray,
    used: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return for each beam the mean of the deviations of those that meet the same part of the object [m], and their
    number: the noise of a mean is smaller, so that it shows another shape."""
    mean, count = np.zeros(len(off)), np.ones(len(off))
    rows = np.flatnonzero(used)
    if len(rows):
        ends = beams.origins[rows] + beams.directions[rows] * expected[rows, None]
        local = (ends - pose[:3, 3]) @ pose[:3, :3] - model.center
        cell = np.floor(local / (_PART * model.radius)).astype(np.int64)
        cell -= cell.min(axis=0)
        shape = cell.max(axis=0) + 1
        key = (cell[:, 0] * shape[1] + cell[:, 1]) * shape[2] + cell[:, 2]
        _, part, size = np.unique(key, return_inverse=True, return_counts=True)
        mean[rows] = (np.bincount(part, off[rows]) / size)[part]
        count[rows] = size[part]
    return mean, count


def _find_beside(
    model: ObjectModel, pose: np.ndarray, ends: np.ndarray, is_asked: np.ndarray, allowed: float
) -> np.ndarray:
    """Return which ends are near the object, and farther from it than is allowed [m]."""
    local = (ends - pose[:3, 3]) @ pose[:3, :3]
    rows = np.flatnonzero(is_asked & (np.linalg.norm(local - model.center, axis=1) < find_reach(model)))
    beside = np.zeros(len(ends), dtype=bool)
    if len(rows):
        away = _compute_distances(model, local[rows])
        beside[rows] = (away > allowed) & (away <= MARGIN)
    return beside


def _compute_distances(model: ObjectModel, points: np.ndarray) -> np.ndarray:
    import igl

    found = igl.point_mesh_squared_distance(np.ascontiguousarray(points), model.vertices, model.faces)
    return np.sqrt(np.asarray(found[0]))
