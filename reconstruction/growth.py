"""Batched growth of a self-reconstruction map: where the units go, before they are joined by faces.

A round is one pass of all samples of a level through their winners: every unit moves to the mean of the
samples it wins (the fixed point of moving by eps_b at every signal), and the units with the largest error get
a new unit each, halfway to their worst neighbour. Neighbours are units that win first and second for one
sample.

References:
    Rêgo, Araújo and Lima Neto (2010), Growing self-reconstruction maps, insertion rule.
    Parigi, Stramaccioni and Piastra (2015), arXiv 1503.08294: many signals at once.
    Differs: insertions come in rounds, each making the map larger by a constant factor.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from reconstruction.winners import Tiles, choose_num_candidates, find_candidates, search_tiles

_NOWHERE = 1e6
"""Where unused slots wait: no sample is nearer to them than to a unit, and squares stay finite in float32."""


class Tally(NamedTuple):
    """What one pass tells about every unit.

    Attributes:
        means: `[U, 3]` mean of the samples won; the unit's own place where there are none.
        counts: `[U]` samples won.
        errors: `[U]` sum of squared distances to them.
        worst_neighbors: `[U]` the neighbour with the largest error; the unit of largest error where none.
    """

    means: np.ndarray
    counts: np.ndarray
    errors: np.ndarray
    worst_neighbors: np.ndarray


class Level(NamedTuple):
    """Samples of one density.

    Attributes:
        samples: `[T, S, 3]`.
        weights: `[T, S]` 0 for slots that do not count.
        tiles: the same as tiles, for the candidates.
    """

    tiles: Tiles
    weights: np.ndarray


def choose_level(tiles: Tiles, weights: np.ndarray, wanted: int, rng: np.random.Generator) -> Level:
    """Thin the samples evenly, to a quarter as often as at least `wanted` stay.

    Args:
        tiles: all samples.
        weights: `[T, S]` weight of every slot.
        wanted: how many samples are enough.
        rng: draws which sample of every few stays.
    """
    num_tiles, size = tiles.order.shape
    merged = 1
    while num_tiles // merged >= 4 and num_tiles // (4 * merged) * size >= wanted:
        merged *= 4
    if merged == 1:
        return Level(tiles, weights)
    rows = num_tiles // merged
    pick = rng.integers(0, merged, size=size) + merged * np.arange(size)
    thin = [a.reshape(rows, size * merged, *a.shape[2:])[:, pick] for a in (*tiles[:3], weights)]
    centers = (thin[0].max(axis=1) + thin[0].min(axis=1)) / 2
    return Level(Tiles(*thin[:3], centers, tiles.tree), thin[3])


def grow(
    tiles: Tiles,
    weights: np.ndarray,
    units: np.ndarray,
    capacity: int,
    *,
    growth: float,
    samples_per_unit: int,
    settle_passes: int,
    rng: np.random.Generator,
) -> np.ndarray:
    """Grow a map from some units to `capacity`, then let it settle.

    Args:
        tiles: the samples.
        weights: `[T, S]` weight of every slot.
        units: `[U, 3]` float32, where to start.
        capacity: how many units are wanted, at least U.
        growth: by what factor one round makes the map larger.
        samples_per_unit: how many samples a unit should have in a pass.
        settle_passes: passes without insertion at the end.
        rng: draws the samples of the rounds.

    Returns:
        `[capacity, 3]` float32 units.
    """
    num_units = len(units)
    slots = np.full((capacity, 3), _NOWHERE, dtype=np.float32)
    slots[:, 0] *= 1 + np.arange(capacity, dtype=np.float32) / capacity
    slots[:num_units] = units
    level = choose_level(tiles, weights, samples_per_unit * capacity * 2 // 3, rng)
    while num_units < capacity:
        tally = tally_units(level, slots)
        slots[:num_units] = tally.means[:num_units]
        wanted = min(capacity, max(num_units + 1, int(growth * num_units)))
        num_units = _insert(slots, tally, num_units, wanted)
    level = choose_level(tiles, weights, 2 * samples_per_unit * capacity, rng)
    for remaining in reversed(range(settle_passes)):
        tally = tally_units(level, slots)
        slots = tally.means
        if remaining:
            _insert(slots, tally, capacity, capacity)
    return slots


def tally_units(level: Level, units: np.ndarray) -> Tally:
    """Let every sample of a level count for its winner."""
    num_samples, capacity = level.tiles.order.size, len(units)
    num_candidates = min(max(2, choose_num_candidates(num_samples, capacity, 2)), capacity)
    candidates, _ = find_candidates(level.tiles, units, num_candidates)
    tally = _tally(level.tiles.samples, level.weights, units, candidates)
    return Tally(*(np.array(a) for a in tally))


@jax.jit
def _tally(
    samples: jax.Array, weights: jax.Array, units: jax.Array, candidates: jax.Array
) -> tuple[jax.Array, ...]:
    capacity = len(units)
    winners, squared = search_tiles(samples, units, candidates, 2)
    first, second = winners[..., 0].ravel(), winners[..., 1].ravel()
    weight = weights.ravel()
    columns = [
        weight,
        weight * squared[..., 0].ravel(),
        *(weight * samples[..., k].ravel() for k in range(3)),
    ]
    sums = jnp.zeros((capacity, 5)).at[first].add(jnp.stack(columns, axis=-1))
    counts, errors = sums[:, 0], sums[:, 1]
    means = jnp.where(counts[:, None] > 0, sums[:, 2:] / jnp.maximum(counts, 1e-9)[:, None], units)
    by_error = jnp.argsort(errors)
    rank = jnp.zeros(capacity, jnp.int32).at[by_error].set(jnp.arange(capacity, dtype=jnp.int32))
    worst = jnp.full(capacity, capacity - 1).at[first].min(0)
    worst = worst.at[first].max(jnp.where(weight > 0, rank[second], 0))
    return means, counts, errors, by_error[worst]


def _insert(slots: np.ndarray, tally: Tally, num_units: int, wanted: int) -> int:
    """Put new units between those of largest error and their worst neighbours; units that won nothing move there.

    Returns:
        How many units there are now; at most `wanted`, fewer where two would come to lie in one place.
    """
    capacity = len(slots)
    free = np.concatenate([np.flatnonzero(tally.counts[:num_units] == 0), np.arange(num_units, wanted)])
    if len(free) == 0:
        return num_units
    chosen = np.argsort(-tally.errors[:num_units], kind="stable")[: len(free)]
    pairs = np.sort(np.stack([chosen, tally.worst_neighbors[chosen]], axis=1), axis=1)
    _, first = np.unique(pairs @ np.array([capacity, 1]), return_index=True)
    pairs = pairs[np.sort(first)]
    slots[free[: len(pairs)]] = (tally.means[pairs[:, 0]] + tally.means[pairs[:, 1]]) / 2
    return max(num_units, int(free[: len(pairs)].max()) + 1)
