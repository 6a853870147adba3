"""Beams that pass an object, and where they would end on it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from reconstruction._src.objects.model import ObjectModel
from reconstruction._src.scans.cloud import Cloud

_CHUNK = 2_000_000
"""Pairs of a beam and a face that are treated at once."""
_PARALLEL = 1e-12


class Beams(NamedTuple):
    """Beams near a place.

    Attributes:
        rows: which readings.
        origins: `[B, 3]` positions of the sensor [m].
        directions: `[B, 3]` unit vectors.
        ranges: `[B]` [m].
    """

    rows: Int[np.ndarray, " B"]
    origins: Float[np.ndarray, "B 3"]
    directions: Float[np.ndarray, "B 3"]
    ranges: Float[np.ndarray, " B"]

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
