"""Planes in a noisy triangle mesh: what a decomposition is given decides how accurate it gets.

Regions grow from the flattest places, then faces between two regions move to the plane that fits them better.
Every fit is a sum of face moments, so that noise averages out over a whole region.

References:
    Schnabel, Wahl, Klein (2007), Efficient RANSAC for point-cloud shape detection, section 4: the consensus
    of a candidate plane is its connected part within a distance and an angle.
    Cohen-Steiner, Alliez, Desbrun (2004), Variational shape approximation, section 3: moments of triangles.
Differs: candidates are the flattest places in order, not random samples, so equal meshes give equal planes.
"""

from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int
from scipy.sparse import csr_matrix

from symbrion_gym._src.errors import ArenaError

Offsets = Float[np.ndarray, " R"]  # Of planes [m]

Direction = Float[np.ndarray, " 3"]  # A unit vector
Normals = Float[np.ndarray, "R 3"]  # Unit normals of planes

_LEAST_MASS = 1e-300  # Keeps divisions by the area of no faces finite
_MAX_ANGLE_DEG = 40.0
"""Largest angle between a face and the plane it belongs to; noise turns small faces this far."""
_RINGS = 3  # Neighbors over which the noise at a face is averaged, in steps over edges
_NOISE_REACH = 3.0  # Faces within this many standard deviations of the noise may be on a plane
_MAX_PLANES = 400  # No more are looked for; a mesh with more is rough ground, for which planes are no model
_MIN_FACES = 6.0  # A plane has the area of this many median faces, within `min_area` and `max_min_area`
_MIN_AREA = 1e-3  # Share of the whole area that a plane has at least
_MAX_MIN_AREA = 0.03  # Share of the whole area that always suffices for a plane
_MAX_ROUNDS = 12  # Of growing one region, and of moving faces between regions; both end by themselves earlier
_NEIGHBOR_COST = 0.25
"""What a neighbor on another plane costs a face, in squared reaches: keeps borders short."""
_TILT_COST = 2.0  # What a face costs that is turned by more than the largest angle, likewise
_MAX_DISTANCE_COST = 4.0  # What a distance costs at most, likewise: one bad face does not decide
_NO_PLANE_COST = 1.5  # What a face without a plane costs, likewise
_BORDER_WEIGHT = 0.02  # Faces at the border of a region count this much: they may lie on a chamfer
_MERGE_DEVIATION = 0.3  # Two planes are one if its deviation stays below this share of the tolerance
_MERGE_NOISE = 0.5  # ... or below this share of the noise.
_MERGE_COSINE = 0.98  # ... and the joint plane is turned against both by less than the angle of this cosine.
_CHAMFER_ANGLE_DEG = 20.0
"""A narrow strip that bends from its neighbors by more is an edge cut off, not a plane."""
_CHAMFER_WIDTH = 1.5  # Such a strip is narrower than this many median edges
_SHIFT = 0.3
"""The common plane lies off that of each region by no more than this share of the tolerance (root-mean-square
over the region): less than a body feels."""

Labels = Int[np.ndarray, " F"]  # The plane of each face, -1 for none


class Planes(NamedTuple):
    """The planes of a mesh and whose faces they are."""

    normals: Normals  # unit normals, to the outside
    offsets: Offsets  # normal · point on the plane [m]
    labels: Labels  # the plane of each face, -1 for none
    noise: float  # standard deviation of the mesh around its planes [m]


def find_planes(mesh: trimesh.Trimesh, tolerance: float) -> Planes:
    """Find the planes that a mesh is made of."""
    surface = _FaceSurface(mesh)
    roughness, smooth_normals, smooth_offsets = surface.smooth()
    noise = float(np.median(roughness))
    reach = max(tolerance, _NOISE_REACH * noise)
    total, median = float(surface.areas.sum()), float(np.median(surface.areas))
    min_area = min(max(_MIN_FACES * median, _MIN_AREA * total), _MAX_MIN_AREA * total)
    labels = np.full(len(surface.areas), -1)
    is_seed = np.ones(len(labels), dtype=bool)
    count = 0
    for seed in np.argsort(roughness, kind="stable"):
        if not is_seed[seed] or count >= _MAX_PLANES:
            continue
        members = surface.grow(seed, smooth_normals[seed], float(smooth_offsets[seed]), labels < 0, reach)
        is_seed[[seed, *members]] = False
        if surface.areas[members].sum() >= min_area:
            labels[members] = count
            count += 1
    if count:
        labels = surface.relabel(labels, count, reach)
        labels = surface.merge(labels, reach / _NOISE_REACH, tolerance)
        labels = surface.drop_chamfers(labels, float(np.median(mesh.edges_unique_length)))
    kept, labels = np.unique(np.append(labels, -1), return_inverse=True)
    labels, count = labels[:-1] - 1, len(kept) - 1
    normals, offsets = surface.fit_regions(labels, count)
    return Planes(normals, offsets + normals @ surface.origin, labels, noise)


def _compute_moments(mesh: trimesh.Trimesh, origin: Direction) -> Float[np.ndarray, "F 4 4"]:
    """Return the integral of h hᵀ over every face, h = (x - origin, 1)."""
    corners = np.asarray(mesh.triangles, dtype=np.float64) - origin
    homogeneous = np.concatenate([corners, np.ones((*corners.shape[:2], 1))], axis=2)
    total = homogeneous.sum(axis=1)
    # Over a triangle of area A it is A/12 (sum of h hᵀ over the corners + s sᵀ), s the sum of their h.
    moments = np.einsum("fki,fkj->fij", homogeneous, homogeneous) + total[:, :, None] * total[:, None, :]
    return moments * (np.asarray(mesh.area_faces, dtype=np.float64)[:, None, None] / 12.0)


def _fit_moments(
    moments: Float[np.ndarray, "*N 4 4"],
) -> tuple[Float[np.ndarray, "*N 3"], Float[np.ndarray, " *N"], Float[np.ndarray, " *N"]]:
    """Return least-squares planes of moments: normals of either sign, offsets and standard deviations [m]."""
    mass = np.maximum(moments[..., 3, 3], _LEAST_MASS)
    center = moments[..., :3, 3] / mass[..., None]
    spread = moments[..., :3, :3] / mass[..., None, None] - center[..., :, None] * center[..., None, :]
    values, vectors = np.linalg.eigh(spread)
    normal = vectors[..., 0]
    offset = np.asarray(np.sum(normal * center, axis=-1))
    return normal, offset, np.asarray(np.sqrt(np.maximum(values[..., 0], 0.0)))


def _measure_deviations(
    moments: Float[np.ndarray, "N 4 4"], normal: Direction, offset: float
) -> Float[np.ndarray, " N"]:
    """Return root-mean-square distances of moments from one plane [m]."""
    plane = np.append(normal, -offset)
    square = np.einsum("nij,i,j->n", moments, plane, plane)
    return np.sqrt(np.maximum(square, 0.0) / np.maximum(moments[:, 3, 3], _LEAST_MASS))


def _sum_regions(
    labels: Labels, pairs: Int[np.ndarray, "P 2"], values: Float[np.ndarray, "F ..."], count: int
) -> Float[np.ndarray, "R ..."]:
    """Return the sum of values over each region; faces at its border count little, those of no region not at all."""
    weights = np.where(labels >= 0, 1.0, 0.0)
    is_border = labels[pairs[:, 0]] != labels[pairs[:, 1]]
    weights[pairs[is_border]] *= _BORDER_WEIGHT
    sums = np.zeros((count, *values.shape[1:]))
    np.add.at(sums, labels[labels >= 0], (values.T * weights).T[labels >= 0])
    return sums


class _FaceSurface:
    """The faces of a mesh with their moments and neighbors."""

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        self._min_cosine = np.cos(np.radians(_MAX_ANGLE_DEG))
        self.areas = np.asarray(mesh.area_faces, dtype=np.float64)
        if not self.areas.sum() > 0:
            raise ArenaError("the mesh has no face with an area")
        self.normals = np.asarray(mesh.face_normals, dtype=np.float64)
        self.origin = np.asarray(mesh.triangles_center).mean(axis=0)
        self.moments = _compute_moments(mesh, self.origin)
        self.pairs = np.asarray(mesh.face_adjacency).reshape(-1, 2)
        rows, columns = np.concatenate([self.pairs, self.pairs[:, ::-1]]).T
        count = len(self.areas)
        self.adjacency = csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(count, count))
        degrees = np.diff(self.adjacency.indptr)
        self._neighbors = np.full((count, degrees.max(initial=3)), -1)  # -1 where there are fewer
        is_used = np.arange(self._neighbors.shape[1]) < degrees[:, None]
        self._neighbors[is_used] = self.adjacency.indices

    def smooth(self) -> tuple[Float[np.ndarray, " F"], Float[np.ndarray, "F 3"], Float[np.ndarray, " F"]]:
        """Return roughness [m], normals and offsets of planes fitted to each face and the rings around it."""
        moments = self.moments.reshape(-1, 16)
        normals = self.normals * self.areas[:, None]
        for _ in range(_RINGS):
            moments = moments + self.adjacency @ moments
            normals = normals + self.adjacency @ normals
        planes, offsets, deviation = _fit_moments(moments.reshape(-1, 4, 4))
        flip = np.where(np.einsum("fi,fi->f", planes, normals) < 0, -1.0, 1.0)
        return deviation, planes * flip[:, None], offsets * flip

    def fit_faces(self, members: Int[np.ndarray, " M"]) -> tuple[Direction, float]:
        """Return the plane of some faces: its normal, on their side, and its offset [m]."""
        normal, offset, _ = _fit_moments(self.moments[members].sum(axis=0))
        if normal @ (self.normals[members] * self.areas[members, None]).sum(axis=0) < 0:
            normal, offset = -normal, -offset
        return normal, float(offset)

    def grow(
        self, seed: int, normal: Direction, offset: float, is_free: Bool[np.ndarray, " F"], reach: float
    ) -> Int[np.ndarray, " M"]:
        """Return the free faces that lie on one plane and are connected with the seed."""
        members, slot = np.array([seed]), np.empty(len(self.areas), dtype=np.int64)
        for _ in range(_MAX_ROUNDS):
            is_open = np.append(is_free & (self.normals @ normal > self._min_cosine), False)
            is_open[seed] = False
            rings = [np.array([seed])]
            while len(rings[-1]):  # what is farther away is not even measured
                near = self._neighbors[rings[-1]].ravel()
                near = near[is_open[near]]
                slot[near] = np.arange(len(near))
                near = near[slot[near] == np.arange(len(near))]  # each once
                is_open[near] = False
                rings.append(near[_measure_deviations(self.moments[near], normal, offset) < reach])
            found = np.sort(np.concatenate(rings))
            if np.array_equal(found, members):
                break
            members = found
            normal, offset = self.fit_faces(members)
        return members

    def relabel(self, labels: Labels, count: int, reach: float) -> Labels:
        """Let each face move to the plane of a neighbor that fits it better (iterated conditional modes)."""
        rows = np.arange(len(labels))
        faces = np.column_stack([rows, self._neighbors[:, :3]])
        for _ in range(_MAX_ROUNDS):
            candidate = np.where(faces >= 0, labels[faces], -1)
            cost = self._cost(*self.fit_regions(labels, count), candidate, reach)
            # Potts: every neighbor of another plane costs as much as half the reach (0.25 of its square).
            differs = (candidate[:, :, None] != candidate[:, None, 1:]) & (faces[:, None, 1:] >= 0)
            moved = candidate[rows, np.argmin(cost + _NEIGHBOR_COST * differs.sum(axis=2), axis=1)]
            if np.array_equal(moved, labels):
                break
            labels = moved
        return labels

    def _cost(
        self, normals: Normals, offsets: Offsets, candidate: Int[np.ndarray, "F K"], reach: float
    ) -> Float[np.ndarray, "F K"]:
        """Return what it costs each face to be on each candidate plane (-1: on none)."""
        homogeneous = np.concatenate([normals, -offsets[:, None]], axis=1)[candidate]
        square = np.einsum("fij,fki,fkj->fk", self.moments, homogeneous, homogeneous)
        square = np.maximum(square, 0.0) / np.maximum(self.areas, _LEAST_MASS)[:, None]
        tilt = 1.0 - np.einsum("fki,fi->fk", normals[candidate], self.normals)
        cost = np.minimum(square / reach**2, _MAX_DISTANCE_COST) + tilt
        cost = cost + _TILT_COST * (tilt > 1.0 - self._min_cosine)
        return np.where(candidate < 0, _NO_PLANE_COST, cost)

    def fit_regions(
        self, labels: Labels, count: int
    ) -> tuple[Float[np.ndarray, "count 3"], Float[np.ndarray, " count"]]:
        """Return normals and offsets of the planes of regions; faces at the border of a region count little."""
        sums = _sum_regions(labels, self.pairs, self.moments, count)
        facing = _sum_regions(labels, self.pairs, self.normals * self.areas[:, None], count)
        normals, offsets, _ = _fit_moments(sums)
        flip = np.where(np.einsum("ri,ri->r", normals, facing) < 0, -1.0, 1.0)
        return normals * flip[:, None], offsets * flip

    def merge(self, labels: Labels, noise: float, tolerance: float) -> Labels:
        """Join neighboring regions that one plane fits as well."""
        count = int(labels.max()) + 1
        sums = np.zeros((count, 4, 4))
        np.add.at(sums, labels[labels >= 0], self.moments[labels >= 0])
        contacts = self._find_contacts(labels)
        into, close = np.arange(count), _MERGE_DEVIATION
        while len(contacts):
            normals, _, deviations = _fit_moments(sums)
            first, second = contacts.T
            joint, _, deviation = _fit_moments(sums[first] + sums[second])
            apart = np.maximum(deviations[first], deviations[second])
            limit = np.maximum(np.hypot(apart, close * tolerance), _MERGE_NOISE * noise)
            tilts = [np.abs(np.einsum("ci,ci->c", joint, normals[side])) for side in (first, second)]
            ratio = np.where(np.minimum(*tilts) > _MERGE_COSINE, deviation / limit, np.inf)
            best = int(np.argmin(ratio))
            if ratio[best] >= 1.0:
                break
            kept, gone = contacts[best]
            sums[kept] += sums[gone]
            into[into == gone] = kept
            contacts = np.sort(np.where(contacts == gone, kept, contacts), axis=1)
            contacts = np.unique(contacts[contacts[:, 0] != contacts[:, 1]], axis=0)
        return np.where(labels >= 0, into[labels], -1)

    def drop_chamfers(self, labels: Labels, edge_length: float) -> Labels:
        """Drop regions a triangle wide that bend sharply from what is around: edges that the mesh cut off."""
        kept = labels.copy()
        width = _CHAMFER_WIDTH * edge_length
        min_cosine = np.cos(np.radians(_CHAMFER_ANGLE_DEG))
        sides = labels[self.pairs]
        for region in np.unique(labels[labels >= 0]):
            members = np.flatnonzero(labels == region)
            spread = self.moments[members].sum(axis=0)
            center = spread[:3, 3] / spread[3, 3]
            values = np.linalg.eigvalsh(spread[:3, :3] / spread[3, 3] - np.outer(center, center))
            # The variance of a strip is its width squared / 12.
            if np.sqrt(12.0 * max(values[1], 0.0)) > width:
                continue
            is_rim = (sides == region).sum(axis=1) == 1
            if is_rim.any():
                tilt = np.einsum("pi,pi->p", *(self.normals[self.pairs[is_rim, i]] for i in range(2)))
                if np.median(tilt) < min_cosine:
                    kept[members] = -1
        return kept

    def _find_contacts(self, labels: Labels) -> Int[np.ndarray, "C 2"]:
        """Return the pairs of regions that touch."""
        pairs = labels[self.pairs]
        pairs = pairs[(pairs[:, 0] != pairs[:, 1]) & (pairs.min(axis=1) >= 0)]
        return np.unique(np.sort(pairs, axis=1), axis=0)


def share_planes(mesh: trimesh.Trimesh, planes: Planes, tolerance: float) -> Planes:
    """Return planes with equal normals and offsets where one plane serves several regions; labels stay.

    The closest two groups of regions are joined first, while the common plane serves all regions of both.
    """
    origin = np.asarray(mesh.triangles_center).mean(axis=0)
    pairs = np.asarray(mesh.face_adjacency).reshape(-1, 2)
    sums = _sum_regions(planes.labels, pairs, _compute_moments(mesh, origin), len(planes.normals))
    _, _, own = _fit_moments(sums)
    groups: dict[int, list[int]] = {k: [k] for k in range(len(sums))}
    shifts = {
        (i, j): _measure_shift(sums, own, planes.normals, [i, j]) for i in groups for j in groups if i < j
    }
    while shifts:
        i, j = min(shifts, key=lambda pair: shifts[pair])
        if shifts[i, j] > _SHIFT * tolerance:
            break
        groups[i] += groups.pop(j)
        shifts = {pair: shift for pair, shift in shifts.items() if j not in pair}
        for k in groups.keys() - {i}:
            pair = (min(i, k), max(i, k))
            shifts[pair] = _measure_shift(sums, own, planes.normals, groups[i] + groups[k])
    normals, offsets = planes.normals.copy(), planes.offsets.copy()
    for members in groups.values():
        if len(members) > 1:
            normal, offset = _fit(sums, planes.normals, members)
            normals[members], offsets[members] = normal, offset + normal @ origin
    return planes._replace(normals=normals, offsets=offsets)


def _fit(sums: Float[np.ndarray, "R 4 4"], normals: Normals, members: list[int]) -> tuple[Direction, float]:
    """Return the common plane of some regions, on the side of the largest."""
    normal, offset, _ = _fit_moments(sums[members].sum(axis=0))
    largest = members[int(np.argmax(sums[members, 3, 3]))]
    sign = 1.0 if normal @ normals[largest] > 0 else -1.0
    return sign * normal, sign * float(offset)


def _measure_shift(
    sums: Float[np.ndarray, "R 4 4"], own: Offsets, normals: Normals, members: list[int]
) -> float:
    """Return how far the common plane lies off the worst region's own [m]; inf where a region faces the other way."""
    normal, offset = _fit(sums, normals, members)
    if (normals[members] @ normal).min() <= 0:
        return float("inf")
    square = _measure_deviations(sums[members], normal, offset) ** 2 - own[members] ** 2
    return float(np.sqrt(max(square.max(), 0.0)))
