"""Growing grid: a sheet of units that unfolds over the points and grows by whole rows and columns.

References:
    Fritzke (1995), "Growing grid: a self-organizing network with constant neighborhood range and adaptation
    strength"; Kohonen (1993), "Things you haven't heard about the self-organizing map" (the batch rule).

Differs: winners are found for all signals at once and the units move to kernel-weighted means (the batch
rule); several lines are inserted a round; instead of the literal fine-tuning the sheet is fitted to the
samples by least squares (`surface_fit`) with the moments smoothed over the grid, so that neither the rim nor
the edges shrink. `mode="paper"` has the sequential rules (`growing_grid_paper`).
"""

import heapq
from dataclasses import dataclass
from functools import partial
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from reconstruction.errors import ReconstructionError
from reconstruction.grid_mesh import triangulate, unfold
from reconstruction.padding import pad_rows, padded_length
from reconstruction.progress import Progress, silent
from reconstruction.surface_fit import Moments, find_chunk, make_ring, solve_moments, sum_moments
from reconstruction.winners import (
    MAX_CANDIDATES,
    Tiles,
    choose_num_candidates,
    find_candidates,
    make_tiles,
    search_tiles,
)

Insertion = Literal["longest", "counter", "distant"]
TAPS = 3
"""Reach of the neighbourhood along each grid axis."""
FAR = 1e6
"""Where padded units stand: they win nothing."""
FIRST_ITERATIONS = 10
"""Batch steps a round while the grid is small: it settles its direction then."""


@dataclass(frozen=True)
class GrowingGridConfig:
    """How a growing grid learns; all lengths are relative to the grid's own spacing.

    Attributes:
        units: units wanted; the grid ends with rows x columns as near to it as whole lines allow.
        triangles: triangles wanted instead: 2 (rows - 1) (columns - 1).
        insertion: where a line goes. "longest": where the mean edge across is longest; "counter": between
            the unit that won most and its neighbour that won most; "distant": between the unit that won most
            and its farthest neighbour (Fritzke).
        mode: "batch", or "paper" for the sequential rules.
        growth: factor on the number of units in a round of the growth phase.
        samples_per_unit: points used while growing, for each unit; the final fit uses all.
        iterations: batch steps a round.
        sigma: width of the neighbourhood while growing, in grid steps.
        fit_sigmas: width of the neighbourhood in each iteration of the final fit; below 0.5 the sheet folds.
        stiffness: unwillingness to slide within the surface in the final fit.
    """

    units: int = 2200
    triangles: int | None = None
    insertion: Insertion = "longest"
    mode: Literal["batch", "paper"] = "batch"
    growth: float = 2.5
    samples_per_unit: int = 20
    iterations: int = 3
    sigma: float = 0.9
    fit_sigmas: tuple[float, ...] = (0.8, 0.6, 0.5, 0.5)
    stiffness: float = 0.03

    def __post_init__(self) -> None:
        if self.triangles is not None and self.triangles < 2:
            raise ReconstructionError(f"triangles must be at least 2, got {self.triangles}")
        if self.units < 4:
            raise ReconstructionError(f"units must be at least 4 (a grid of 2 x 2), got {self.units}")
        if self.insertion not in ("longest", "counter", "distant"):
            raise ReconstructionError(
                f"insertion must be 'longest', 'counter' or 'distant', got {self.insertion!r}"
            )
        if self.mode not in ("batch", "paper"):
            raise ReconstructionError(f"mode must be 'batch' or 'paper', got {self.mode!r}")
        if not self.growth > 1:
            raise ReconstructionError(f"growth must be above 1, got {self.growth}")

    @property
    def wanted_units(self) -> int:
        """Units that the wanted triangles would have in a square grid, or the units asked for."""
        return self.units if self.triangles is None else round((np.sqrt(self.triangles / 2) + 1) ** 2)


class State(NamedTuple):
    """A grid that has learnt.

    Attributes:
        units: `[R, C, 3]` reference vectors [m].
        evidence: `[R, C]` samples that each unit won.
        has_face: `[R - 1, C - 1]` whether the cell between four units belongs to the surface.
    """

    units: np.ndarray
    evidence: np.ndarray
    has_face: np.ndarray

    @property
    def vertices(self) -> np.ndarray:
        """`[V, 3]` the units, row after row [m]."""
        return self.units.reshape(-1, 3)

    @property
    def faces(self) -> np.ndarray:
        """`[F, 3]` two triangles a cell."""
        return triangulate(self.units, self.has_face)


def train(points: np.ndarray, config: GrowingGridConfig, seed: int = 0, progress: Progress = silent) -> State:
    """Let a grid of 2 x 2 units grow over the points.

    Args:
        points: `[N, 3]` finite positions [m], N >= units.
        config: how.
        seed: of the order of the signals.
        progress: told how far it is.
    """
    rng = np.random.default_rng(seed)
    center = points.mean(axis=0)
    scale = float(np.sqrt(((points - center) ** 2).sum(axis=1).mean()))
    scaled = ((points - center) / scale).astype(np.float32)[rng.permutation(len(points))]
    units, counts = _grow(scaled, config, progress)
    progress("fit", 0.8)
    units, counts = fit_grid(scaled, units, config.fit_sigmas, config.stiffness, config.wanted_units)
    progress("fit", 1.0)
    rows, columns = counts.shape
    return State(
        units.astype(np.float64) * scale + center,
        counts.astype(np.float64),
        np.ones((rows - 1, columns - 1), dtype=bool),
    )


def start_grid(points: np.ndarray) -> np.ndarray:
    """Return 2 x 2 units on the plane of the two principal axes, one standard deviation out: `[2, 2, 3]`."""
    center = points.mean(axis=0)
    _, values, axes = np.linalg.svd(points[:4096] - center, full_matrices=False)
    axes *= np.sign(axes[np.arange(3), np.abs(axes).argmax(axis=1)])[:, None]
    length = values / np.sqrt(min(len(points), 4096))
    side = np.array([-1.0, 1.0])
    first, second = side[:, None] * axes[0] * length[0], side[:, None] * axes[1] * length[1]
    return (center + first[:, None] + second[None]).astype(np.float32)


def choose_lines(scores: np.ndarray, num_lines: int, rule: Insertion) -> np.ndarray:
    """Return the gaps that get a line, best first: `[num_lines]` indices.

    A gap's score falls to a half, a third, ... with each line it gets by the rule "longest"; by the other
    rules a gap gets at most one line at a time.
    """
    heap = [(-score, gap, 1) for gap, score in enumerate(scores)]
    heapq.heapify(heap)
    chosen = []
    while heap and len(chosen) < num_lines:
        _, gap, parts = heapq.heappop(heap)
        chosen.append(gap)
        if rule == "longest":
            heapq.heappush(heap, (-scores[gap] / (parts + 1), gap, parts + 1))
    return np.array(chosen, dtype=np.int64)


def score_gaps(units: np.ndarray, counts: np.ndarray, rule: Insertion) -> tuple[np.ndarray, np.ndarray]:
    """Return how much every gap between rows `[R - 1]` and between columns `[C - 1]` calls for a line."""
    down = np.linalg.norm(np.diff(units, axis=0), axis=2)
    across = np.linalg.norm(np.diff(units, axis=1), axis=2)
    if rule == "longest":
        return down.mean(axis=1), across.mean(axis=0)
    if rule == "counter":
        down, across = counts[:-1] + counts[1:] - 0.0, counts[:, :-1] + counts[:, 1:] - 0.0
    return _vote(counts, down, across)


def _vote(counts: np.ndarray, down: np.ndarray, across: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Let every unit name its incident edge of the highest value; a gap scores the highest count for it."""
    rows, columns = counts.shape
    edges = np.full((4, rows, columns), -np.inf)
    edges[0, 1:], edges[1, :-1] = down, down
    edges[2, :, 1:], edges[3, :, :-1] = across, across
    chosen = edges.argmax(axis=0)
    row, column = np.mgrid[:rows, :columns]
    by_row, by_column = np.full(rows - 1, -1.0), np.full(columns - 1, -1.0)
    for side, shift in ((0, -1), (1, 0)):
        np.maximum.at(by_row, row[chosen == side] + shift, counts[chosen == side])
        np.maximum.at(by_column, column[chosen == side + 2] + shift, counts[chosen == side + 2])
    return by_row, by_column


def insert_lines(units: np.ndarray, gaps: np.ndarray) -> np.ndarray:
    """Return the grid with rows in the given gaps, evenly spaced; a gap may be named more than once."""
    lines = np.repeat(np.arange(len(units) - 1), 1 + np.bincount(gaps, minlength=len(units) - 1))
    first = np.searchsorted(lines, lines)
    fraction = (np.arange(len(lines)) - first) / np.bincount(lines)[lines]
    fraction = fraction.reshape(-1, *[1] * (units.ndim - 1)).astype(units.dtype)
    rows = (1 - fraction) * units[lines] + fraction * units[lines + 1]
    return np.concatenate([rows, units[-1:]])


def choose_shape(
    units: np.ndarray, counts: np.ndarray, wanted: int, config: GrowingGridConfig, *, is_last: bool
) -> tuple[int, int]:
    """Return rows and columns after the next round: the rule's, near `wanted` units.

    In the last round the number counts first, and the rule's proportion may give way by up to a fifth.
    """
    num_rows, num_columns = counts.shape
    down, across = score_gaps(units, counts, config.insertion)
    order = choose_lines(np.concatenate([down, across]), wanted, config.insertion)
    rows = num_rows + np.cumsum(order < len(down))
    columns = num_columns + np.cumsum(order >= len(down))
    end = min(int(np.searchsorted(rows * columns, wanted)), len(order) - 1)
    row, column = int(rows[end]), int(columns[end])
    if not is_last:
        return row, column
    return _nearest_shape(row, column, (num_rows, num_columns), wanted, config.triangles)


def _nearest_shape(
    row: int, column: int, least: tuple[int, int], wanted: int, triangles: int | None
) -> tuple[int, int]:
    """Return the shape that meets the wanted number best, of nearly the proportion row : column."""
    best, best_cost = (row, column), np.inf
    for candidate in range(max(least[0], int(0.8 * row)), int(1.25 * row) + 2):
        cells = wanted / candidate if triangles is None else triangles / 2 / max(candidate - 1, 1) + 1
        for other in {int(np.floor(cells)), int(np.ceil(cells))}:
            if other < least[1]:
                continue
            number = candidate * other if triangles is None else 2 * (candidate - 1) * (other - 1)
            goal = wanted if triangles is None else triangles
            cost = (10 if triangles is None else 100) * abs(number - goal) / goal + abs(
                np.log(candidate / other * column / row)
            )
            if cost < best_cost:
                best, best_cost = (candidate, other), cost
    return best


def _grow(points: np.ndarray, config: GrowingGridConfig, progress: Progress) -> tuple[np.ndarray, np.ndarray]:
    """Grow from 2 x 2 to the wanted number of units."""
    wanted = config.wanted_units
    units, counts = learn(points, start_grid(points), sigma=0.3, iterations=1)
    num_rounds = max(1, int(np.ceil(np.log(wanted / 4) / np.log(config.growth))))
    for current in range(1, num_rounds + 1):
        progress("grow", 0.8 * current / num_rounds)
        goal = round(4 * (wanted / 4) ** (current / num_rounds))
        shape = choose_shape(units, counts, goal, config, is_last=current == num_rounds)
        down, across = score_gaps(units, counts, config.insertion)
        units = insert_lines(units, choose_lines(down, shape[0] - len(down) - 1, config.insertion))
        columns = choose_lines(across, shape[1] - len(across) - 1, config.insertion)
        units = insert_lines(units.swapaxes(0, 1), columns).swapaxes(0, 1)
        is_small = _find_capacity(goal) <= MAX_CANDIDATES
        units, counts = learn(
            points,
            units,
            sigma=min(config.sigma, 0.2 * min(shape)),
            iterations=FIRST_ITERATIONS if is_small else config.iterations,
            samples_per_unit=config.samples_per_unit,
            goal=goal,
        )
    return units, counts


def learn(
    points: np.ndarray,
    units: np.ndarray,
    sigma: float,
    iterations: int,
    samples_per_unit: int = 20,
    goal: int = 4,
) -> tuple[np.ndarray, np.ndarray]:
    """Let the grid learn by the batch rule from the first of the points.

    Args:
        points: `[N, 3]` float32 in random order.
        units: `[R, C, 3]` float32.
        sigma: width of the neighbourhood in grid steps.
        iterations: how many batch steps.
        samples_per_unit: how many points for each unit, at least 4096 in all.
        goal: about R C; together with the number of points it determines all array shapes.

    Returns:
        units `[R, C, 3]` and counts `[R, C]`.
    """
    capacity = max(_find_capacity(goal), padded_length(units.shape[0] * units.shape[1], MAX_CANDIDATES))
    num_samples = 4096 * 2 ** max(0, int(np.ceil(np.log2(samples_per_unit * capacity / 4096))))
    tiles = make_tiles(points[:num_samples])
    padded, candidates = _pad(units, tiles, capacity)
    moved, counts = _learn(
        jnp.asarray(tiles.samples),
        jnp.asarray(tiles.is_real),
        padded,
        candidates,
        jnp.array(units.shape[:2]),
        jnp.float32(sigma),
        iterations=iterations,
    )
    return _as_grid(moved, units), _as_grid(counts, units)


def fit_grid(
    points: np.ndarray, units: np.ndarray, sigmas: tuple[float, ...], stiffness: float, goal: int
) -> tuple[np.ndarray, np.ndarray]:
    """Fit the sheet to all points, with the moments smoothed over the grid; then unfold it.

    Args:
        points: `[N, 3]` float32.
        units: `[R, C, 3]` float32.
        sigmas: width of the smoothing, iteration by iteration.
        stiffness: of `solve_moments`.
        goal: see `learn`.

    Returns:
        units `[R, C, 3]` and counts `[R, C]`.
    """
    rows, columns = units.shape[:2]
    spacing = float(np.linalg.norm(np.diff(units, axis=1), axis=2).mean())
    spacing = (spacing + float(np.linalg.norm(np.diff(units, axis=0), axis=2).mean())) / 2
    capacity = max(_find_capacity(goal), padded_length(rows * columns, MAX_CANDIDATES))
    tiles = make_tiles(points / spacing)
    padded, candidates = _pad(units / spacing, tiles, capacity)
    ring = make_ring(triangulate(units, np.ones((rows - 1, columns - 1), dtype=bool)), capacity)
    ring = np.pad(ring, ((0, 0), (0, 8 - ring.shape[1]), (0, 0)), constant_values=-1)
    moved, counts = _fit(
        jnp.asarray(tiles.samples),
        jnp.asarray(tiles.is_real),
        padded,
        candidates,
        jnp.array([rows, columns]),
        jnp.asarray(ring),
        jnp.asarray(sigmas, jnp.float32),
        jnp.float32(stiffness),
        chunk=find_chunk(tiles.order.size),
    )
    return unfold(_as_grid(moved, units)) * spacing, _as_grid(counts, units)


def _as_grid(values: jax.Array, units: np.ndarray) -> np.ndarray:
    """Return the real ones of padded values in the shape of the grid."""
    rows, columns = units.shape[:2]
    return np.asarray(values)[: rows * columns].reshape(rows, columns, *values.shape[1:])


def _pad(units: np.ndarray, tiles: Tiles, capacity: int) -> tuple[jax.Array, jax.Array]:
    """Return the units `[capacity, 3]`, row after row, and every tile's candidates `[T, C]`.

    Both shapes follow from the capacity and the number of samples alone: another seed, another proportion of
    the grid, but the same compiled program.
    """
    flat = units.reshape(-1, 3)
    padded = pad_rows(flat.astype(np.float32), capacity, FAR)
    if capacity <= MAX_CANDIDATES:
        candidates = np.broadcast_to(np.arange(capacity, dtype=np.int32), (len(tiles.centers), capacity))
    else:
        number = min(choose_num_candidates(tiles.order.size, capacity, 1), len(flat))
        candidates, _ = find_candidates(tiles, flat, number)
    return jnp.asarray(padded), jnp.asarray(candidates)


def _find_capacity(goal: int) -> int:
    """Return how many units to make room for where about `goal` are wanted."""
    return padded_length(round(1.1 * goal), minimum=MAX_CANDIDATES)


def _smooth(grid: jax.Array, shape: jax.Array, sigma: jax.Array) -> jax.Array:
    """Convolve along both axes of the grid with a Gaussian of `2 TAPS + 1` taps; nothing comes from outside.

    Args:
        grid: `[capacity, K]` values, row after row; zero beyond the real units.
        shape: `[2]` rows and columns.
        sigma: width in grid steps.
    """
    length = grid.shape[0]
    column = jnp.arange(length) % shape[1]
    margin = TAPS * length // 2 + TAPS  # a grid has at least two rows, so at most half its units in one
    total = grid
    for tap in range(1, TAPS + 1):
        value = jnp.exp(-(tap**2) / (2 * sigma**2))
        before = jnp.where((column >= tap)[:, None], jnp.roll(grid, tap, axis=0), 0.0)
        behind = jnp.where((column < shape[1] - tap)[:, None], jnp.roll(grid, -tap, axis=0), 0.0)
        total = total + value * (before + behind)
    wide = jnp.pad(total, ((margin, margin), (0, 0)))
    for tap in range(1, TAPS + 1):
        value = jnp.exp(-(tap**2) / (2 * sigma**2))
        before = jax.lax.dynamic_slice_in_dim(wide, margin - tap * shape[1], length)
        behind = jax.lax.dynamic_slice_in_dim(wide, margin + tap * shape[1], length)
        total = total + value * (before + behind)
    return total


@partial(jax.jit, static_argnames="iterations")
def _learn(samples, is_real, units, candidates, shape, sigma, *, iterations):
    """Repeat the batch rule W = HᵀX / HᵀN, H the separable kernel."""
    flat = samples.reshape(-1, 3)
    real = is_real.reshape(-1, 1)
    rows = jnp.where(real, jnp.concatenate([flat, jnp.ones_like(flat[:, :1])], axis=1), 0.0)
    is_unit = jnp.arange(len(units)) < shape[0] * shape[1]

    def step(_, carry):
        units, _ = carry
        winners = search_tiles(samples, units, candidates, 1)[0].reshape(-1)
        sums = jnp.zeros((len(units), 4)).at[winners].add(rows)
        smooth = _smooth(sums, shape, sigma)
        moved = smooth[:, :3] / jnp.maximum(smooth[:, 3:], 1e-9)
        return jnp.where((is_unit & (smooth[:, 3] > 1e-6))[:, None], moved, units), sums[:, 3]

    return jax.lax.fori_loop(0, iterations, step, (units, jnp.zeros(len(units))))


@partial(jax.jit, static_argnames="chunk")
def _fit(samples, is_real, units, candidates, shape, ring, sigmas, stiffness, *, chunk):
    """Fit by least squares with moments smoothed over the grid; lengths in grid steps."""
    flat, weight = samples.reshape(-1, 3), is_real.reshape(-1).astype(jnp.float32)
    is_unit = jnp.arange(len(units)) < shape[0] * shape[1]

    def step(units, sigma):
        winners = search_tiles(samples, units, candidates, 1)[0].reshape(-1)
        moments = sum_moments(units, ring, flat, winners, weight, 4.0, chunk=chunk)
        columns = jnp.concatenate([moments.normal, moments.residual, moments.weight[:, None]], axis=1)
        smooth = _smooth(columns, shape, sigma)
        move = solve_moments(Moments(smooth[:, :6], smooth[:, 6:9], smooth[:, 9]), stiffness, 0.5)
        return units + jnp.where(is_unit[:, None], move, 0.0), None

    units, _ = jax.lax.scan(step, units, sigmas)
    winners = search_tiles(samples, units, candidates, 1)[0].reshape(-1)
    return units, jnp.zeros(len(units)).at[winners].add(weight)
