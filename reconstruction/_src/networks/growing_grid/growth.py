"""Where a growing grid gets its next rows and columns."""

import heapq

import numpy as np
from jaxtyping import Float, Int, Num

from reconstruction._src.geometry.rows import Points, compute_lengths
from reconstruction._src.networks.growing_grid.mesh import Grid

_AXIS_POINTS = 4096  # As many points determine the principal axes
_MAX_STRETCH = 1.25  # The rows of the last round may be this many times more, or fewer, than the rule gives
_UNITS_WEIGHT, _TRIANGLES_WEIGHT = 10, 100
"""How much the relative error of the wanted number counts against the logarithm of the change in proportion: a wanted
number of units is approximate, one of triangles is to be met."""


def start_grid(points: Points) -> Float[np.ndarray, "2 2 3"]:
    """Return 2 x 2 units on the plane of the two principal axes, one standard deviation out."""
    center = points.mean(axis=0)
    _, values, axes = np.linalg.svd(points[:_AXIS_POINTS] - center, full_matrices=False)
    axes *= np.sign(axes[np.arange(3), np.abs(axes).argmax(axis=1)])[:, None]
    length = values / np.sqrt(min(len(points), _AXIS_POINTS))
    side = np.array([-1.0, 1.0])
    first, second = side[:, None] * axes[0] * length[0], side[:, None] * axes[1] * length[1]
    return (center + first[:, None] + second[None]).astype(np.float32)


def choose_lines(scores: Num[np.ndarray, " G"], num_lines: int) -> Int[np.ndarray, " num_lines"]:
    """Return the gaps that get a line, best first: a score falls to a half, a third, ... with each line of its gap."""
    heap = [(-score, gap, 1) for gap, score in enumerate(scores)]
    heapq.heapify(heap)
    selected = []
    while len(selected) < num_lines:
        _, gap, parts = heapq.heappop(heap)
        selected.append(gap)
        heapq.heappush(heap, (-scores[gap] / (parts + 1), gap, parts + 1))
    return np.array(selected, dtype=np.int64)


def score_gaps(units: Grid) -> tuple[Float[np.ndarray, " R-1"], Float[np.ndarray, " C-1"]]:
    """Return how much every gap between rows and between columns needs a line: the mean edge across it."""
    down = compute_lengths(np.diff(units, axis=0))
    across = compute_lengths(np.diff(units, axis=1))
    return down.mean(axis=1), across.mean(axis=0)


def insert_lines(units: Grid, gaps: Int[np.ndarray, " G"]) -> Float[np.ndarray, "S C 3"]:
    """Return the grid with rows in the given gaps, evenly spaced; a gap may be named more than once."""
    lines = np.repeat(np.arange(len(units) - 1), 1 + np.bincount(gaps, minlength=len(units) - 1))
    first = np.searchsorted(lines, lines)
    fraction = (np.arange(len(lines)) - first) / np.bincount(lines)[lines]
    fraction = fraction.reshape(-1, *[1] * (units.ndim - 1)).astype(units.dtype)
    rows = (1 - fraction) * units[lines] + fraction * units[lines + 1]
    return np.concatenate([rows, units[-1:]])


def choose_shape(units: Grid, wanted: int, triangles: int | None = None, *, is_last: bool) -> tuple[int, int]:
    """Return rows and columns after the next round: the rule's, near `wanted` units.

    In the last round the number counts first, and the rule's proportion may give way by up to a fifth.
    """
    num_rows, num_columns = units.shape[:2]
    down, across = score_gaps(units)
    order = choose_lines(np.concatenate([down, across]), wanted)
    rows = num_rows + np.cumsum(order < len(down))
    columns = num_columns + np.cumsum(order >= len(down))
    end = min(int(np.searchsorted(rows * columns, wanted)), len(order) - 1)
    row, column = int(rows[end]), int(columns[end])
    if not is_last:
        return row, column
    return _nearest_shape(row, column, (num_rows, num_columns), wanted, triangles)


def _nearest_shape(
    row: int, column: int, least: tuple[int, int], wanted: int, triangles: int | None
) -> tuple[int, int]:
    """Return the shape that meets the wanted number best, of nearly the proportion row : column."""
    best, best_cost = (row, column), np.inf
    for candidate in range(max(least[0], int(row / _MAX_STRETCH)), int(_MAX_STRETCH * row) + 2):
        cells = wanted / candidate if triangles is None else triangles / 2 / max(candidate - 1, 1) + 1
        for other in {int(np.floor(cells)), int(np.ceil(cells))}:
            if other < least[1]:
                continue
            number = candidate * other if triangles is None else 2 * (candidate - 1) * (other - 1)
            goal = wanted if triangles is None else triangles
            weight = _UNITS_WEIGHT if triangles is None else _TRIANGLES_WEIGHT
            cost = weight * abs(number - goal) / goal + abs(np.log(candidate / other * column / row))
            if cost < best_cost:
                best, best_cost = (candidate, other), cost
    return best


def choose_line_pair(counters: Int[np.ndarray, "R C"]) -> tuple[int, int]:
    """Return axis and gap of the one line that the sequential rules insert (Fritzke's step 7).

    It goes between the unit that won most and its direct neighbor that won most.

    Differs: Fritzke takes the farthest neighbor; the paper of 2011 the one that won most.
    """
    row, column = np.unravel_index(counters.argmax(), counters.shape)
    best, choice = -np.inf, (0, 0)
    for axis, step in ((0, -1), (0, 1), (1, -1), (1, 1)):
        i, j = (int(row) + step, int(column)) if axis == 0 else (int(row), int(column) + step)
        if not (0 <= i < counters.shape[0] and 0 <= j < counters.shape[1]):
            continue
        if counters[i, j] > best:
            best, choice = counters[i, j], (axis, min(i, int(row)) if axis == 0 else min(j, int(column)))
    return choice
