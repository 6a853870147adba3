"""How a grid of units learns from many samples at once: the batch rule, and the fit of its surface."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from reconstruction._src.geometry.rows import compute_lengths
from reconstruction._src.networks.growing_grid.mesh import Grid, triangulate, unfold
from reconstruction._src.networks.som.compilation import pad_rows, padded_length
from reconstruction._src.networks.som.winners import (
    LIST_STEP,
    MAX_CANDIDATES,
    Tiles,
    choose_num_candidates,
    find_candidates,
    search_tiles,
)
from reconstruction._src.networks.surface_fit import FitConfig, Samples, compute_chunk, fit_once, make_ring

TAPS = 3  # Reach of the neighborhood along each grid axis
MAX_ITERATIONS = 24  # Iterations of a fit at most
ROOM = 1.1  # There is room for this many times the wanted units: a round may exceed its number
_MAX_SHORT = 0.02
"""Share of tiles that may reach beyond their list of candidates before all lists are made twice as long."""
_FAR = 1e6  # Where padded units stand: they win nothing, and squares stay finite in float32
_MIN_SAMPLES = 4096
"""The number of samples is this or its double and so on, so that few programs are compiled."""


def choose_num_samples(num_points: int, wanted: int) -> int:
    """Return how many of the points to take where `wanted` are enough: one of few numbers, so of few shapes."""
    return min(num_points, _MIN_SAMPLES * 2 ** max(0, int(np.ceil(np.log2(wanted / _MIN_SAMPLES)))))


def learn(
    tiles: Tiles,
    units: Grid,
    sigma: float,
    iterations: int,
    goal: int = 4,
    is_movable: Bool[np.ndarray, "R C"] | None = None,
) -> Grid:
    """Train the grid by the batch rule."""
    padded, candidates, mask = _pad(units, tiles, goal, is_movable)
    moved = _learn(
        tiles.samples,
        tiles.is_real,
        padded,
        candidates,
        np.array(units.shape[:2]),
        mask,
        np.float32(sigma),
        np.int32(iterations),
    )
    return _as_grid(moved, units)


def choose_sigmas(samples_per_unit: float) -> tuple[float, ...]:
    """Return the widths of the smoothing for a fit: the fewer samples, the wider; the more, the more iterations.

    A vertex must not follow the noise of a handful of samples, so a wider neighborhood shares its moments with it: of
    a constant number of samples, between half a grid step (narrower, and the sheet folds) and one and a half. A coarse
    grid has far to go from its rounded crests, and samples enough to go there: from 12 samples a unit on, 2.5
    iterations more with every double.
    """
    last = float(np.clip(2 / np.sqrt(samples_per_unit), 0.5, 1.5))
    extra = round(2.5 * np.log2(max(samples_per_unit, 1) / 12))
    number = int(np.clip(4 + extra, 4, MAX_ITERATIONS))
    return tuple(max(sigma, last) for sigma in (1.0, 0.8, 0.6) + (last,) * (number - 3))


def fit_grid(
    tiles: Tiles,
    units: Grid,
    sigmas: tuple[float, ...],
    config: FitConfig,
    goal: int,
    is_movable: Bool[np.ndarray, "R C"] | None = None,
) -> Grid:
    """Fit the sheet to the samples, with the moments smoothed over the grid; then unfold it."""
    rows, columns = units.shape[:2]
    spacing = float(compute_lengths(np.diff(units, axis=1)).mean())
    spacing = (spacing + float(compute_lengths(np.diff(units, axis=0)).mean())) / 2
    padded, candidates, mask = _pad(units, tiles, goal, is_movable)
    ring = make_ring(triangulate(units, np.ones((rows - 1, columns - 1), dtype=bool)), len(padded))
    moved = _fit(
        tiles.samples / np.float32(spacing),
        tiles.is_real,
        padded / np.float32(spacing),
        candidates,
        np.array([rows, columns]),
        mask,
        ring,
        np.resize(sigmas, MAX_ITERATIONS).astype(np.float32),
        np.int32(len(sigmas)),
        config=config,
        chunk=compute_chunk(tiles.order.size),
    )
    return unfold(_as_grid(moved, units), is_movable) * spacing


def _as_grid(values: Shaped[jax.Array, "capacity ..."], units: Grid) -> Shaped[np.ndarray, "R C ..."]:
    """Return the real ones of padded values in the shape of the grid."""
    rows, columns = units.shape[:2]
    return np.asarray(values)[: rows * columns].reshape(rows, columns, *values.shape[1:])


def _pad(
    units: Grid, tiles: Tiles, goal: int, is_movable: Bool[np.ndarray, "R C"] | None
) -> tuple[Float[np.ndarray, "capacity 3"], Int[np.ndarray, "T K"], Bool[np.ndarray, " capacity"]]:
    """Return the units, row after row, every tile's candidates, and which units may move.

    The shapes follow from the goal, the number of samples and whether the lists are long enough: another
    seed, another proportion of the grid, but the same compiled program.
    """
    capacity = max(compute_capacity(goal), padded_length(units.shape[0] * units.shape[1]))
    mask = np.ones(units.shape[:2], dtype=bool) if is_movable is None else is_movable
    mask = pad_rows(mask.reshape(-1), capacity, False)
    flat = units.reshape(-1, 3)
    padded = pad_rows(flat.astype(np.float32), capacity, _FAR)
    number = choose_num_candidates(tiles.order.size, capacity, 1)
    candidates, reach = _list_candidates(tiles, flat, number)
    # Steep parts of a sheet put more units under a tile than the mean.
    radius = compute_lengths(tiles.samples[:, ::4] - tiles.centers[:, None]).max(axis=1)
    if (reach < radius).mean() > _MAX_SHORT and number < MAX_CANDIDATES:
        candidates, _ = _list_candidates(tiles, flat, min(2 * number, MAX_CANDIDATES))
    return padded, candidates, mask


def _list_candidates(
    tiles: Tiles, units: Float[np.ndarray, "U 3"], number: int
) -> tuple[Int[np.ndarray, "T K"], Float[np.ndarray, " T"]]:
    """Return every tile's nearest units and how far they reach; where there are few, all and padded ones."""
    if len(units) > number:
        return find_candidates(tiles, units, number)
    everyone = np.arange(LIST_STEP * -(-len(units) // LIST_STEP), dtype=np.int32)
    num_tiles = len(tiles.centers)
    return np.broadcast_to(everyone, (num_tiles, len(everyone))), np.full(num_tiles, np.inf)


def compute_capacity(goal: int) -> int:
    """Return how many units to make room for where about `goal` are wanted."""
    return padded_length(round(ROOM * goal))


def _smooth(
    grid: Float[jax.Array, "capacity K"], shape: Int[jax.Array, " 2"], sigma: Float[jax.Array, ""]
) -> Float[jax.Array, "capacity K"]:
    """Convolve along both axes of the grid with a Gaussian of `2 TAPS + 1` taps; nothing comes from outside."""
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


@jax.jit
def _learn(
    samples: Float[jax.Array, "T S 3"],
    is_real: Bool[jax.Array, "T S"],
    units: Float[jax.Array, "U 3"],
    candidates: Int[jax.Array, "T K"],
    shape: Int[jax.Array, " 2"],
    is_movable: Bool[jax.Array, " U"],
    sigma: Float[jax.Array, ""],
    iterations: Int[jax.Array, ""],
) -> Float[jax.Array, "U 3"]:
    """Repeat the batch rule W = HᵀX / HᵀN, H the separable kernel."""
    flat = samples.reshape(-1, 3)
    real = is_real.reshape(-1, 1)
    rows = jnp.where(real, jnp.concatenate([flat, jnp.ones_like(flat[:, :1])], axis=1), 0.0)

    def step(_, units):
        winners = search_tiles(samples, units, candidates, 1)[0].reshape(-1)
        sums = jnp.zeros((len(units), 4)).at[winners].add(rows)
        smooth = _smooth(sums, shape, sigma)
        moved = smooth[:, :3] / jnp.maximum(smooth[:, 3:], 1e-9)
        return jnp.where((is_movable & (smooth[:, 3] > 1e-6))[:, None], moved, units)

    return jax.lax.fori_loop(0, iterations, step, units)


@partial(jax.jit, static_argnames=("config", "chunk"))
def _fit(
    samples: Float[jax.Array, "T S 3"],
    is_real: Bool[jax.Array, "T S"],
    units: Float[jax.Array, "U 3"],
    candidates: Int[jax.Array, "T K"],
    shape: Int[jax.Array, " 2"],
    is_movable: Bool[jax.Array, " U"],
    ring: Int[jax.Array, "U D 2"],
    sigmas: Float[jax.Array, " iterations"],
    num_iterations: Int[jax.Array, ""],
    *,
    config: FitConfig,
    chunk: int,
) -> Float[jax.Array, "U 3"]:
    """Fit by least squares with moments smoothed over the grid; lengths in grid steps."""
    flat, weight = samples.reshape(-1, 3), is_real.reshape(-1).astype(jnp.float32)

    def step(iteration, units):
        winners = search_tiles(samples, units, candidates, 1)[0].reshape(-1)
        found = Samples(flat, winners, weight)

        def spread(moments):
            return _smooth(moments, shape, sigmas[iteration])

        return fit_once(units, ring, found, config, chunk, is_movable, spread)

    return jax.lax.fori_loop(0, num_iterations, step, units)
