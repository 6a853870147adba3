"""Let a grown grid learn on: what new readings contradict moves, grows or goes, the rest stays put.

Only contradicted units and those beside them may move, and only the rows and columns about them are worked on.
"""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation, binary_erosion, label
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from reconstruction.geometry.boxes import find_near_box
from reconstruction.geometry.rows import find_lengths, sum_rows
from reconstruction.networks.change.detection import STRONG_RINGS, Evidence, find_superseded, weigh_evidence
from reconstruction.networks.growing_grid.growth import insert_lines
from reconstruction.networks.growing_grid.learning import TAPS, fit_grid, learn
from reconstruction.networks.growing_grid.mesh import untangle_sheet
from reconstruction.networks.som.winners import MAX_CANDIDATES, Tiles, make_tiles

SQUARE = np.ones((3, 3), dtype=bool)
CLOSING = 2
"""Gaps of up to twice so many units between moved ones have moved with them."""
STRAY = 0.1
"""Where no more than this share of a unit's new readings disagree, nothing has changed."""
STRETCH = 1.6
"""A gap gets lines where its active edges are longer than this many times the usual edge."""
NUM_ROUNDS = 8
LEARN_STEPS = 5
"""Batch steps a round."""
LEAST_SAMPLES = 4096
SAMPLES_PER_UNIT = 6
"""So many samples for each unit that takes part are enough."""
MIN_EDGES = 2
"""So many long edges make a gap that gets a line."""
MAX_LINES = 64
"""Lines that one gap may get in a round."""


class Sheet(NamedTuple):
    """A grid while it is refined.

    Attributes:
        units: `[R, C, 3]`.
        is_active: `[R, C]` which units may move.
        has_face: `[R - 1, C - 1]`.
        is_kept: `[R, C]` units whose old evidence stands.
    """

    units: np.ndarray
    is_active: np.ndarray
    has_face: np.ndarray
    is_kept: np.ndarray


def refine_sheet(
    units: np.ndarray,
    faces: np.ndarray,
    has_face: np.ndarray,
    old_points: np.ndarray,
    new_points: np.ndarray,
    sigmas: tuple[float, ...],
    stiffness: float,
    rng: np.random.Generator,
    origins: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return units, cells and points after new readings.

    Args:
        units: `[R, C, 3]` [m].
        faces: `[F, 3]` the triangles they make.
        has_face: `[R - 1, C - 1]`.
        old_points: `[N, 3]` what the grid has learnt from.
        new_points: `[M, 3]` what was read since.
        sigmas: of the final fit.
        stiffness: of the final fit.
        rng: orders the readings.
        origins: `[M, 3]` where the new readings were made from, if that is known.
    """
    spacing = _mean_edge(units)
    vertices = units.reshape(-1, 3)
    evidence = weigh_evidence(vertices, faces, old_points, new_points, spacing, origins)
    is_believed, is_strong, is_gone = (
        part.reshape(units.shape[:2]) for part in (evidence.is_moved, evidence.is_strong, evidence.is_gone)
    )
    is_moved = is_believed & np.asarray(binary_dilation(is_strong, SQUARE, iterations=STRONG_RINGS))
    if not (is_moved | is_gone).any():
        return units, has_face, np.concatenate([old_points, new_points])
    is_moved = close_gaps(is_moved)
    is_cut = _find_open_patches(is_gone & ~is_moved)
    is_ring = np.asarray(binary_dilation(is_moved | is_gone & ~is_cut, SQUARE), dtype=bool)
    is_doubtful = is_ring & ~(_find_steady(evidence, units.shape[:2]) & ~(is_moved | is_gone)) | is_cut
    is_active = is_doubtful & ~is_cut
    is_near = _find_window(is_active | is_cut).spread(units.shape[:2]).reshape(-1)
    changed = vertices[(is_active | is_cut).reshape(-1)]
    about = find_near_box(old_points, changed, 2 * spacing)
    readings = new_points[evidence.compared]
    against = readings[(evidence.distance > evidence.tolerance) & is_near[evidence.winners]]
    news = find_near_box(new_points, np.concatenate([changed, against]), 2 * spacing)
    samples = np.concatenate([old_points[about], new_points[news]])
    # Beyond the samples no unit is nearest to one of them.
    close = find_near_box(vertices, samples, 2 * spacing) if len(samples) else np.arange(len(vertices))
    owners = close[cKDTree(vertices[close]).query(samples)[1]]
    is_stale = is_doubtful.reshape(-1)[owners]
    is_stale[len(about) :] = False
    beside = np.flatnonzero(is_stale & ~(is_moved | is_gone).reshape(-1)[owners])
    is_stale[beside] = find_superseded(samples[beside], readings, evidence)
    samples = samples[is_near[owners] & ~is_stale]
    is_left = np.ones(len(old_points), dtype=bool)
    is_left[about[is_stale[: len(about)]]] = False
    points = np.concatenate([old_points.take(np.flatnonzero(is_left), axis=0), new_points])
    spanned = span_gone(units, is_gone & ~is_cut & ~is_moved)
    sheet = Sheet(spanned, is_active, has_face, ~is_doubtful)
    center = changed.mean(axis=0)
    scaled = ((samples - center) / spacing).astype(np.float32)
    start = ((spanned - center) / spacing).astype(np.float32)
    local = sheet._replace(units=start)
    if is_active.any() and len(samples) >= 4:
        local = _relearn(local, make_tiles(_draw(scaled, int(is_near.sum()), rng)), sigmas, stiffness)
    moved = local.units.astype(np.float64) * spacing + center
    if moved.shape == units.shape:
        moved = np.where(is_active[..., None], moved, units)
    has_face = _find_supported(local, scaled, 1.0)
    return untangle_sheet(moved, has_face), has_face, points


def close_gaps(is_moved: np.ndarray) -> np.ndarray:
    """Return the moved units with those that lie in narrow gaps between them: `[R, C]`."""
    wide = binary_dilation(np.pad(is_moved, CLOSING), SQUARE, iterations=CLOSING)
    return binary_erosion(wide, SQUARE, iterations=CLOSING, border_value=1)[
        CLOSING:-CLOSING, CLOSING:-CLOSING
    ]


def _find_steady(evidence: Evidence, shape: tuple[int, ...]) -> np.ndarray:
    """Return the units whose new readings agree, `[R, C]`, but for stray ones."""
    disagrees = evidence.distance > evidence.tolerance
    number = int(np.prod(shape))
    against = np.bincount(evidence.winners[disagrees], minlength=number)
    everything = np.bincount(evidence.winners, minlength=number)
    return ((everything > 0) & (against <= STRAY * everything)).reshape(shape)


class Window(NamedTuple):
    """Rows and columns of a grid that hold what is worked on and the units about it.

    Attributes:
        rows: from and to.
        columns: from and to.
    """

    rows: slice
    columns: slice

    def spread(self, shape: tuple[int, ...]) -> np.ndarray:
        """Return which units of a grid lie in the window, `[R, C]`."""
        is_inside = np.zeros(shape[:2], dtype=bool)
        is_inside[self] = True
        return is_inside


def _find_window(is_active: np.ndarray) -> Window:
    """Return the part of the grid with all active units and as many about them as the smoothing reaches."""
    slices = []
    for axis in (0, 1):
        places = np.flatnonzero(is_active.any(axis=1 - axis))
        slices.append(slice(max(places[0] - TAPS - 1, 0), min(places[-1] + TAPS + 2, is_active.shape[axis])))
    return Window(*slices)


def _find_open_patches(is_gone: np.ndarray) -> np.ndarray:
    """Return the gone units of patches that reach the rim of the grid: they are cut off, the others close."""
    patches = np.zeros(is_gone.shape, dtype=np.int32)
    label(is_gone, SQUARE, output=patches)
    rim = np.unique(np.concatenate([patches[0], patches[-1], patches[:, 0], patches[:, -1]]))
    return is_gone & np.isin(patches, rim)


def span_gone(units: np.ndarray, is_gone: np.ndarray) -> np.ndarray:
    """Return the grid with its gone units as a membrane between the others (Laplace's equation); none is on the rim."""
    if not is_gone.any():
        return units
    units = units.copy()
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


def _draw(points: np.ndarray, num_units: int, rng: np.random.Generator) -> np.ndarray:
    """Return enough of the points in random order, or some of them twice: their number is a customary one."""
    wanted = LEAST_SAMPLES
    while 1.5 * wanted < min(len(points), SAMPLES_PER_UNIT * num_units):
        wanted *= 2
    order = rng.permutation(len(points))[:wanted]
    return points[np.concatenate([order, rng.integers(len(points), size=wanted - len(order))])]


def _choose_goal(number: int) -> int:
    """Return the number of units to make room for: one of few, so that little is compiled."""
    step = max(MAX_CANDIDATES, 2 ** ((number - 1).bit_length() - 2))  # two sizes an octave
    return int(-(-number // step) * step / 1.1)


def _relearn(sheet: Sheet, tiles: Tiles, sigmas: tuple[float, ...], stiffness: float) -> Sheet:
    """Learn by the batch rule, insert lines wherever the active part has been stretched, and fit.

    Only the window round the active units takes part.
    """
    for current in range(NUM_ROUNDS):
        window = _find_window(sheet.is_active)
        units, is_active = sheet.units[window], sheet.is_active[window]
        goal = _choose_goal(is_active.size)
        moved, counts = learn(tiles, units, 0.9, LEARN_STEPS, goal=goal, is_movable=is_active)
        sheet = _put(sheet, window, moved)
        is_last = current == NUM_ROUNDS - 1
        grown = sheet if is_last else _insert_where_stretched(sheet, counts, window)
        if grown.units.shape == sheet.units.shape:
            break
        sheet = grown
    window = _find_window(sheet.is_active)
    units, is_active = sheet.units[window], sheet.is_active[window]
    fitted, _ = fit_grid(tiles, units, sigmas, stiffness, _choose_goal(is_active.size), is_active)
    return _put(sheet, window, fitted)


def _put(sheet: Sheet, window: Window, units: np.ndarray) -> Sheet:
    """Return the sheet with the active units of the window as given."""
    moved = sheet.units.copy()
    moved[window] = np.where(sheet.is_active[window][..., None], units, moved[window])
    return sheet._replace(units=moved)


def _insert_where_stretched(sheet: Sheet, counts: np.ndarray, window: Window) -> Sheet:
    """Give the gaps whose active edges are longest, and too long, as many lines as they need.

    Args:
        sheet: the whole grid.
        counts: samples won by the units of the window.
        window: the part where units may move.
    """
    stretch = []
    for axis in (0, 1):
        found = _measure_stretch(sheet.units[window], sheet.is_active[window], counts > 0, axis)
        before = window[axis].start
        behind = sheet.is_active.shape[axis] - 1 - len(found) - before
        stretch.append(np.pad(found, (before, behind)))
    axis = int(stretch[1].max(initial=0) > stretch[0].max(initial=0))
    longest = stretch[axis].max(initial=0)
    if longest < STRETCH:
        return sheet
    parts = np.clip(np.round(stretch[axis]), 1, MAX_LINES).astype(np.int64)
    parts[stretch[axis] < max(STRETCH, longest / 2)] = 1
    units, is_active, has_face, is_kept = (array.swapaxes(0, axis) for array in sheet)
    gap = np.repeat(np.arange(len(parts)), parts)
    is_old = np.r_[True, gap[1:] != gap[:-1]][:, None]

    def insert(mask: np.ndarray, between: np.ndarray) -> np.ndarray:
        return np.concatenate([np.where(is_old, mask[gap], between[gap]), mask[-1:]])

    added = np.repeat(np.arange(len(parts)), parts - 1)
    grown = Sheet(
        insert_lines(units, added),
        insert(is_active, is_active[:-1] | is_active[1:]),
        has_face[gap],
        insert(is_kept, is_kept[:-1] & is_kept[1:]),
    )
    return Sheet(*(array.swapaxes(0, axis) for array in grown))


def _measure_stretch(
    units: np.ndarray, is_active: np.ndarray, has_samples: np.ndarray, axis: int
) -> np.ndarray:
    """Return the median length of the edges across every gap, of those between samples that may move."""
    units, is_active, has_samples = (array.swapaxes(0, axis) for array in (units, is_active, has_samples))
    length = find_lengths(np.diff(units, axis=0))
    is_open = (is_active[:-1] | is_active[1:]) & has_samples[:-1] & has_samples[1:]
    number = is_open.sum(axis=1)
    ascending = np.sort(np.where(is_open, length, np.inf), axis=1)
    middle = np.stack([np.maximum(number - 1, 0) // 2, np.minimum(number // 2, length.shape[1] - 1)], axis=1)
    median = sum_rows(np.take_along_axis(ascending, middle, axis=1)) / 2
    return np.where(number >= MIN_EDGES, median, 0.0)


def _find_supported(sheet: Sheet, points: np.ndarray, spacing: float) -> np.ndarray:
    """Return which cells belong to the surface: the old, and of the doubtful those with samples about."""
    if sheet.is_kept.all():
        return sheet.has_face
    window = _find_window(~sheet.is_kept | sheet.is_active)
    units, is_active, is_kept = (part[window] for part in (sheet.units, sheet.is_active, sheet.is_kept))
    counts = np.zeros(is_kept.size)
    if len(points):
        distance, winner = cKDTree(units.reshape(-1, 3)).query(points, distance_upper_bound=2 * spacing)
        counts = np.bincount(np.asarray(winner)[np.isfinite(distance)], minlength=is_kept.size)
    has_samples = binary_dilation(counts.reshape(is_kept.shape) > 0, SQUARE, iterations=2)
    is_sound, untouched = has_samples & is_active | is_kept, ~is_active & is_kept
    cells, all_untouched = (
        part[:-1, :-1] & part[1:, :-1] & part[1:, 1:] & part[:-1, 1:] for part in (is_sound, untouched)
    )
    has_face = sheet.has_face.copy()
    inside = has_face[
        window.rows.start : window.rows.stop - 1, window.columns.start : window.columns.stop - 1
    ]
    inside[...] = np.where(all_untouched, inside, cells)
    return open_pinches(has_face)


def open_pinches(has_face: np.ndarray) -> np.ndarray:
    """Return the cells without those that touch another only at a corner, so that no vertex is pinched."""
    has_face = has_face.copy()
    while True:
        a, b, c, d = has_face[:-1, :-1], has_face[1:, :-1], has_face[1:, 1:], has_face[:-1, 1:]
        pinch_ac, pinch_bd = a & c & ~b & ~d, b & d & ~a & ~c
        if not (pinch_ac.any() or pinch_bd.any()):
            return has_face
        has_face[:-1, :-1] &= ~pinch_ac
        has_face[1:, :-1] &= ~pinch_bd


def _mean_edge(units: np.ndarray) -> float:
    down = find_lengths(np.diff(units, axis=0))
    across = find_lengths(np.diff(units, axis=1))
    return float(np.median(np.concatenate([down.ravel(), across.ravel()])))
