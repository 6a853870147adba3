"""Let a grown grid learn on: what new readings contradict moves, grows or goes, the rest stays put."""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation, label
from scipy.spatial import KDTree

from reconstruction.networks.evidence import weigh_evidence
from reconstruction.networks.grid_growth import insert_lines
from reconstruction.networks.grid_learning import fit_grid, learn
from reconstruction.networks.padding import padded_length
from reconstruction.networks.winners import Tiles, make_tiles

SQUARE = np.ones((3, 3), dtype=bool)
MARGIN = 2
"""Units round a contradicted one that may move with it."""
STRETCH = 1.6
"""A gap gets lines where its active edges are longer than this many times the usual edge."""
NUM_ROUNDS = 8
NUM_RELAXATIONS = 200
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
    """
    spacing = _mean_edge(units)
    vertices = units.reshape(-1, 3)
    evidence = weigh_evidence(vertices, faces, old_points, new_points, spacing, origins)
    is_moved, is_gone = (part.reshape(units.shape[:2]) for part in (evidence.is_moved, evidence.is_gone))
    if not (is_moved | is_gone).any():
        return units, has_face, np.concatenate([old_points, new_points])
    is_cut = _find_open_patches(is_gone & ~is_moved)
    is_doubtful = binary_dilation(is_moved | is_gone & ~is_cut, SQUARE) | is_cut
    is_active = binary_dilation(is_doubtful & ~is_cut, SQUARE, iterations=MARGIN) & ~is_cut
    kept_points = _drop_contradicted(old_points, vertices, is_doubtful.reshape(-1), spacing)
    points = np.concatenate([kept_points, new_points])
    sheet = Sheet(_span(units, is_gone & ~is_cut & ~is_moved), is_active, has_face, ~is_doubtful)
    if not is_active.any():
        return units, _find_supported(sheet, points[:0], spacing), points
    distant = new_points[evidence.distance > spacing]
    near = points[_is_near(points, vertices[is_active.reshape(-1)], distant, spacing)]
    center = near.mean(axis=0) if len(near) else vertices.mean(axis=0)
    sheet = sheet._replace(units=((sheet.units - center) / spacing).astype(np.float32))
    scaled = ((near - center) / spacing).astype(np.float32)
    if len(near) >= 4:
        tiles = make_tiles(_fill_up(scaled, rng))
        sheet = _relearn(sheet, tiles)
        number = sheet.units[..., 0].size
        moved, _ = fit_grid(tiles, sheet.units, sigmas, stiffness, number, sheet.is_active)
        sheet = sheet._replace(units=moved)
    has_face = _find_supported(sheet, scaled, 1.0)
    return sheet.units.astype(np.float64) * spacing + center, has_face, points


def _find_open_patches(is_gone: np.ndarray) -> np.ndarray:
    """Return the gone units of patches that reach the rim of the grid: they are cut off, the others close."""
    patches = np.zeros(is_gone.shape, dtype=np.int32)
    label(is_gone, SQUARE, output=patches)
    rim = np.unique(np.concatenate([patches[0], patches[-1], patches[:, 0], patches[:, -1]]))
    return is_gone & np.isin(patches, rim)


def _span(units: np.ndarray, is_gone: np.ndarray) -> np.ndarray:
    """Return the grid with its gone units as a membrane between the others: Laplace's equation, by Jacobi."""
    units = units.copy()
    for _ in range(NUM_RELAXATIONS if is_gone.any() else 0):
        wide = np.pad(units, ((1, 1), (1, 1), (0, 0)), mode="edge")
        mean = (wide[:-2, 1:-1] + wide[2:, 1:-1] + wide[1:-1, :-2] + wide[1:-1, 2:]) / 4
        units[is_gone] = mean[is_gone]
    return units


def _fill_up(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the points in random order, some of them twice, so that their number is a customary one."""
    missing = padded_length(len(points), 4096) - len(points)
    order = np.concatenate([np.arange(len(points)), rng.integers(len(points), size=missing)])
    return points[rng.permutation(order)]


def _relearn(sheet: Sheet, tiles: Tiles) -> Sheet:
    """Learn by the batch rule, and insert lines wherever the active part has been stretched."""
    for current in range(NUM_ROUNDS):
        number = sheet.units[..., 0].size
        moved, counts = learn(tiles, sheet.units, 0.9, 5, goal=number, is_movable=sheet.is_active)
        sheet = sheet._replace(units=moved)
        grown = _insert_where_stretched(sheet, counts) if current < NUM_ROUNDS - 1 else sheet
        if grown.units.shape == sheet.units.shape:
            break
        sheet = grown
    return sheet


def _insert_where_stretched(sheet: Sheet, counts: np.ndarray) -> Sheet:
    """Give the gaps whose active edges are longest, and too long, as many lines as they need."""
    stretch = [_measure_stretch(sheet.units, sheet.is_active, counts > 0, axis) for axis in (0, 1)]
    axis = int(stretch[1].max(initial=0) > stretch[0].max(initial=0))
    longest = stretch[axis].max(initial=0)
    if longest < STRETCH:
        return sheet
    parts = np.clip(np.round(stretch[axis]), 1, MAX_LINES).astype(np.int64)
    parts[stretch[axis] < max(STRETCH, longest / 2)] = 1
    units, is_active, has_face, is_kept = (array.swapaxes(0, axis) for array in sheet)
    gap = np.repeat(np.arange(len(parts)), parts)
    is_old = np.r_[True, gap[1:] != gap[:-1]][:, None]
    grown = Sheet(
        insert_lines(units, np.repeat(np.arange(len(parts)), parts - 1)),
        np.concatenate(
            [np.where(is_old, is_active[gap], is_active[gap] | is_active[gap + 1]), is_active[-1:]]
        ),
        has_face[gap],
        np.concatenate([np.where(is_old, is_kept[gap], is_kept[gap] & is_kept[gap + 1]), is_kept[-1:]]),
    )
    return Sheet(*(array.swapaxes(0, axis) for array in grown))


def _measure_stretch(
    units: np.ndarray, is_active: np.ndarray, has_samples: np.ndarray, axis: int
) -> np.ndarray:
    """Return the median length of the edges across every gap, of those between samples that may move."""
    units, is_active, has_samples = (array.swapaxes(0, axis) for array in (units, is_active, has_samples))
    length = np.linalg.norm(np.diff(units, axis=0), axis=2)
    is_open = (is_active[:-1] | is_active[1:]) & has_samples[:-1] & has_samples[1:]
    median = np.ma.median(np.ma.masked_array(length, ~is_open), axis=1)
    return np.where(is_open.sum(axis=1) >= MIN_EDGES, np.ma.filled(median, 0.0), 0.0)


def _find_supported(sheet: Sheet, points: np.ndarray, spacing: float) -> np.ndarray:
    """Return which cells belong to the surface: the old, and of the doubtful those with samples about."""
    flat = sheet.units.reshape(-1, 3)
    counts = np.zeros(len(flat))
    if len(points):
        distance, winner = KDTree(flat).query(points)
        counts = np.bincount(np.asarray(winner)[np.asarray(distance) < 2 * spacing], minlength=len(flat))
    has_samples = binary_dilation(counts.reshape(sheet.is_active.shape) > 0, SQUARE, iterations=2)
    is_sound = has_samples | sheet.is_kept
    cells = is_sound[:-1, :-1] & is_sound[1:, :-1] & is_sound[1:, 1:] & is_sound[:-1, 1:]
    untouched = ~sheet.is_active & sheet.is_kept
    all_untouched = untouched[:-1, :-1] & untouched[1:, :-1] & untouched[1:, 1:] & untouched[:-1, 1:]
    return open_pinches(np.where(all_untouched, sheet.has_face, cells))


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


def _drop_contradicted(
    points: np.ndarray, vertices: np.ndarray, is_doubtful: np.ndarray, spacing: float
) -> np.ndarray:
    """Return the old points without those that doubtful units had won."""
    low, high = (
        vertices[is_doubtful].min(axis=0) - 2 * spacing,
        vertices[is_doubtful].max(axis=0) + 2 * spacing,
    )
    inside = np.flatnonzero((points >= low).all(axis=1) & (points <= high).all(axis=1))
    winner = np.asarray(KDTree(vertices).query(points[inside])[1])
    return np.delete(points, inside[is_doubtful[winner]], axis=0)


def _is_near(points: np.ndarray, active: np.ndarray, distant: np.ndarray, spacing: float) -> np.ndarray:
    """Return which points lie near active units, or among the readings far from the old surface: `[N]`."""
    anchors = np.concatenate([active, distant])
    low, high = anchors.min(axis=0) - 2 * spacing, anchors.max(axis=0) + 2 * spacing
    inside = (points >= low).all(axis=1) & (points <= high).all(axis=1)
    distance, _ = KDTree(anchors).query(points[inside], distance_upper_bound=2 * spacing)
    inside[inside] = np.isfinite(distance)
    return inside


def _mean_edge(units: np.ndarray) -> float:
    down = np.linalg.norm(np.diff(units, axis=0), axis=2)
    across = np.linalg.norm(np.diff(units, axis=1), axis=2)
    return float(np.median(np.concatenate([down.ravel(), across.ravel()])))
