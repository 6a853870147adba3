"""Planes in a noisy triangle mesh: what a decomposition is given decides how accurate it gets.

Regions grow from the flattest places, then faces between two regions move to the plane that fits them better.
Every fit is a sum of face moments, so that noise averages out over a whole region.

References:
    Schnabel, Wahl, Klein (2007), Efficient RANSAC for point-cloud shape detection, section 4: the consensus
    of a candidate plane is its connected part within a distance and an angle.
    Cohen-Steiner, Alliez, Desbrun (2004), Variational shape approximation, section 3: moments of triangles.
Differs: candidates are the flattest places in order, not random samples, so equal meshes give equal planes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import trimesh
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from symbrion_gym.errors import ArenaError

_MAX_ANGLE_DEG = 40.0
"""Largest angle between a face and the plane it belongs to."""
_CHAMFER_ANGLE_DEG = 20.0
"""A narrow strip that bends from its neighbours by more is an edge cut off, not a plane."""
_MAX_PLANES = 400
"""No mesh that is worth a decomposition has more."""


class Planes(NamedTuple):
    """The planes of a mesh and whose faces they are.

    Attributes:
        normals: `[R, 3]` unit normals, to the outside.
        offsets: `[R]` normal · point on the plane [m].
        labels: `[F]` the plane of each face, -1 for none.
        noise: standard deviation of the mesh around its planes [m].
    """

    normals: np.ndarray
    offsets: np.ndarray
    labels: np.ndarray
    noise: float

    def distances(self, points: np.ndarray) -> np.ndarray:
        """Return how far each point `[N, 3]` lies in front of each plane [m], `[N, R]`."""
        return points @ self.normals.T - self.offsets

    def slopes(self) -> np.ndarray:
        """Return the planes as z = a x + b y + c, `[R, 3]`; walls as the steepest that this allows."""
        rise = np.maximum(self.normals[:, 2], 0.05)
        return np.column_stack([-self.normals[:, :2] / rise[:, None], self.offsets / rise])


def find_planes(
    mesh: trimesh.Trimesh,
    tolerance: float,
    min_area: float | None = None,
    is_late: Callable[[], bool] = lambda: False,
) -> Planes:
    """Find the planes that a mesh is made of.

    Args:
        mesh: consistently wound.
        tolerance: faces this close to a plane may be on it [m]; widened to three times the noise.
        min_area: smallest area of a plane [m²]; unless given, six median faces within 0.1 to 3 % of the whole.
        is_late: asked now and then; once true, no more planes are looked for.

    Raises:
        ArenaError: the mesh has no face with an area.
    """
    surface = _FaceSurface(mesh)
    roughness, smooth_normals, smooth_offsets = surface.smooth(rings=3)
    noise = float(np.median(roughness))
    reach = max(tolerance, 3.0 * noise)
    if min_area is None:
        total = float(surface.areas.sum())
        min_area = min(max(6.0 * float(np.median(surface.areas)), 1e-3 * total), 0.03 * total)
    labels = np.full(len(surface.areas), -1)
    is_seed = np.ones(len(labels), dtype=bool)
    count = 0
    for seed in np.argsort(roughness, kind="stable"):
        if not is_seed[seed] or count >= _MAX_PLANES:
            continue
        if is_late():
            break
        members = surface.grow(seed, smooth_normals[seed], float(smooth_offsets[seed]), labels < 0, reach)
        is_seed[members] = False
        is_seed[seed] = False
        if surface.areas[members].sum() >= min_area:
            labels[members] = count
            count += 1
    if not count:
        return Planes(np.zeros((0, 3)), np.zeros(0), labels, noise)
    labels = surface.relabel(labels, count, reach)
    labels = surface.merge(labels, reach / 3.0, tolerance)
    labels = surface.drop_chamfers(labels, float(np.median(mesh.edges_unique_length)))
    labels = _number(labels)
    if labels.max() < 0:
        return Planes(np.zeros((0, 3)), np.zeros(0), labels, noise)
    normals, offsets = surface.fit_regions(labels, int(labels.max()) + 1)
    offsets = offsets + normals @ surface.origin
    return Planes(normals, offsets, labels, noise)


def _number(labels: np.ndarray) -> np.ndarray:
    """Labels 0, 1, 2 ... in place of any; -1 stays."""
    _, numbers = np.unique(np.append(labels, -1), return_inverse=True)
    return numbers[:-1] - 1


class _FaceSurface:
    """The faces of a mesh with their moments and neighbours."""

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        self.areas = np.asarray(mesh.area_faces, dtype=np.float64)
        if not self.areas.sum() > 0:
            raise ArenaError("the mesh has no face with an area")
        self.normals = np.asarray(mesh.face_normals, dtype=np.float64)
        self.origin = np.asarray(mesh.triangles_center).mean(axis=0)
        corners = np.asarray(mesh.triangles, dtype=np.float64) - self.origin
        homogeneous = np.concatenate([corners, np.ones((*corners.shape[:2], 1))], axis=2)
        total = homogeneous.sum(axis=1)
        # Integral of [x 1]ᵀ[x 1] over a triangle: A/12 (sum of h hᵀ + s sᵀ).
        self.moments = (
            np.einsum("fki,fkj->fij", homogeneous, homogeneous) + total[:, :, None] * total[:, None, :]
        )
        self.moments *= self.areas[:, None, None] / 12.0
        self.pairs = np.asarray(mesh.face_adjacency).reshape(-1, 2)
        rows, columns = np.concatenate([self.pairs, self.pairs[:, ::-1]]).T
        count = len(self.areas)
        self.adjacency = csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(count, count))

    def smooth(self, rings: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Roughness `[F]` [m], normals and offsets of planes fitted to each face and the rings around it."""
        moments = self.moments.reshape(-1, 16)
        normals = self.normals * self.areas[:, None]
        for _ in range(rings):
            moments = moments + self.adjacency @ moments
            normals = normals + self.adjacency @ normals
        planes, offsets, deviation = self.fit(moments.reshape(-1, 4, 4))
        flip = np.where(np.einsum("fi,fi->f", planes, normals) < 0, -1.0, 1.0)
        return deviation, planes * flip[:, None], offsets * flip

    def fit(self, moments: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Least-squares planes of moments `[..., 4, 4]`: normals, offsets and standard deviations [m]."""
        mass = np.maximum(moments[..., 3, 3], 1e-300)
        center = moments[..., :3, 3] / mass[..., None]
        spread = moments[..., :3, :3] / mass[..., None, None] - center[..., :, None] * center[..., None, :]
        values, vectors = np.linalg.eigh(spread)
        normal = vectors[..., 0]
        return normal, np.sum(normal * center, axis=-1), np.sqrt(np.maximum(values[..., 0], 0.0))

    def fit_faces(self, members: np.ndarray) -> tuple[np.ndarray, float, float]:
        """The plane of some faces, its normal on their side, and its standard deviation [m]."""
        normal, offset, deviation = self.fit(self.moments[members].sum(axis=0))
        if normal @ (self.normals[members] * self.areas[members, None]).sum(axis=0) < 0:
            normal, offset = -normal, -offset
        return normal, float(offset), float(deviation)

    def deviations(self, normal: np.ndarray, offset: float) -> np.ndarray:
        """Root-mean-square distance of every face from one plane [m]."""
        plane = np.append(normal, -offset)
        square = np.einsum("fij,i,j->f", self.moments, plane, plane)
        return np.sqrt(np.maximum(square, 0.0) / np.maximum(self.areas, 1e-300))

    def grow(
        self, seed: int, normal: np.ndarray, offset: float, is_free: np.ndarray, reach: float
    ) -> np.ndarray:
        """The free faces that lie on one plane and hang together with the seed."""
        members = np.array([seed])
        for _ in range(12):
            is_near = is_free & (self.deviations(normal, offset) < reach)
            is_near &= self.normals @ normal > np.cos(np.radians(_MAX_ANGLE_DEG))
            is_near[seed] = True
            found = self._find_part(is_near, seed)
            if np.array_equal(found, members):
                break
            members = found
            normal, offset, _ = self.fit_faces(members)
        return members

    def _find_part(self, is_member: np.ndarray, seed: int) -> np.ndarray:
        members = np.flatnonzero(is_member)
        _, part = connected_components(self.adjacency[members][:, members], directed=False)
        return members[part == part[np.searchsorted(members, seed)]]

    def relabel(self, labels: np.ndarray, count: int, reach: float, sweeps: int = 12) -> np.ndarray:
        """Let each face move to the plane of a neighbour that fits it better (iterated conditional modes)."""
        for _ in range(sweeps):
            planes = self.fit_regions(labels, count)
            candidates = np.concatenate([np.arange(len(labels))[:, None], self._neighbors()], axis=1)
            candidate = np.where(candidates >= 0, labels[candidates], -1)
            cost = self._cost(planes, candidate, reach)
            # Potts: every neighbour of another plane costs as much as half the reach.
            differs = (candidate[:, :, None] != candidate[:, None, 1:]) & (candidates[:, None, 1:] >= 0)
            cost += 0.25 * differs.sum(axis=2)
            best = np.argmin(cost, axis=1)
            moved = candidate[np.arange(len(labels)), best]
            if np.array_equal(moved, labels):
                break
            labels = moved
        return labels

    def _neighbors(self) -> np.ndarray:
        """`[F, 3]` neighbouring faces, -1 where there are fewer."""
        neighbors = np.full((len(self.areas), 3), -1)
        starts, ends = self.adjacency.indptr[:-1], self.adjacency.indptr[1:]
        for slot in range(3):
            has = ends - starts > slot
            neighbors[has, slot] = self.adjacency.indices[starts[has] + slot]
        return neighbors

    def _cost(self, planes: tuple[np.ndarray, np.ndarray], candidate: np.ndarray, reach: float) -> np.ndarray:
        normals, offsets = planes
        if not len(normals):
            return np.ones(candidate.shape)
        homogeneous = np.concatenate([normals, -offsets[:, None]], axis=1)[candidate]
        square = np.einsum("fij,fki,fkj->fk", self.moments, homogeneous, homogeneous)
        square = np.maximum(square, 0.0) / np.maximum(self.areas, 1e-300)[:, None]
        tilt = 1.0 - np.einsum("fki,fi->fk", normals[candidate], self.normals)
        is_too_steep = tilt > 1.0 - np.cos(np.radians(_MAX_ANGLE_DEG))
        cost = np.minimum(square / reach**2, 4.0) + tilt + 2.0 * is_too_steep
        return np.where(candidate < 0, 1.5, cost)

    def fit_regions(self, labels: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Normals `[R, 3]` and offsets `[R]`; faces at the border of a region count little."""
        is_inside = np.ones(len(labels), dtype=bool)
        is_border = labels[self.pairs[:, 0]] != labels[self.pairs[:, 1]]
        is_inside[self.pairs[is_border].ravel()] = False
        weight = np.where(is_inside, 1.0, 0.02) * (labels >= 0)
        sums = np.zeros((count, 4, 4))
        np.add.at(sums, np.maximum(labels, 0), self.moments * weight[:, None, None])
        facing = np.zeros((count, 3))
        np.add.at(facing, np.maximum(labels, 0), self.normals * (self.areas * weight)[:, None])
        normals, offsets, _ = self.fit(sums)
        flip = np.where(np.einsum("ri,ri->r", normals, facing) < 0, -1.0, 1.0)
        return normals * flip[:, None], offsets * flip

    def merge(self, labels: np.ndarray, noise: float, tolerance: float) -> np.ndarray:
        """Join neighbouring regions that one plane fits as well."""
        count = int(labels.max()) + 1
        sums = np.zeros((count, 4, 4))
        np.add.at(sums, labels[labels >= 0], self.moments[labels >= 0])
        contacts = self._find_contacts(labels)
        into = np.arange(count)
        while len(contacts):
            normals, _, deviations = self.fit(sums)
            first, second = contacts.T
            joint, _, deviation = self.fit(sums[first] + sums[second])
            apart = np.maximum(deviations[first], deviations[second])
            limit = np.maximum(np.hypot(apart, 0.3 * tolerance), 0.5 * noise)
            tilts = [np.abs(np.einsum("ci,ci->c", joint, normals[side])) for side in (first, second)]
            ratio = np.where(np.minimum(*tilts) > 0.98, deviation / limit, np.inf)
            best = int(np.argmin(ratio))
            if ratio[best] >= 1.0:
                break
            kept, gone = contacts[best]
            sums[kept] += sums[gone]
            into[into == gone] = kept
            contacts = np.sort(np.where(contacts == gone, kept, contacts), axis=1)
            contacts = np.unique(contacts[contacts[:, 0] != contacts[:, 1]], axis=0)
        return np.where(labels >= 0, into[labels], -1)

    def drop_chamfers(self, labels: np.ndarray, edge_length: float) -> np.ndarray:
        """Drop regions a triangle wide that bend sharply from what is around: edges that the mesh cut off."""
        kept = labels.copy()
        sides = np.where(labels >= 0, labels, -1)[self.pairs]
        for region in np.unique(labels[labels >= 0]):
            members = np.flatnonzero(labels == region)
            spread = self.moments[members].sum(axis=0)
            center = spread[:3, 3] / spread[3, 3]
            values = np.linalg.eigvalsh(spread[:3, :3] / spread[3, 3] - np.outer(center, center))
            if np.sqrt(12.0 * max(values[1], 0.0)) > 1.5 * edge_length:
                continue
            is_rim = (sides == region).sum(axis=1) == 1
            if is_rim.any():
                tilt = np.einsum("pi,pi->p", *(self.normals[self.pairs[is_rim, i]] for i in range(2)))
                if np.median(tilt) < np.cos(np.radians(_CHAMFER_ANGLE_DEG)):
                    kept[members] = -1
        return kept

    def _find_contacts(self, labels: np.ndarray) -> np.ndarray:
        pairs = labels[self.pairs]
        pairs = pairs[(pairs[:, 0] != pairs[:, 1]) & (pairs.min(axis=1) >= 0)]
        return np.unique(np.sort(pairs, axis=1), axis=0)
