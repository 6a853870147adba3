"""Let a grown map learn on: what new readings contradict moves, grows or goes, the rest stays put.

Where readings have shifted by less than an edge, the units go along and keep their faces (`map_motion`). Where more
has changed, the contradicted units are grown anew between the others, which stand still (`map_regrowth`). So the
cost is that of the change, and what did not change stays bit for bit.
"""

import numpy as np
from scipy.spatial import cKDTree

from reconstruction.geometry.boxes import find_near_box
from reconstruction.geometry.manifold import group_sides
from reconstruction.geometry.rows import any_corner, find_lengths, sum_rows
from reconstruction.networks.change.detection import STRONG, STRONG_RINGS, Evidence, weigh_evidence
from reconstruction.networks.gsrm.hole_patching import find_vertex_normals
from reconstruction.networks.gsrm.motion import find_movable, move_units
from reconstruction.networks.gsrm.regrowth import regrow, widen
from reconstruction.networks.surface_fit import mean_edge_length
from reconstruction.surfaces.unfolding import unfold_faces

MARGIN = 1.5
"""Readings nearer to a contradicted unit than this, in mean edges, take part."""
UNIT_AREA = 0.7
"""Surface that a unit stands for, in squared mean edges."""
READINGS_PER_UNIT = 40
"""So many new readings for each unit suffice."""
STEEPNESS = 0.5
"""Readings beyond the rim that rise by less than this (sine against the surface) extend it."""
FEWEST_CONFIRMATIONS = 4.0
"""Readings a unit wins on average, for their absence to mean something."""


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
    distant = evidence.distance > evidence.tolerance
    readings = new_points[evidence.compared]
    is_doubtful = _find_doubtful(faces, evidence)
    if not is_doubtful.any():
        return units, faces, np.concatenate([old_points, new_points])
    is_refuted = is_doubtful & ~_find_extended(units, faces, evidence.winners[distant], readings[distant])
    about = find_near_box(old_points, units[is_doubtful], MARGIN * edge)
    against = readings[distant & is_doubtful[evidence.winners]]
    news = find_near_box(new_points, np.concatenate([units[is_doubtful], against]), MARGIN * edge)
    per_unit = evidence.density * UNIT_AREA * edge**2
    news = news[:: max(1, int(per_unit / READINGS_PER_UNIT))]
    samples = np.concatenate([old_points[about], new_points[news]])
    winners = np.asarray(cKDTree(units).query(samples)[1])
    is_stale = is_refuted[winners]
    is_stale[len(about) :] = False
    is_near = widen(faces, is_doubtful, 1)[winners] & ~is_stale
    is_beside = is_near[: len(about)]
    samples, winners = samples[is_near], winners[is_near]
    is_changed = find_movable(faces, is_doubtful, evidence, edge)
    if is_changed.any():
        units, faces, is_changed = move_units(units, faces, is_changed, samples[is_changed[winners]], edge)
    is_open = is_doubtful & ~is_changed
    if is_open.any():
        is_out = is_refuted & is_open
        is_part = widen(faces, is_open, 1)[winners]
        units, faces, num_kept = regrow(
            units, faces, is_out, samples[is_part], is_open[winners[is_part]], edge, is_fitted, rng
        )
        is_changed = np.append(is_changed[~is_out], np.ones(len(units) - num_kept, dtype=bool))
    is_stale[: len(about)][is_beside] = _find_left(
        units, faces, is_changed, old_points[about[is_beside]], STRONG * evidence.tolerance
    )
    is_true = np.ones(len(old_points), dtype=bool)
    is_true[about[is_stale[: len(about)]]] = False
    points = np.concatenate([old_points.take(np.flatnonzero(is_true), axis=0), new_points])
    used, flat = np.unique(faces, return_inverse=True)
    faces = flat.reshape(-1, 3)
    return unfold_faces(units[used], faces), faces, points


def _find_left(
    units: np.ndarray, faces: np.ndarray, is_changed: np.ndarray, points: np.ndarray, tolerance: float
) -> np.ndarray:
    """Return which points `[P]` beside the changed units the surface has left: they are no longer true."""
    import igl

    about = np.ascontiguousarray(faces[any_corner(widen(faces, is_changed, 2), faces)])
    if len(about) == 0 or len(points) == 0:
        return np.zeros(len(points), dtype=bool)
    surface = igl.AABB()
    surface.init(units, about)
    squared = np.asarray(surface.squared_distance(units, about, points)[0])
    return squared > tolerance**2


def _find_doubtful(faces: np.ndarray, evidence: Evidence) -> np.ndarray:
    """Return the units that have moved or are gone: `[U]`."""
    is_gone = evidence.is_gone
    is_moved = evidence.is_moved & widen(faces, evidence.is_strong, STRONG_RINGS)
    if is_gone.any():
        agreeing = evidence.winners[evidence.distance <= evidence.tolerance]
        confirmations = np.bincount(agreeing, minlength=len(is_gone))
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
    normals /= np.maximum(find_lengths(normals)[..., None], 1e-300)
    offset = distant - units[winner]
    rise = np.abs(sum_rows(offset * normals[winner])) / np.maximum(find_lengths(offset), 1e-300)
    count = np.bincount(winner, minlength=len(units))
    flat = np.bincount(winner, rise < STEEPNESS, minlength=len(units))
    return is_rim & (flat > count / 2)
