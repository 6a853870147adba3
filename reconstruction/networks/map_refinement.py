"""Let a grown map learn on: what new readings contradict moves, grows or goes, the rest stays put."""

import numpy as np
from scipy.spatial import cKDTree

from reconstruction.networks.density import Density
from reconstruction.networks.evidence import MIN_READINGS, find_read, weigh_evidence
from reconstruction.networks.growth import SPLIT_RADIUS, grow, make_level
from reconstruction.networks.padding import padded_length
from reconstruction.networks.support import Support
from reconstruction.networks.winners import make_tiles
from reconstruction.surfaces.hole_patching import find_vertex_normals
from reconstruction.surfaces.manifold import group_sides
from reconstruction.surfaces.surface_fit import fit_surface, mean_edge_length
from reconstruction.surfaces.topology import finish_faces, propose_faces

RINGS = 2
"""So many rings of units round a contradicted one learn anew with it."""
WIDEST_CELL = 0.5
"""Cells are halved above this root mean square radius, in mean edges; regular ones have 0.37."""
CLOSEST = 0.5
"""Of two new units nearer to one another than this, in mean edges, one goes: both came from what is gone."""
STEEPNESS = 0.5
"""Readings beyond the rim that rise by less than this (sine against the surface) extend it."""
FEWEST = 16
"""Fewer samples than this carry no part of a surface."""
STRONG = 1.5
"""Where no few readings disagree by more than this many tolerances, the tail of the noise has spoken."""
FEWEST_CONFIRMATIONS = 4.0
"""Readings a unit wins on average, for their absence to mean something."""
NUM_PROBES = 256
"""At so many places the spacing of the samples is measured."""


def refine_map(
    units: np.ndarray,
    faces: np.ndarray,
    old_points: np.ndarray,
    new_points: np.ndarray,
    is_fitted: bool,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return units, faces and points after new readings.

    Args:
        units: `[U, 3]` [m], each with a face.
        faces: `[F, 3]`.
        old_points: `[N, 3]` what the map has learnt from.
        new_points: `[M, 3]` what was read since.
        is_fitted: whether new units are fitted to the points.
        rng: draws the samples of the rounds.
    """
    edge = mean_edge_length(units, faces)
    evidence = weigh_evidence(units, faces, old_points, new_points, edge)
    tree = cKDTree(units)
    new_winners = tree.query(new_points)[1]
    is_strong = np.zeros(len(units), dtype=bool)
    far = np.flatnonzero(evidence.distance > STRONG * evidence.tolerance)
    if len(far) >= MIN_READINGS:
        crowd, _ = cKDTree(new_points[far]).query(new_points[far], k=MIN_READINGS)
        is_strong[new_winners[far[crowd[:, -1] < 3 * edge]]] = True
    is_moved, is_gone = evidence.is_moved & _widen(faces, is_strong, RINGS), evidence.is_gone
    if not (is_moved | is_gone).any():
        return units, faces, np.concatenate([old_points, new_points])
    if is_gone.any():
        confirmations = np.bincount(
            new_winners[evidence.distance <= evidence.tolerance], minlength=len(units)
        )
        is_gone = _spread_gone(faces, is_gone, confirmations, find_read(units, new_points, edge))
    is_doubtful = is_moved | is_gone
    distant = new_points[evidence.distance > evidence.tolerance]
    is_refuted = is_doubtful & ~_find_extended(units, faces, tree, distant)
    is_active = _widen(faces, is_doubtful, RINGS)
    is_near = _widen(faces, is_active, RINGS)
    is_about = _is_about(old_points, units[is_near], edge)
    about, winners = old_points[is_about], tree.query(old_points[is_about])[1]
    is_true = ~is_refuted[winners]
    points = np.concatenate([old_points[~is_about], about[is_true], new_points])
    about = np.concatenate([about[is_true], new_points])
    winners = np.concatenate([winners[is_true], new_winners])
    grown = _grow_locally(about[is_active[winners]], units[is_active & ~is_refuted], edge, rng)
    num_kept = len(units) - int(is_active.sum())
    merged = np.concatenate([units[~is_active], grown])
    crowded = cKDTree(merged).query_pairs(CLOSEST * edge, output_type="ndarray").max(axis=1, initial=-1)
    merged = np.delete(merged, crowded[crowded >= num_kept], axis=0)
    place = np.cumsum(~is_active) - 1
    kept_faces = place[faces[~is_active[faces].any(axis=1)]]
    near = about[is_near[winners]]
    joined = _join(merged, num_kept, kept_faces, near)
    if is_fitted:
        merged = _fit_locally(merged, joined, num_kept, near)
    used, flat = np.unique(joined, return_inverse=True)
    return merged[used], flat.reshape(-1, 3), points


def _spread_gone(
    faces: np.ndarray, is_gone: np.ndarray, confirmations: np.ndarray, is_read: np.ndarray
) -> np.ndarray:
    """Return the gone units with those beside them that new readings pass close by but never confirm: `[U]`.

    Where readings are so few that a unit may miss its own by chance, nothing is added.
    """
    has_any = confirmations > 0
    if confirmations[has_any].mean() < FEWEST_CONFIRMATIONS:
        return is_gone
    unconfirmed = is_read & ~has_any
    while True:
        wider = is_gone | _widen(faces, is_gone, 1) & unconfirmed
        if (wider == is_gone).all():
            return is_gone
        is_gone = wider


def _is_about(points: np.ndarray, units: np.ndarray, edge: float) -> np.ndarray:
    """Return which points may be won by some of the units: those in their box, `[N]`."""
    low, high = units.min(axis=0) - 2 * edge, units.max(axis=0) + 2 * edge
    return (points >= low).all(axis=1) & (points <= high).all(axis=1)


def _find_extended(units: np.ndarray, faces: np.ndarray, tree: cKDTree, distant: np.ndarray) -> np.ndarray:
    """Return the units `[U]` at the rim beyond which the surface goes on: old readings stay true there."""
    if len(distant) == 0:
        return np.zeros(len(units), dtype=bool)
    sides = group_sides(faces, len(units))
    slots = sides.slots[sides.starts[sides.counts == 1]]
    is_rim = np.zeros(len(units), dtype=bool)
    is_rim[faces.ravel()[slots]] = True
    normals = find_vertex_normals(units, faces)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    winner = tree.query(distant)[1]
    offset = distant - units[winner]
    rise = np.abs((offset * normals[winner]).sum(axis=1)) / np.maximum(np.linalg.norm(offset, axis=1), 1e-300)
    count = np.bincount(winner, minlength=len(units))
    flat = np.bincount(winner, rise < STEEPNESS, minlength=len(units))
    return is_rim & (flat > count / 2)


def _widen(faces: np.ndarray, is_chosen: np.ndarray, rings: int) -> np.ndarray:
    """Return the chosen units and so many rings of neighbours: `[U]`."""
    is_chosen = is_chosen.copy()
    for _ in range(rings):
        is_chosen[faces[is_chosen[faces].any(axis=1)]] = True
    return is_chosen


def _grow_locally(points: np.ndarray, start: np.ndarray, edge: float, rng: np.random.Generator) -> np.ndarray:
    """Return `[G, 3]` units that cover the points as densely as the map covers the rest."""
    if len(points) < FEWEST:
        return np.empty((0, 3))
    center = points.mean(axis=0)
    missing = padded_length(len(points), 1024) - len(points)
    drawn = np.concatenate([np.arange(len(points)), rng.integers(len(points), size=missing)])
    samples = ((points[drawn] - center) / edge).astype(np.float32)
    density = Density(np.full(len(samples), WIDEST_CELL / SPLIT_RADIUS), np.ones(len(samples)))
    if len(start) < 3:
        start = np.concatenate([start, points[rng.choice(len(points), 3, replace=False)]])
    grown = grow(
        make_level(make_tiles(samples), density),
        ((start - center) / edge).astype(np.float32),
        max(len(start), len(points) // 4),
        growth=1.5,
        samples_per_unit=8,
        settle_passes=3,
        rng=rng,
    )
    return grown.astype(np.float64) * edge + center


def _join(units: np.ndarray, num_kept: int, kept_faces: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the kept faces and those at new units as one surface."""
    if num_kept == len(units) or len(points) < FEWEST:
        return kept_faces
    winners = cKDTree(units).query(points, k=3)[1]
    tree = cKDTree(points)
    near = min(10, len(points) - 1)
    probes = points[:: max(1, len(points) // NUM_PROBES)]
    spacings = tree.query(probes, k=near + 1)[0][:, -1] * np.sqrt(np.pi / near)
    support = Support(tree, spacings[cKDTree(probes).query(points)[1]])
    proposed, margin = propose_faces(units, winners, support)
    is_new = (proposed >= num_kept).any(axis=1)
    faces = np.concatenate([kept_faces, proposed[is_new]])
    quality = np.concatenate([np.full(len(kept_faces), np.inf), margin[is_new]])
    return finish_faces(units, faces, quality, support)


def _fit_locally(units: np.ndarray, faces: np.ndarray, num_kept: int, points: np.ndarray) -> np.ndarray:
    """Return the units with the new ones fitted to the points; the kept ones stay where they are."""
    near = faces[_widen(faces, np.arange(len(units)) >= num_kept, 1)[faces].any(axis=1)]
    if len(near) == 0 or len(points) == 0:
        return units
    used, flat = np.unique(near, return_inverse=True)
    fitted = fit_surface(units[used], flat.reshape(-1, 3), points)
    moved = units.copy()
    moved[used] = fitted
    moved[:num_kept] = units[:num_kept]
    return moved
