"""Let units grow anew where a map is contradicted, between the others, which stand still, and join them by faces."""

import numpy as np
from scipy.spatial import cKDTree

from reconstruction.geometry.boxes import find_near_box
from reconstruction.geometry.orientation import find_components
from reconstruction.geometry.rows import any_corner
from reconstruction.networks.gsrm.hole_patching import MAX_HOLE_EDGES, find_loops
from reconstruction.networks.gsrm.local_fit import fit_turning
from reconstruction.networks.gsrm.local_topology import is_sound, join_locally

REACH = 2.0
"""Samples and units nearer to a new unit than this, in mean edges, take part in what happens there."""
COVER = 0.75
"""A sample farther than this from all units, in mean edges, gets a unit of its own."""
SETTLE_PASSES = 3
SAMPLES_PER_UNIT = 8
"""So many samples of each new unit take part in settling."""
TOPOLOGY_SAMPLES = 26
"""So many samples of each unit that is joined anew are witnesses of its faces."""
CLOSEST = 0.5
"""Of two new units nearer to one another than this, in mean edges, one goes."""
MAX_REPEATS = 2
"""So often units grow anew where they have left a hole."""
LEAST_ISLAND = 24
"""New faces that no kept unit has a part in are a surface of their own if they are so many."""
JOINT_RINGS = 2
"""So many rings of units round the new ones take part in learning the faces."""


def regrow(
    units: np.ndarray,
    faces: np.ndarray,
    is_refuted: np.ndarray,
    samples: np.ndarray,
    is_open: np.ndarray,
    edge: float,
    is_fitted: bool,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray, int]:
    """Return the units without the refuted ones and with new ones behind, the faces of all, and how many stayed.

    Args:
        units: `[U, 3]`.
        faces: `[F, 3]`.
        is_refuted: `[U]` units that go.
        samples: `[N, 3]` about what changed.
        is_open: `[N]` those that new units are to cover.
        edge: mean edge length of the map.
        is_fitted: whether new units are fitted to the samples.
        rng: draws where new units start.
    """
    kept = units[~is_refuted]
    place = np.where(is_refuted, -1, np.cumsum(~is_refuted) - 1)
    kept_faces = place[faces[~any_corner(is_refuted, faces)]]
    beside = place[widen(faces, is_refuted, 1) & ~is_refuted]
    merged, joined = _fill(samples, is_open, kept, kept_faces, beside, edge, rng)
    for _ in range(MAX_REPEATS):
        # Where a gap is left among samples, units that start elsewhere may close it.
        num_gaps = _count_gaps(merged, joined, len(kept), samples, edge)
        if num_gaps == 0:
            break
        other, other_joined = _fill(samples, is_open, kept, kept_faces, beside, edge, rng)
        if _count_gaps(other, other_joined, len(kept), samples, edge) < num_gaps:
            merged, joined = other, other_joined
    joined = drop_islands(joined, len(merged), len(kept))
    if is_fitted:
        merged, joined = _fit_new(merged, joined, len(kept), samples)
    return merged, joined, len(kept)


def _count_gaps(units: np.ndarray, faces: np.ndarray, num_kept: int, samples: np.ndarray, edge: float) -> int:
    """Return how many holes at new units have samples in their middle."""
    loops = [
        loop
        for loop in find_loops(faces, len(units))
        if len(loop) <= MAX_HOLE_EDGES and max(loop) >= num_kept
    ]
    if not loops:
        return 0
    middles = np.array([units[loop].mean(axis=0) for loop in loops])
    return int((cKDTree(samples).query(middles)[0] < CLOSEST * edge).sum())


def drop_islands(faces: np.ndarray, num_units: int, num_kept: int) -> np.ndarray:
    """Return the faces without parts of a few faces that hang together with no kept unit."""
    if len(faces) == 0:
        return faces
    part = find_components(faces, num_units)
    is_island = np.bincount(part, (faces < num_kept).any(axis=1)) == 0
    return faces[~(is_island & (np.bincount(part) < LEAST_ISLAND))[part]]


def _fill(
    samples: np.ndarray,
    is_open: np.ndarray,
    kept: np.ndarray,
    kept_faces: np.ndarray,
    beside: np.ndarray,
    edge: float,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the kept units with new ones, and the faces of all.

    Args:
        samples: `[N, 3]` about what changed.
        is_open: `[N]` those that new units are to cover.
        kept: `[K, 3]` units that stay.
        kept_faces: `[F, 3]` faces that stay.
        beside: `[B]` kept units that have lost a face.
        edge: mean edge length of the map.
        rng: draws where new units start.
    """
    units = np.concatenate([kept, _grow_between(samples, is_open, kept, edge, rng)])
    is_cut = np.zeros(len(units), dtype=bool)
    is_cut[beside] = True
    is_cut[len(kept) :] = True
    witnesses = samples[rng.permutation(len(samples))[: TOPOLOGY_SAMPLES * int(is_cut.sum())]]
    faces = join_locally(units, kept_faces, len(kept), is_cut, witnesses, edge, REACH, JOINT_RINGS)
    return units, close_triangles(faces, len(units), len(kept))


def close_triangles(faces: np.ndarray, num_units: int, num_kept: int) -> np.ndarray:
    """Return the faces with one in every loop of three edges at a new unit: no hole is as small as that.

    Where such a loop lies against the surface, the new unit stands beyond its neighbours, and unfolding the face
    draws it back.
    """
    loops = [loop for loop in find_loops(faces, num_units) if len(loop) == 3 and max(loop) >= num_kept]
    around = faces[np.isin(faces, loops).sum(axis=1) == 3] if loops else faces[:0]
    taken = {frozenset(face) for face in around.tolist()}
    closed = [loop for loop in loops if frozenset(loop) not in taken]
    return np.concatenate([faces, np.array(closed, dtype=faces.dtype)]) if closed else faces


def widen(faces: np.ndarray, is_chosen: np.ndarray, rings: int) -> np.ndarray:
    """Return the chosen units and so many rings of neighbours: `[U]`."""
    is_chosen = is_chosen.copy()
    for _ in range(rings):
        is_chosen[faces[any_corner(is_chosen, faces)]] = True
    return is_chosen


def _grow_between(
    samples: np.ndarray, is_open: np.ndarray, kept: np.ndarray, edge: float, rng: np.random.Generator
) -> np.ndarray:
    """Return `[G, 3]` new units that cover the open samples as densely as the map covers the rest.

    Wherever a sample is far from all units it becomes one: the error is largest there. Then the new units settle
    by the batch rule among the kept ones, which do not move.
    """
    if not is_open.any():
        return np.empty((0, 3))
    fixed = kept[find_near_box(kept, samples, REACH * edge)]
    candidates = samples[is_open]
    if len(fixed):
        candidates = candidates[cKDTree(fixed).query(candidates)[0] > COVER * edge]
    seeds = candidates[_scatter(candidates, COVER * edge, rng)]
    if len(seeds) == 0:
        return seeds
    tree = cKDTree(seeds)
    if len(fixed):
        fixed = fixed[np.isfinite(tree.query(fixed, distance_upper_bound=REACH * edge)[0])]
    samples = samples[rng.permutation(len(samples))[: SAMPLES_PER_UNIT * (len(seeds) + len(fixed))]]
    samples = samples[np.isfinite(tree.query(samples, distance_upper_bound=1.5 * edge)[0])]
    for _ in range(SETTLE_PASSES):
        winners = np.asarray(cKDTree(np.concatenate([fixed, seeds])).query(samples)[1]) - len(fixed)
        is_won = winners >= 0
        counts = np.bincount(winners[is_won], minlength=len(seeds))
        sums = [np.bincount(winners[is_won], samples[is_won, k], minlength=len(seeds)) for k in range(3)]
        seeds = (np.stack(sums, axis=1) / np.maximum(counts, 1)[:, None])[counts > 0]
    everything = np.concatenate([fixed, seeds])
    crowded = cKDTree(everything).query_pairs(CLOSEST * edge, output_type="ndarray").max(axis=1, initial=-1)
    return np.delete(seeds, crowded[crowded >= len(fixed)] - len(fixed), axis=0)


def _scatter(samples: np.ndarray, distance: float, rng: np.random.Generator) -> np.ndarray:
    """Choose samples so that none is nearer to another than a distance, and all others are: indices."""
    if len(samples) == 0:
        return np.empty(0, dtype=np.int64)
    tree = cKDTree(samples, balanced_tree=False)
    is_left = np.ones(len(samples), dtype=bool)
    chosen = []
    for place in rng.permutation(len(samples)).tolist():
        if is_left[place]:
            chosen.append(place)
            is_left[tree.query_ball_point(samples[place], distance)] = False
    return np.array(chosen)


def _fit_new(
    units: np.ndarray, faces: np.ndarray, num_kept: int, samples: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the units with the new ones fitted to the samples, and the faces with edges turned between them.

    The kept units stay where they are.
    """
    is_new = np.arange(len(units)) >= num_kept
    is_own = any_corner(is_new, faces)
    is_near = any_corner(widen(faces, is_new, 1), faces)
    if not is_own.any() or len(samples) == 0:
        return units, faces
    used, flat = np.unique(faces[is_near], return_inverse=True)
    near, is_movable = flat.reshape(-1, 3), is_new[used]
    is_won = np.zeros(len(used), dtype=bool)
    is_won[near[is_own[is_near]]] = True
    winners = np.asarray(cKDTree(units[used]).query(samples)[1])
    samples, winners = samples[is_won[winners]], winners[is_won[winners]]
    part, near = fit_turning(units[used], near, is_movable, is_own[is_near], samples, winners)
    turned, moved = faces.copy(), units.copy()
    turned[is_near], moved[used] = used[near], part
    return moved, turned if is_sound(turned, is_new) else faces
