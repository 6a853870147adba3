"""Learn faces in a part of a map and put them between those of the rest."""

import numpy as np
from scipy.spatial import cKDTree

from reconstruction.geometry.boxes import find_near_box
from reconstruction.geometry.manifold import find_hinges, find_minor_fans, group_sides
from reconstruction.geometry.rows import all_corners, any_corner
from reconstruction.networks.gsrm.support import Support
from reconstruction.networks.gsrm.topology import finish_faces, propose_faces

FEWEST = 16
"""Fewer samples than this carry no part of a surface."""
NUM_PROBES = 128
"""At so many places the spacing of the samples is measured."""
_NUM_NEIGHBORS = 10


def join_locally(
    units: np.ndarray,
    kept_faces: np.ndarray,
    num_kept: int,
    is_cut: np.ndarray,
    samples: np.ndarray,
    edge: float,
    reach: float,
    rings: int,
) -> np.ndarray:
    """Return the kept faces and those between the cut units as one surface.

    Args:
        units: `[U, 3]`, kept and new.
        kept_faces: `[F, 3]` the faces that stay.
        num_kept: so many units are kept, the others are new.
        is_cut: `[U]` the new units, and those that have lost a face.
        samples: `[N, 3]` all samples about them.
        edge: mean edge length of the map.
        reach: units nearer to cut ones than this, in mean edges, take part.
        rings: so many rings of kept units round the cut ones take part.
    """
    if not is_cut.any() or len(samples) < FEWEST:
        return kept_faces
    is_near = is_cut.copy()
    for _ in range(rings):
        is_near[kept_faces[any_corner(is_near, kept_faces)]] = True
    in_box = find_near_box(units, units[is_cut], reach * edge)
    in_box = in_box[~is_near[in_box]]
    if len(in_box):
        distance, _ = cKDTree(units[is_cut]).query(units[in_box], distance_upper_bound=reach * edge)
        is_near[in_box[np.isfinite(distance)]] = True
        # Whoever gets a new face takes part with all the faces it has, or it could be pinched unnoticed.
        is_near[kept_faces[any_corner(is_near, kept_faces)]] = True
    part = np.flatnonzero(is_near)
    is_inside = all_corners(is_near, kept_faces)
    place = np.full(len(units), -1)
    place[part] = np.arange(len(part))
    inside = place[kept_faces[is_inside]]
    support = make_local_support(samples)
    winners = np.asarray(cKDTree(units[part]).query(samples, k=3)[1])
    proposed, margin = propose_faces(units[part], winners, support)
    is_new = _find_fitting(proposed, inside, part >= num_kept)
    faces = np.concatenate([inside, proposed[is_new]])
    quality = np.concatenate([np.full(len(inside), np.inf), margin[is_new]])
    found = finish_faces(units[part], faces, quality, support)
    outside = kept_faces[~is_inside]
    is_border = _is_used(outside, len(units))[part]
    lost = inside[~_is_among(inside, found, len(part)) & any_corner(is_border, inside)]
    joined = np.concatenate([outside, part[found], part[lost]])
    if is_sound(joined, is_near):
        return joined
    faces = np.concatenate([kept_faces, part[proposed[is_new]]])
    return finish_faces(
        units, faces, np.concatenate([np.full(len(kept_faces), np.inf), margin[is_new]]), support
    )


def make_local_support(samples: np.ndarray) -> Support:
    """Make samples ready to be asked whether they carry a face."""
    tree = cKDTree(samples, balanced_tree=False)
    near = min(_NUM_NEIGHBORS, len(samples) - 1)
    probes = samples[:: max(1, len(samples) // NUM_PROBES)]
    spacings = tree.query(probes, k=near + 1)[0][:, -1] * np.sqrt(np.pi / near)
    return Support(tree, spacings[cKDTree(probes).query(samples)[1]])


def is_sound(faces: np.ndarray, is_suspect: np.ndarray) -> bool:
    """Tell whether no directed side is used twice and no suspected vertex `[U]` has more than one fan."""
    num_units = len(is_suspect)
    tail, head = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    there = np.sort(tail * num_units + head)
    if (there[1:] == there[:-1]).any():
        return False
    near = faces[any_corner(is_suspect, faces)]
    hinges = find_hinges(near, group_sides(near, num_units))
    return len(find_minor_fans(near, hinges, np.ones(len(near)), is_suspect)) == 0


def _find_fitting(proposed: np.ndarray, faces: np.ndarray, is_new: np.ndarray) -> np.ndarray:
    """Return which proposed faces have a new unit and no side that lies between two faces already: `[P]`."""
    number = len(is_new)
    sides = group_sides(faces, number)
    slots = sides.slots[sides.starts[sides.counts == 2]]
    ends = np.stack([faces.ravel()[slots], faces[slots // 3, (slots % 3 + 1) % 3]])
    full = ends.min(axis=0) * number + ends.max(axis=0)
    others = np.roll(proposed, -1, axis=1)
    wanted = np.minimum(proposed, others) * number + np.maximum(proposed, others)
    is_blocked = np.asarray(np.isin(wanted, full).any(axis=1))
    return any_corner(is_new, proposed) & ~is_blocked


def _is_used(faces: np.ndarray, num_units: int) -> np.ndarray:
    is_used = np.zeros(num_units, dtype=bool)
    is_used[faces] = True
    return is_used


def _is_among(faces: np.ndarray, others: np.ndarray, num_units: int) -> np.ndarray:
    """Return which faces have the same three corners as one of the others: `[F]`."""
    keys, other_keys = (
        np.sort(part, axis=1) @ np.array([num_units**2, num_units, 1]) if len(part) else np.empty(0, int)
        for part in (faces, others)
    )
    return np.isin(keys, other_keys)
