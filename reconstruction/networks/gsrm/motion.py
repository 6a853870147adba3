"""Move units of a map to where their readings are now: a wall that has moved is the same wall, with the same faces."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from reconstruction.geometry.rows import any_corner, find_lengths
from reconstruction.networks.change.detection import MIN_READINGS, Evidence
from reconstruction.networks.gsrm.local_fit import fit_turning
from reconstruction.networks.gsrm.local_topology import is_sound

FARTHEST = 1.5
"""A part moves where no few readings are farther from it than this, in mean edges; else it grows anew."""
GONE_SHARE = 0.2
"""It moves where no more than this share of its units is gone without new readings beside them."""
LONGEST = 3.5
"""No edge may become longer than this, in mean edges: units would be missing there."""
SETTLE_PASSES = 3


def find_movable(faces: np.ndarray, is_doubtful: np.ndarray, evidence: Evidence, edge: float) -> np.ndarray:
    """Return the doubtful units `[U]` of connected parts that have only moved, and not far.

    Args:
        faces: `[F, 3]`.
        is_doubtful: `[U]` which units are contradicted.
        evidence: what the new readings say.
        edge: mean edge length of the map.
    """
    part = number_parts(faces, is_doubtful)
    is_far = evidence.distance > FARTHEST * edge
    is_left_behind = (
        np.bincount(evidence.winners[is_far], minlength=len(part)) >= MIN_READINGS
    ) & is_doubtful
    is_lost = is_doubtful & evidence.is_gone & ~evidence.is_moved
    size, far, lost = (
        np.bincount(part[chosen], minlength=part.max() + 1)
        for chosen in (is_doubtful, is_left_behind, is_lost)
    )
    return is_doubtful & ((far == 0) & (lost <= GONE_SHARE * size))[part]


def number_parts(faces: np.ndarray, is_chosen: np.ndarray) -> np.ndarray:
    """Return for every chosen unit the number of its connected part, for the others -1: `[U]`."""
    number = np.full(len(is_chosen), -1)
    chosen = np.flatnonzero(is_chosen)
    number[chosen] = np.arange(len(chosen))
    corners = number[faces[is_chosen[faces].sum(axis=1) >= 2]]
    pairs = np.concatenate([corners[:, :2], corners[:, 1:], corners[:, ::2]])
    pairs = pairs[(pairs >= 0).all(axis=1)]
    graph = coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=(len(chosen), len(chosen)))
    number[chosen] = connected_components(graph, directed=False)[1]
    return number


def move_units(
    units: np.ndarray, faces: np.ndarray, is_movable: np.ndarray, samples: np.ndarray, edge: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the units with the movable ones where their samples are, the faces, and which units arrived.

    Edges between the moved units turn along the creases. A part whose faces would be drawn out is left as it was.

    Args:
        units: `[U, 3]`.
        faces: `[F, 3]`.
        is_movable: `[U]`.
        samples: `[N, 3]` that movable units win.
        edge: mean edge length of the map.
    """
    if len(samples) == 0:
        return units, faces, np.zeros(len(units), dtype=bool)
    is_inner = any_corner(is_movable, faces)
    around = np.unique(faces[is_inner])
    is_beside = np.zeros(len(units), dtype=bool)
    is_beside[around] = True
    is_near = any_corner(is_beside, faces)
    used, flat = np.unique(faces[is_near], return_inverse=True)
    near = flat.reshape(-1, 3)
    part = _settle(units[used], near, is_movable[used], samples)
    winners = np.asarray(cKDTree(part).query(samples)[1])
    part, turned = fit_turning(part, near, is_movable[used], is_inner[is_near], samples, winners)
    is_spoilt = _find_drawn(part, turned, LONGEST * edge)
    if is_spoilt.any():
        parts = number_parts(faces, is_movable)
        spoilt = parts[used[turned[is_spoilt]]]
        is_left = is_movable & ~np.isin(parts, spoilt[spoilt >= 0])
        if is_left.any() and not is_left[is_movable].all():
            return move_units(units, faces, is_left, samples[_find_won(units, is_left, samples)], edge)
        return units, faces, np.zeros(len(units), dtype=bool)
    moved, joined = units.copy(), faces.copy()
    moved[used], joined[is_near] = part, used[turned]
    # An edge that came by turning may be there already, between faces that stay.
    return moved, joined if is_sound(joined, is_beside) else faces, is_movable


def _settle(units: np.ndarray, faces: np.ndarray, is_movable: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Return the units, the movable ones in the middle of the samples they win, or else of their neighbours."""
    units = units.copy()
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    tail, head = np.concatenate([ends, ends[:, ::-1]]).T
    degree = np.bincount(tail, minlength=len(units))
    for _ in range(SETTLE_PASSES):
        winners = np.asarray(cKDTree(units).query(samples)[1])
        counts = np.bincount(winners, minlength=len(units))
        is_won, is_empty = is_movable & (counts > 0), is_movable & (counts == 0)
        own = _sum_rows(winners, samples, len(units))[is_won] / counts[is_won, None]
        between = _sum_rows(tail, units[head], len(units))[is_empty] / degree[is_empty, None]
        units[is_won], units[is_empty] = own, between
    return units


def _sum_rows(owner: np.ndarray, rows: np.ndarray, number: int) -> np.ndarray:
    """Return the sum of the rows `[N, 3]` of every owner: `[number, 3]`."""
    return np.stack([np.bincount(owner, rows[:, axis], minlength=number) for axis in range(3)], axis=1)


def _find_won(units: np.ndarray, is_chosen: np.ndarray, samples: np.ndarray) -> np.ndarray:
    return np.asarray(is_chosen[cKDTree(units).query(samples)[1]])


def _find_drawn(units: np.ndarray, faces: np.ndarray, longest: float) -> np.ndarray:
    """Return the faces `[F]` with a side longer than that."""
    corners = units[faces]
    return np.asarray((find_lengths(corners - np.roll(corners, 1, axis=1)) > longest).any(axis=1))
