"""Learn faces in a part of a map and put them between those of the rest."""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.geometry.boxes import find_near_box
from reconstruction._src.geometry.manifold import find_hinges, find_minor_fans, group_sides
from reconstruction._src.geometry.rows import all_corners, any_corner
from reconstruction._src.networks.change.neighborhoods import widen
from reconstruction._src.networks.gsrm.refinement_config import RegrowthConfig
from reconstruction._src.networks.gsrm.support import Support
from reconstruction._src.networks.gsrm.topology import finish_faces, lies_on_full, propose_faces
from reconstruction._src.networks.gsrm.topology_config import TopologyConfig

_NUM_PROBES = 128
"""Places at which the spacing of the samples is measured: it varies little within a part."""
_NUM_NEAR = 10
"""Neighbors in the ball that measures the spacing: as in `som.density`."""


def join_locally(
    units: Float[np.ndarray, "U 3"],
    kept_faces: Int[np.ndarray, "K 3"],
    num_kept: int,
    is_cut: Bool[np.ndarray, " U"],
    samples: Float[np.ndarray, "N 3"],
    edge: float,
    regrowth: RegrowthConfig,
    topology: TopologyConfig,
) -> Int[np.ndarray, "F 3"]:
    """Return the kept faces and those between the cut units as one surface.

    Args:
        units: positions, kept and new.
        kept_faces: unit indices of the faces that stay.
        num_kept: the first units are kept, the others are new.
        is_cut: the new units, and those that have lost a face.
        samples: all samples near them.
        edge: mean edge length of the map.
        regrowth: which kept units take part.
        topology: how faces are learned.
    """
    if not is_cut.any() or len(samples) < regrowth.min_samples:
        return kept_faces
    is_near = _find_near_cut(units, kept_faces, is_cut, edge, regrowth)
    part = np.flatnonzero(is_near)
    is_inside = all_corners(is_near, kept_faces)
    place = np.full(len(units), -1)
    place[part] = np.arange(len(part))
    inside = place[kept_faces[is_inside]]
    support = make_local_support(samples, topology)
    winners = np.asarray(cKDTree(units[part]).query(samples, k=3)[1])
    proposed, margin = propose_faces(units[part], winners, support)
    is_new = any_corner(part >= num_kept, proposed) & ~lies_on_full(proposed, inside, len(part))
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


def _find_near_cut(
    units: Float[np.ndarray, "U 3"],
    kept_faces: Int[np.ndarray, "K 3"],
    is_cut: Bool[np.ndarray, " U"],
    edge: float,
    regrowth: RegrowthConfig,
) -> Bool[np.ndarray, " U"]:
    """Return the cut units, those around them, and those near them."""
    is_near = widen(kept_faces, is_cut, regrowth.joint_rings)
    in_box = find_near_box(units, units[is_cut], regrowth.reach * edge)
    in_box = in_box[~is_near[in_box]]
    if len(in_box) == 0:
        return is_near
    distance, _ = cKDTree(units[is_cut]).query(units[in_box], distance_upper_bound=regrowth.reach * edge)
    is_near[in_box[np.isfinite(distance)]] = True
    # A unit that gets a new face takes part with all the faces it has, or it could be pinched unnoticed.
    return widen(kept_faces, is_near, 1)


def make_local_support(samples: Float[np.ndarray, "N 3"], config: TopologyConfig) -> Support:
    """Prepare samples for queries whether they support a face."""
    tree = cKDTree(samples, balanced_tree=False)
    near = min(_NUM_NEAR, len(samples) - 1)
    probes = samples[:: max(1, len(samples) // _NUM_PROBES)]
    spacings = tree.query(probes, k=near + 1)[0][:, -1] * np.sqrt(np.pi / near)
    return Support(tree, spacings[cKDTree(probes).query(samples)[1]], config)


def is_sound(faces: Int[np.ndarray, "F 3"], is_suspect: Bool[np.ndarray, " U"]) -> bool:
    """Return whether no directed side is used twice and no suspected vertex has more than one fan."""
    num_units = len(is_suspect)
    tail, head = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    there = np.sort(tail * num_units + head)
    if (there[1:] == there[:-1]).any():
        return False
    near = faces[any_corner(is_suspect, faces)]
    hinges = find_hinges(near, group_sides(near, num_units))
    return len(find_minor_fans(near, hinges, np.ones(len(near)), is_suspect)) == 0


def _is_used(faces: Int[np.ndarray, "F 3"], num_units: int) -> Bool[np.ndarray, " U"]:
    is_used = np.zeros(num_units, dtype=bool)
    is_used[faces] = True
    return is_used


def _is_among(
    faces: Int[np.ndarray, "F 3"], others: Int[np.ndarray, "G 3"], num_units: int
) -> Bool[np.ndarray, " F"]:
    """Return which faces have the same three corners as one of the others."""
    keys, other_keys = (
        np.sort(part, axis=1) @ np.array([num_units**2, num_units, 1]) if len(part) else np.empty(0, int)
        for part in (faces, others)
    )
    return np.isin(keys, other_keys)
