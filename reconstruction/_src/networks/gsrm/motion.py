"""Move units of a map to where their readings are now: a wall that has moved is the same wall, with the same faces."""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.geometry.rows import any_corner, find_lengths, sum_by_owner
from reconstruction._src.networks.change.detection import Change
from reconstruction._src.networks.change.neighborhoods import number_parts
from reconstruction._src.networks.gsrm.local_fit import Rounds, fit_turning
from reconstruction._src.networks.gsrm.local_topology import is_sound
from reconstruction._src.networks.gsrm.refinement_config import MotionConfig
from reconstruction._src.networks.least_squares import FitConfig


def find_movable(
    faces: Int[np.ndarray, "F 3"],
    is_active: Bool[np.ndarray, " U"],
    change: Change,
    edge: float,
    config: MotionConfig,
    min_readings: int,
) -> Bool[np.ndarray, " U"]:
    """Return the contradicted units of connected parts that have only moved, and not far.

    Args:
        faces: unit indices.
        is_active: which units are contradicted.
        change: what the new readings show.
        edge: mean edge length of the map [m].
        config: the limits.
        min_readings: fewer readings far from a unit may be outliers.
    """
    part = number_parts(faces, is_active)
    is_far = change.distance > config.max_distance * edge
    num_far = np.bincount(change.winners[is_far], minlength=len(part))
    is_left_behind = (num_far >= min_readings) & is_active
    is_lost = is_active & change.is_gone & ~change.is_moved
    size, far, lost = (
        np.bincount(part[counted], minlength=part.max() + 1)
        for counted in (is_active, is_left_behind, is_lost)
    )
    return is_active & ((far == 0) & (lost <= config.max_gone_share * size))[part]


def move_units(
    units: Float[np.ndarray, "U 3"],
    faces: Int[np.ndarray, "F 3"],
    is_movable: Bool[np.ndarray, " U"],
    samples: Float[np.ndarray, "S 3"],
    edge: float,
    config: MotionConfig,
    fit: FitConfig,
    fit_rounds: Rounds,
) -> tuple[Float[np.ndarray, "U 3"], Int[np.ndarray, "F 3"], Bool[np.ndarray, " U"]]:
    """Return the units with the movable ones where their samples are, the faces, and which units have moved.

    Edges between the moved units turn along the creases. A part whose edges would become too long stays as it was.

    Args:
        units: positions [m].
        faces: unit indices.
        is_movable: which units may move.
        samples: those that movable units win [m].
        edge: mean edge length of the map [m].
        config: the limits.
        fit: fit of the moved units to their samples.
        fit_rounds: see `fit_turning`.
    """
    if len(samples) == 0:
        return units, faces, np.zeros(len(units), dtype=bool)
    is_inner = any_corner(is_movable, faces)
    is_adjacent = np.zeros(len(units), dtype=bool)
    is_adjacent[faces[is_inner]] = True
    is_near = any_corner(is_adjacent, faces)
    used, flat = np.unique(faces[is_near], return_inverse=True)
    near = flat.reshape(-1, 3)
    part = _settle(units[used], near, is_movable[used], samples, config.settle_passes)
    winners = np.asarray(cKDTree(part).query(samples)[1])
    part, turned = fit_turning(
        part, near, is_movable[used], is_inner[is_near], samples, winners, fit, fit_rounds
    )
    is_long = _find_long(part, turned, config.max_edge * edge)
    if is_long.any():
        parts = number_parts(faces, is_movable)
        stretched = parts[used[turned[is_long]]]
        is_left = is_movable & ~np.isin(parts, stretched[stretched >= 0])
        if is_left.any() and not is_left[is_movable].all():
            won = samples[is_left[cKDTree(units).query(samples)[1]]]
            return move_units(units, faces, is_left, won, edge, config, fit, fit_rounds)
        return units, faces, np.zeros(len(units), dtype=bool)
    moved, joined = units.copy(), faces.copy()
    moved[used], joined[is_near] = part, used[turned]
    # An edge that came by turning may exist already, between faces that stay.
    return moved, joined if is_sound(joined, is_adjacent) else faces, is_movable


def _settle(
    units: Float[np.ndarray, "U 3"],
    faces: Int[np.ndarray, "F 3"],
    is_movable: Bool[np.ndarray, " U"],
    samples: Float[np.ndarray, "S 3"],
    num_passes: int,
) -> Float[np.ndarray, "U 3"]:
    """Return the units, the movable ones in the middle of the samples they win, or else of their neighbors."""
    units = units.copy()
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    tail, head = np.concatenate([ends, ends[:, ::-1]]).T
    degree = np.bincount(tail, minlength=len(units))
    for _ in range(num_passes):
        winners = np.asarray(cKDTree(units).query(samples)[1])
        counts = np.bincount(winners, minlength=len(units))
        is_won, is_empty = is_movable & (counts > 0), is_movable & (counts == 0)
        own = sum_by_owner(winners, samples, len(units))[is_won] / counts[is_won, None]
        between = sum_by_owner(tail, units[head], len(units))[is_empty] / degree[is_empty, None]
        units[is_won], units[is_empty] = own, between
    return units


def _find_long(
    units: Float[np.ndarray, "U 3"], faces: Int[np.ndarray, "F 3"], longest: float
) -> Bool[np.ndarray, " F"]:
    """Return the faces with a side longer than that."""
    corners = units[faces]
    return np.asarray((find_lengths(corners - np.roll(corners, 1, axis=1)) > longest).any(axis=1))
