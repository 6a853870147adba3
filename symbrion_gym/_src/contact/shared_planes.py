"""One plane for regions that lie apart on the same plane: the floor on both sides of a bump, steps of one height.

Fitted alone, each region is tilted by the noise of its own few faces, and solids beneath them meet in steps and bends
that the ground does not have. Fitted together, they share one plane, known better over the longer distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float

from symbrion_gym._src.contact.moments import find_moments, fit_planes, measure_deviations, weigh_faces
from symbrion_gym._src.contact.planes import Planes


@dataclass(frozen=True)
class SharingConfig:
    """Which regions share a plane.

    Attributes:
        shift: the common plane lies off that of each region by no more than this share of the tolerance
            (root-mean-square over the region): less than a body feels.
        border_weight: faces at the border of a region count this much: they may lie on a chamfer.
    """

    shift: float = 0.3
    border_weight: float = 0.02


SHARING_DEFAULTS = SharingConfig()


def share_planes(
    mesh: trimesh.Trimesh, planes: Planes, tolerance: float, config: SharingConfig = SHARING_DEFAULTS
) -> Planes:
    """Return planes with equal normals and offsets where one plane serves several regions; labels stay.

    The closest two groups of regions are joined first, while the common plane serves all regions of both.
    """
    if not len(planes.normals):
        return planes
    origin = np.asarray(mesh.triangles_center).mean(axis=0)
    sums = _sum_regions(mesh, planes, origin, config)
    _, _, own = fit_planes(sums)
    groups: dict[int, list[int]] = {k: [k] for k in range(len(sums))}
    shifts = {
        (i, j): _measure_shift(sums, own, planes.normals, [i, j]) for i in groups for j in groups if i < j
    }
    while shifts:
        i, j = min(shifts, key=lambda pair: shifts[pair])
        if shifts[i, j] > config.shift * tolerance:
            break
        groups[i] += groups.pop(j)
        shifts = {pair: shift for pair, shift in shifts.items() if j not in pair}
        for k in groups:
            if k != i:
                pair = (min(i, k), max(i, k))
                shifts[pair] = _measure_shift(sums, own, planes.normals, groups[i] + groups[k])
    normals, offsets = planes.normals.copy(), planes.offsets.copy()
    for members in groups.values():
        if len(members) > 1:
            normal, offset = _fit(sums, planes.normals, members)
            normals[members], offsets[members] = normal, offset + normal @ origin
    return planes._replace(normals=normals, offsets=offsets)


def _sum_regions(
    mesh: trimesh.Trimesh, planes: Planes, origin: Float[np.ndarray, " 3"], config: SharingConfig
) -> Float[np.ndarray, "R 4 4"]:
    pairs = np.asarray(mesh.face_adjacency).reshape(-1, 2)
    weights = weigh_faces(planes.labels, pairs, config.border_weight)
    sums = np.zeros((len(planes.normals), 4, 4))
    np.add.at(sums, np.maximum(planes.labels, 0), find_moments(mesh, origin) * weights[:, None, None])
    return sums


def _fit(
    sums: Float[np.ndarray, "R 4 4"], normals: Float[np.ndarray, "R 3"], members: list[int]
) -> tuple[Float[np.ndarray, " 3"], float]:
    """Return the common plane of some regions, on the side of the largest."""
    normal, offset, _ = fit_planes(sums[members].sum(axis=0))
    largest = members[int(np.argmax(sums[members, 3, 3]))]
    sign = 1.0 if normal @ normals[largest] > 0 else -1.0
    return sign * normal, sign * float(offset)


def _measure_shift(
    sums: Float[np.ndarray, "R 4 4"],
    own: Float[np.ndarray, " R"],
    normals: Float[np.ndarray, "R 3"],
    members: list[int],
) -> float:
    """Return how far the common plane lies off the worst region's own [m]; inf where a region faces the other way."""
    normal, offset = _fit(sums, normals, members)
    if (normals[members] @ normal).min() <= 0:
        return float("inf")
    square = measure_deviations(sums[members], normal, offset) ** 2 - own[members] ** 2
    return float(np.sqrt(max(square.max(), 0.0)))
