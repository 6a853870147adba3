"""Train a part of a grid again: the batch rule, lines where the part is stretched, the fit, and its cells."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from reconstruction._src.geometry.rows import find_lengths, sum_rows
from reconstruction._src.networks.growing_grid.cover import open_pinches
from reconstruction._src.networks.growing_grid.growth import insert_lines
from reconstruction._src.networks.growing_grid.learning import ROOM, TAPS, fit_grid, learn
from reconstruction._src.networks.growing_grid.marks import dilate
from reconstruction._src.networks.growing_grid.refinement_config import GridRefinementConfig
from reconstruction._src.networks.least_squares import FitConfig
from reconstruction._src.networks.som.winners import MAX_CANDIDATES, Tiles

_MIN_DRAWN = 4096
"""Samples that are drawn at least, some of them twice; with their doubles the only numbers, so that few programs are
compiled."""


class Sheet(NamedTuple):
    """A part of a grid, or all of it, while it learns again.

    Attributes:
        units: positions in usual edges.
        is_movable: which units may move.
        has_face: which cells belong to the surface.
        is_kept: units whose old points are still valid.
        number: which unit of the grid before each is, row after row; -1 where it has been inserted.
    """

    units: Float[np.ndarray, "R C 3"]
    is_movable: Bool[np.ndarray, "R C"]
    has_face: Bool[np.ndarray, "R-1 C-1"]
    is_kept: Bool[np.ndarray, "R C"]
    number: Int[np.ndarray, "R C"]


class Window(NamedTuple):
    """Rows and columns of a grid with the units that learn and those around them.

    Attributes:
        rows: from and to.
        columns: from and to.
    """

    rows: slice
    columns: slice

    def spread(self, shape: tuple[int, ...]) -> Bool[np.ndarray, "R C"]:
        """Return which units of a grid lie in the window."""
        is_inside = np.zeros(shape[:2], dtype=bool)
        is_inside[self] = True
        return is_inside


def find_window(is_active: Bool[np.ndarray, "R C"]) -> Window:
    """Return the part of the grid with all active units and as many around them as the smoothing reaches."""
    slices = []
    for axis in (0, 1):
        places = np.flatnonzero(is_active.any(axis=1 - axis))
        slices.append(slice(max(places[0] - TAPS - 1, 0), min(places[-1] + TAPS + 2, is_active.shape[axis])))
    return Window(*slices)


def span_gone(
    units: Float[np.ndarray, "R C 3"], is_gone: Bool[np.ndarray, "R C"]
) -> Float[np.ndarray, "R C 3"]:
    """Return the grid, its gone units as a membrane between the others (Laplace's equation); none is at the border."""
    if not is_gone.any():
        return units
    columns = is_gone.shape[1]
    number = np.full(is_gone.size, -1)
    open_units = np.flatnonzero(is_gone)
    number[open_units] = np.arange(len(open_units))
    flat = units.reshape(-1, 3)
    around = open_units + np.array([[-columns], [columns], [-1], [1]])
    is_fixed = number[around] < 0
    fixed = np.where(is_fixed[..., None], flat[around], 0.0).sum(axis=0)
    row = np.broadcast_to(np.arange(len(open_units)), around.shape)[~is_fixed]
    ends = np.concatenate(
        [np.stack([row, number[around[~is_fixed]]]), np.tile(np.arange(len(open_units)), (2, 1))], 1
    )
    values = np.concatenate([np.full(len(row), -1.0), np.full(len(open_units), 4.0)])
    laplacian = coo_array((values, ends), shape=(len(open_units), len(open_units))).tocsc()
    units = units.copy()
    units.reshape(-1, 3)[open_units] = splu(laplacian).solve(fixed)
    return units


def draw_samples(
    points: Float[np.ndarray, "N 3"], enough: int, rng: np.random.Generator
) -> Float[np.ndarray, "S 3"]:
    """Return enough of the points in random order, or some of them twice: their number is one of few."""
    wanted = _MIN_DRAWN
    while 1.5 * wanted < min(len(points), enough):
        wanted *= 2
    order = rng.permutation(len(points))[:wanted]
    return points[np.concatenate([order, rng.integers(len(points), size=wanted - len(order))])]


def relearn(
    sheet: Sheet,
    tiles: Tiles,
    sigmas: tuple[float, ...],
    fit: FitConfig,
    config: GridRefinementConfig,
) -> Sheet:
    """Learn by the batch rule, insert lines wherever the movable part has been stretched, and fit.

    Only the window around the movable units takes part.

    Args:
        sheet: the grid.
        tiles: the samples.
        sigmas: widths of the smoothing of the fit.
        fit: how it is fitted.
        config: how it learns.
    """
    for current in range(config.max_rounds):
        window = find_window(sheet.is_movable)
        units, is_movable = sheet.units[window], sheet.is_movable[window]
        goal = _choose_goal(is_movable.size)
        moved, counts = learn(tiles, units, config.sigma, config.iterations, goal=goal, is_movable=is_movable)
        sheet = _put(sheet, window, moved)
        is_last = current == config.max_rounds - 1
        grown = sheet if is_last else _insert_where_stretched(sheet, counts, window, config)
        if grown.units.shape == sheet.units.shape:
            break
        sheet = grown
    window = find_window(sheet.is_movable)
    units, is_movable = sheet.units[window], sheet.is_movable[window]
    fitted, _ = fit_grid(tiles, units, sigmas, fit, _choose_goal(is_movable.size), is_movable)
    return _put(sheet, window, fitted)


def _choose_goal(number: int) -> int:
    """Return the number of units to make room for, of two sizes an octave, so that few programs are compiled."""
    step = max(MAX_CANDIDATES, 2 ** ((number - 1).bit_length() - 2))
    return int(-(-number // step) * step / ROOM)


def _put(sheet: Sheet, window: Window, units: Float[np.ndarray, "R C 3"]) -> Sheet:
    """Return the sheet with the movable units of the window as given."""
    moved = sheet.units.copy()
    moved[window] = np.where(sheet.is_movable[window][..., None], units, moved[window])
    return sheet._replace(units=moved)


def _insert_where_stretched(
    sheet: Sheet, counts: Float[np.ndarray, "R C"], window: Window, config: GridRefinementConfig
) -> Sheet:
    """Insert lines where the movable edges across a gap are longest, and too long, as many as are needed.

    Args:
        sheet: the whole grid.
        counts: samples won by the units of the window.
        window: the part where units may move.
        config: the limits.
    """
    stretch = []
    for axis in (0, 1):
        found = _measure_stretch(
            sheet.units[window], sheet.is_movable[window], counts > 0, axis, config.min_edges
        )
        before = window[axis].start
        behind = sheet.is_movable.shape[axis] - 1 - len(found) - before
        stretch.append(np.pad(found, (before, behind)))
    axis = int(stretch[1].max(initial=0) > stretch[0].max(initial=0))
    longest = stretch[axis].max(initial=0)
    if longest < config.stretch:
        return sheet
    parts = np.clip(np.round(stretch[axis]), 1, config.max_lines).astype(np.int64)
    parts[stretch[axis] < max(config.stretch, longest / 2)] = 1
    units, is_movable, has_face, is_kept, number = (array.swapaxes(0, axis) for array in sheet)
    gap = np.repeat(np.arange(len(parts)), parts)
    is_old = np.r_[True, gap[1:] != gap[:-1]][:, None]

    def insert(mask: Bool[np.ndarray, "R C"], between: Bool[np.ndarray, "R-1 C"]) -> Bool[np.ndarray, "S C"]:
        return np.concatenate([np.where(is_old, mask[gap], between[gap]), mask[-1:]])

    added = np.repeat(np.arange(len(parts)), parts - 1)
    grown = Sheet(
        insert_lines(units, added),
        insert(is_movable, is_movable[:-1] | is_movable[1:]),
        has_face[gap],
        insert(is_kept, is_kept[:-1] & is_kept[1:]),
        np.concatenate([np.where(is_old, number[gap], -1), number[-1:]]),
    )
    return Sheet(*(array.swapaxes(0, axis) for array in grown))


def _measure_stretch(
    units: Float[np.ndarray, "R C 3"],
    is_movable: Bool[np.ndarray, "R C"],
    has_samples: Bool[np.ndarray, "R C"],
    axis: int,
    min_edges: int,
) -> Float[np.ndarray, " gaps"]:
    """Return the median length of the edges across every gap, of those between samples that may move."""
    units, is_movable, has_samples = (array.swapaxes(0, axis) for array in (units, is_movable, has_samples))
    length = find_lengths(np.diff(units, axis=0))
    is_open = (is_movable[:-1] | is_movable[1:]) & has_samples[:-1] & has_samples[1:]
    number = is_open.sum(axis=1)
    ascending = np.sort(np.where(is_open, length, np.inf), axis=1)
    middle = np.stack([np.maximum(number - 1, 0) // 2, np.minimum(number // 2, length.shape[1] - 1)], axis=1)
    median = sum_rows(np.take_along_axis(ascending, middle, axis=1)) / 2
    return np.where(number >= min_edges, median, 0.0)


def find_supported(
    sheet: Sheet, points: Float[np.ndarray, "N 3"], config: GridRefinementConfig
) -> Bool[np.ndarray, "P Q"]:
    """Return which cells belong to the surface: the old, and of the doubtful those with samples near them."""
    if sheet.is_kept.all():
        return sheet.has_face
    window = find_window(~sheet.is_kept | sheet.is_movable)
    units, is_movable, is_kept = (part[window] for part in (sheet.units, sheet.is_movable, sheet.is_kept))
    counts = np.zeros(is_kept.size)
    if len(points):
        tree = cKDTree(units.reshape(-1, 3))
        distance, winner = tree.query(points, distance_upper_bound=config.support_reach)
        counts = np.bincount(np.asarray(winner)[np.isfinite(distance)], minlength=is_kept.size)
    has_samples = dilate(counts.reshape(is_kept.shape) > 0, config.support_rings)
    is_sound, untouched = has_samples & is_movable | is_kept, ~is_movable & is_kept
    cells, all_untouched = (
        part[:-1, :-1] & part[1:, :-1] & part[1:, 1:] & part[:-1, 1:] for part in (is_sound, untouched)
    )
    has_face = sheet.has_face.copy()
    inside = has_face[
        window.rows.start : window.rows.stop - 1, window.columns.start : window.columns.stop - 1
    ]
    inside[...] = np.where(all_untouched, inside, cells)
    return open_pinches(has_face)
