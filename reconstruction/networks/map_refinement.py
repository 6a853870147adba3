"""Let a grown map learn on: what new readings contradict moves, grows or goes, the rest stays put.

Only the units whose readings are contradicted are grown anew, between the others, which stand still; faces are
learnt and fitted there alone. So the cost is that of the change, and what did not change stays bit for bit.
"""

import numpy as np
from scipy.spatial import cKDTree

from reconstruction.networks.boxes import find_near_box
from reconstruction.networks.evidence import MIN_READINGS, Evidence, weigh_evidence
from reconstruction.networks.local_fit import fit_part
from reconstruction.networks.local_topology import is_sound, join_locally
from reconstruction.surfaces.edge_flips import turn_edges
from reconstruction.surfaces.hole_patching import find_loops, find_vertex_normals
from reconstruction.surfaces.manifold import group_sides
from reconstruction.surfaces.surface_fit import mean_edge_length
from reconstruction.surfaces.unfolding import unfold_faces

REACH = 2.0
"""Samples and units nearer to a new unit than this, in mean edges, take part in what happens there."""
COVER = 0.75
"""A sample farther than this from all units, in mean edges, gets a unit of its own."""
SETTLE_PASSES = 4
FIT_SAMPLES = 32
"""So many samples of each new unit take part in the fit."""
SAMPLES_PER_UNIT = 12
"""So many samples of each new unit take part in settling."""
TOPOLOGY_SAMPLES = 30
"""So many samples of each unit that is joined anew are witnesses of its faces."""
CLOSEST = 0.5
"""Of two new units nearer to one another than this, in mean edges, one goes."""
STEEPNESS = 0.5
"""Readings beyond the rim that rise by less than this (sine against the surface) extend it."""
STRONG = 1.5
"""Where no few readings disagree by more than this many tolerances, the tail of the noise has spoken."""
MAX_STRONG = 2048
"""Of strong disagreements not more than this are looked at."""
STRONG_RINGS = 2
"""So many rings of units round a strong disagreement are believed with it."""
FEWEST_CONFIRMATIONS = 4.0
"""Readings a unit wins on average, for their absence to mean something."""
ITERATIONS = (2, 1)
"""Steps of the fit, before edges are turned along the creases that have come out, and after."""
MAX_REPEATS = 2
"""So often units grow anew where they have left a hole."""
JOINT_RINGS = 2
"""So many rings of units round the new ones take part in learning the faces."""


def refine_map(
    units: np.ndarray,
    faces: np.ndarray,
    old_points: np.ndarray,
    new_points: np.ndarray,
    is_fitted: bool,
    rng: np.random.Generator,
    origins: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return units, faces and points after new readings.

    Args:
        units: `[U, 3]` [m], each with a face.
        faces: `[F, 3]`.
        old_points: `[N, 3]` what the map has learnt from.
        new_points: `[M, 3]` what was read since.
        is_fitted: whether new units are fitted to the points.
        rng: draws where new units start.
        origins: `[M, 3]` where the new readings were made from, if that is known.
    """
    faces = faces.astype(np.int64)
    edge = mean_edge_length(units, faces)
    evidence = weigh_evidence(units, faces, old_points, new_points, edge, origins)
    is_doubtful = _find_doubtful(len(units), faces, new_points, evidence, edge)
    if not is_doubtful.any():
        return units, faces, np.concatenate([old_points, new_points])
    distant = evidence.distance > evidence.tolerance
    is_refuted = is_doubtful & ~_find_extended(units, faces, evidence.winners[distant], new_points[distant])
    inside = find_near_box(old_points, units[is_doubtful], 1.5 * edge)
    about = old_points[inside]
    winners = np.asarray(cKDTree(units).query(about)[1])
    is_true = ~is_refuted[winners]
    is_outside = np.ones(len(old_points), dtype=bool)
    is_outside[inside] = False
    outside = old_points.take(np.flatnonzero(is_outside), axis=0)
    points = np.concatenate([outside, about[is_true], new_points])
    about = np.concatenate([about[is_true], new_points])
    winners = np.concatenate([winners[is_true], evidence.winners])
    kept = units[~is_refuted]
    is_near = widen(faces, is_doubtful, 1)[winners]
    about, winners = about[is_near], winners[is_near]
    place = np.where(is_refuted, -1, np.cumsum(~is_refuted) - 1)
    kept_faces = place[faces[~is_refuted[faces].any(axis=1)]]
    beside = place[widen(faces, is_refuted, 1) & ~is_refuted]
    merged, joined = _fill(about, is_doubtful[winners], kept, kept_faces, beside, edge, rng)
    num_loops = len(find_loops(faces, len(units)))
    for _ in range(MAX_REPEATS):
        # Where a hole is left, units that start elsewhere may close it.
        num_found = len(find_loops(joined, len(merged)))
        if num_found <= num_loops or len(merged) == len(kept):
            break
        other, other_joined = _fill(about, is_doubtful[winners], kept, kept_faces, beside, edge, rng)
        if len(find_loops(other_joined, len(other))) < num_found:
            merged, joined = other, other_joined
    if is_fitted:
        merged, joined = _fit_new(merged, joined, len(kept), about)
    used, flat = np.unique(joined, return_inverse=True)
    return merged[used], flat.reshape(-1, 3), points


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
        is_chosen[faces[is_chosen[faces].any(axis=1)]] = True
    return is_chosen


def _find_doubtful(
    num_units: int, faces: np.ndarray, new_points: np.ndarray, evidence: Evidence, edge: float
) -> np.ndarray:
    """Return the units that have moved or are gone: `[U]`."""
    is_strong = np.zeros(num_units, dtype=bool)
    far = np.flatnonzero(evidence.distance > STRONG * evidence.tolerance)
    if len(far) >= MIN_READINGS:
        tree = cKDTree(new_points[far], balanced_tree=False)
        far = far[:: -(-len(far) // MAX_STRONG)]
        crowd, _ = tree.query(new_points[far], k=MIN_READINGS)
        is_strong[evidence.winners[far[crowd[:, -1] < 3 * edge]]] = True
    is_moved, is_gone = evidence.is_moved & widen(faces, is_strong, STRONG_RINGS), evidence.is_gone
    if is_gone.any():
        agreeing = evidence.winners[evidence.distance <= evidence.tolerance]
        confirmations = np.bincount(agreeing, minlength=num_units)
        is_gone = _spread_gone(faces, is_gone, confirmations, evidence.is_read)
    return is_moved | is_gone


def _spread_gone(
    faces: np.ndarray, is_gone: np.ndarray, confirmations: np.ndarray, is_read: np.ndarray
) -> np.ndarray:
    """Return the gone units with those beside them that new readings pass close by but never confirm: `[U]`.

    Where readings are so few that a unit may miss its own by chance, nothing is added.
    """
    has_any = confirmations > 0
    if not has_any.any() or confirmations[has_any].mean() < FEWEST_CONFIRMATIONS:
        return is_gone
    unconfirmed = is_read & ~has_any
    while True:
        wider = is_gone | widen(faces, is_gone, 1) & unconfirmed
        if (wider == is_gone).all():
            return is_gone
        is_gone = wider


def _find_extended(
    units: np.ndarray, faces: np.ndarray, winner: np.ndarray, distant: np.ndarray
) -> np.ndarray:
    """Return the units `[U]` at the rim beyond which the surface goes on: old readings stay true there."""
    if len(distant) == 0:
        return np.zeros(len(units), dtype=bool)
    sides = group_sides(faces, len(units))
    slots = sides.slots[sides.starts[sides.counts == 1]]
    is_rim = np.zeros(len(units), dtype=bool)
    is_rim[faces.ravel()[slots]] = True
    normals = find_vertex_normals(units, faces)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    offset = distant - units[winner]
    rise = np.abs((offset * normals[winner]).sum(axis=1)) / np.maximum(np.linalg.norm(offset, axis=1), 1e-300)
    count = np.bincount(winner, minlength=len(units))
    flat = np.bincount(winner, rise < STEEPNESS, minlength=len(units))
    return is_rim & (flat > count / 2)


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
    is_own = np.asarray(is_new[faces].any(axis=1))
    is_near = widen(faces, is_new, 1)[faces].any(axis=1)
    if not is_own.any() or len(samples) == 0:
        return units, faces
    used, flat = np.unique(faces[is_near], return_inverse=True)
    near, is_movable = flat.reshape(-1, 3), is_new[used]
    is_inner = is_own[is_near]
    part = units[used]
    winners = np.asarray(cKDTree(part).query(samples)[1])
    is_won = np.zeros(len(part), dtype=bool)
    is_won[near[is_inner]] = True
    chosen = np.flatnonzero(is_won[winners])
    chosen = chosen[:: max(1, len(chosen) // (FIT_SAMPLES * int(is_movable.sum())))]
    samples, winners = samples[chosen], winners[chosen]
    part = fit_part(part, near, is_movable, samples, winners, ITERATIONS[0])
    near[is_inner] = turn_edges(part, near[is_inner])
    part = fit_part(part, near, is_movable, samples, winners, ITERATIONS[1])
    part = np.where(is_movable[:, None], unfold_faces(part, near), part)
    turned = faces.copy()
    turned[is_near] = used[near]
    moved = units.copy()
    moved[used] = part
    return moved, turned if is_sound(turned, is_new) else faces
