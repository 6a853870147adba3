"""The growing grid by its literal, sequential rules: one signal at a time.

For comparison and for teaching: about ten microseconds a signal; 7000 units need twenty million signals.

References:
    Fritzke (1995), "Growing grid: a self-organizing network with constant neighborhood range and adaptation
    strength", steps 1 to 8 of the growth phase and the fine-tuning phase.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction._src.base.progress import Progress
from reconstruction._src.geometry.rows import Points
from reconstruction._src.networks.growing_grid.growth import choose_line_pair, insert_lines
from reconstruction._src.networks.growing_grid.mesh import Grid
from reconstruction._src.networks.som.compilation import padded_length

_SIGMA = 0.9  # Width of the neighborhood on the L1 distance in the grid (Fritzke's sigma)
_RATE, _FINAL_RATE = 0.1, 0.005
"""Adaptation strength (epsilon) while growing, and at the end of the fine-tuning."""
_REACH = 3  # Units farther than this along an axis move by less than a 250th of the winner's step; they stay
_SIGNALS_PER_UNIT = 30  # Signals between two insertions, for each unit (lambda_g)
_FINE_SIGNALS_PER_UNIT = 100  # Signals of the fine-tuning, for each unit (lambda_f)
_FAR = 1e6  # Where padded units stand: they win nothing, and squares stay finite in float32
_MIN_SIDE = 8  # Rows and columns for which there is room at least, so that few programs are compiled


def train(
    points: Points, wanted: int, triangles: int | None, rng: np.random.Generator, progress: Progress
) -> Grid:
    """Grow a grid of 2 x 2 units over the points, then fine-tune it; return it in float32."""
    units = points[rng.choice(len(points), 4, replace=False)].reshape(2, 2, 3)
    while not _is_complete(units, wanted, triangles):
        number = units.shape[0] * units.shape[1]
        progress("grow", 0.7 * number / wanted)
        units, counters = _present(points, units, _SIGNALS_PER_UNIT * number, _RATE, _RATE, rng)
        axis, gap = choose_line_pair(counters)
        units = insert_lines(units.swapaxes(0, axis), np.array([gap])).swapaxes(0, axis)
    progress("fine-tune", 0.7)
    number = units.shape[0] * units.shape[1]
    return _present(points, units, _FINE_SIGNALS_PER_UNIT * number, _RATE, _FINAL_RATE, rng)[0]


def _is_complete(units: Grid, wanted: int, triangles: int | None) -> bool:
    rows, columns = units.shape[:2]
    if triangles is not None:
        return 2 * (rows - 1) * (columns - 1) >= triangles
    return rows * columns >= wanted


def _present(
    points: Points, units: Grid, num_signals: int, rate: float, final_rate: float, rng: np.random.Generator
) -> tuple[Grid, Int[np.ndarray, "R C"]]:
    """Present signals one after the other; the rate falls geometrically: units and how often each won."""
    rows, columns = units.shape[:2]
    shape = [padded_length(n, _MIN_SIDE) + 2 * _REACH for n in (rows, columns)]
    padded = np.full((*shape, 3), _FAR, dtype=np.float32)
    padded[_REACH : _REACH + rows, _REACH : _REACH + columns] = units
    is_unit = np.zeros(shape, dtype=bool)
    is_unit[_REACH : _REACH + rows, _REACH : _REACH + columns] = True
    learned, counters = _adapt_one_by_one(
        points[rng.permutation(len(points))],
        padded,
        is_unit,
        np.int32(num_signals),
        np.float32(rate),
        np.float32(np.log(final_rate / rate) / num_signals),
    )
    inside = (slice(_REACH, _REACH + rows), slice(_REACH, _REACH + columns))
    return np.asarray(learned)[inside], np.asarray(counters)[inside]


@jax.jit
def _adapt_one_by_one(
    points: Float[jax.Array, "N 3"],
    units: Float[jax.Array, "R C 3"],
    is_unit: Bool[jax.Array, "R C"],
    num_signals: Int[jax.Array, ""],
    rate: Float[jax.Array, ""],
    decay: Float[jax.Array, ""],
) -> tuple[Float[jax.Array, "R C 3"], Int[jax.Array, "R C"]]:
    """Per signal: find the winner, move it and its neighbors towards the signal, count (steps 3 to 5)."""
    offset = jnp.abs(jnp.arange(-_REACH, _REACH + 1))
    kernel = jnp.exp(-((offset[:, None] + offset) ** 2) / (2 * _SIGMA**2))
    window = 2 * _REACH + 1
    num_points, num_columns = points.shape[0], units.shape[1]

    def adapt(step, carry):
        units, counters = carry
        signal = points[step % num_points]
        distance = jnp.sum((units - signal) ** 2, axis=2)
        row, column = jnp.divmod(jnp.argmin(distance), num_columns)
        corner = (row - _REACH, column - _REACH)
        near = jax.lax.dynamic_slice(units, (*corner, 0), (window, window, 3))
        real = jax.lax.dynamic_slice(is_unit, corner, (window, window))
        strength = jnp.where(real, rate * jnp.exp(decay * step) * kernel, 0.0)
        near = near + strength[..., None] * (signal - near)
        units = jax.lax.dynamic_update_slice(units, near, (*corner, 0))
        return units, counters.at[row, column].add(1)

    return jax.lax.fori_loop(0, num_signals, adapt, (units, jnp.zeros(is_unit.shape, jnp.int32)))
