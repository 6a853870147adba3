"""Batched growth of a self-reconstruction map: where the units go, before they are joined by faces.

A round is one pass of all samples of a level through their winners: every unit moves to the mean of the
samples it wins (the fixed point of moving by eps_b at every signal), and the units with the largest error get
a new unit each, halfway to their worst neighbor. Neighbors are units that win first and second for one
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
from jaxtyping import Float, Int

from reconstruction._src.geometry.rows import compute_lengths
from reconstruction._src.networks.som.compilation import padded_length
from reconstruction._src.networks.som.density import Density
from reconstruction._src.networks.som.winners import (
    Tiles,
    choose_num_candidates,
    find_candidates,
    search_tiles,
)

_NOWHERE = 1e6
"""Where unused slots wait: no sample is nearer to them than to a unit, and squares stay finite in float32."""
_GROWTH = 2.0  # Factor on the number of units in one round
_SAMPLES_PER_UNIT = 8
"""Samples of a round, for each unit wanted; settling uses twice as many, topology and the final fit all."""
_SETTLE_PASSES = 4  # Passes of all units through their samples once they are complete
_SPLIT_RADIUS = 1.05
"""A cell whose samples lie nearer to its unit (root mean square, in sample spacings) stays whole. Units of a
hexagonal map are 2.7 times as far apart as this radius; half a cell has twice the spacing."""
_MAX_ROUNDS = 100  # A map that has not grown to its size by then cannot: there are too few distinct samples
_CANDIDATE_AGE = 2  # Passes of settling for which one list of candidates does: units hardly move then


class Tally(NamedTuple):
    """What one pass measures at every unit."""

    means: Float[np.ndarray, "U 3"]  # mean of the samples won; the unit's own place where there are none
    counts: Float[np.ndarray, " U"]  # samples won
    errors: Float[np.ndarray, " U"]  # sum of squared distances to them
    worst_neighbors: Int[np.ndarray, " U"]  # that of largest error; the unit of largest error where none
    spacings: Float[np.ndarray, " U"]  # mean distance between the samples won


class Level(NamedTuple):
    """Samples of one density."""

    tiles: Tiles  # their places
    weights: Float[np.ndarray, "T S"]  # area every slot stands for; 0 for slots that do not count
    spacings: Float[np.ndarray, "T S"]  # distance between samples around every slot


def make_level(tiles: Tiles, density: Density) -> Level:
    """Give every slot of the tiles its sample's weight and spacing."""
    weights = np.where(tiles.is_real, density.weights[tiles.order], 0).astype(np.float32)
    return Level(tiles, weights, density.spacing[tiles.order].astype(np.float32))


def _thin_level(level: Level, wanted: int, rng: np.random.Generator) -> Level:
    """Thin the samples evenly, to a quarter as often as at least `wanted` stay."""
    tiles = level.tiles
    num_tiles, size = tiles.order.shape
    merged = 1
    while num_tiles // merged >= 4 and num_tiles // (4 * merged) * size >= wanted:
        merged *= 4
    if merged == 1:
        return level
    rows = num_tiles // merged
    pick = rng.integers(0, merged, size=size) + merged * np.arange(size)
    samples, order, is_real, weights, spacings = (
        a.reshape(rows, size * merged, *a.shape[2:])[:, pick] for a in (*tiles[:3], *level[1:])
    )
    centers = (samples.max(axis=1) + samples.min(axis=1)) / 2
    return Level(Tiles(samples, order, is_real, centers, tiles.tree), weights, spacings)


def grow(
    level: Level, units: Float[np.ndarray, "U 3"], capacity: int, rng: np.random.Generator, num_held: int = 0
) -> Float[np.ndarray, "W 3"]:
    """Grow a map from some units to `capacity`, then settle it."""
    num_units, num_slots = len(units), padded_length(capacity)
    slots = np.full((num_slots, 3), _NOWHERE, dtype=np.float32)
    slots[:, 0] *= 1 + np.arange(num_slots, dtype=np.float32) / num_slots
    slots[:num_units] = units
    # The maps of the rounds are smaller than the last one, so that two thirds of its samples are enough.
    thinned = _thin_level(level, _SAMPLES_PER_UNIT * capacity * 2 // 3, rng)
    for _ in range(_MAX_ROUNDS):
        if num_units == capacity:
            break
        tally = _tally_units(thinned, slots, _list_candidates(thinned, slots))
        slots[num_held:num_units] = tally.means[num_held:num_units]
        wanted = min(capacity, max(num_units + 1, int(_GROWTH * num_units)))
        before, num_units = num_units, _insert(slots, tally, num_units, wanted, num_held)
        if num_units == before:
            break
    thinned = _thin_level(level, 2 * _SAMPLES_PER_UNIT * capacity, rng)
    candidates = _list_candidates(thinned, slots)
    for done in range(_SETTLE_PASSES):
        if done and done % _CANDIDATE_AGE == 0:
            candidates = _list_candidates(thinned, slots)
        tally = _tally_units(thinned, slots, candidates)
        slots[num_held:] = tally.means[num_held:]
        if done < _SETTLE_PASSES - 1:
            _insert(slots, tally, num_units, num_units, num_held)
    return slots[:num_units]


def _list_candidates(level: Level, units: Float[np.ndarray, "U 3"]) -> Int[np.ndarray, "T C"]:
    """Return for every tile the units among which its winners are."""
    num_candidates = choose_num_candidates(level.tiles.order.size, len(units), 2)
    return find_candidates(level.tiles, units, max(2, num_candidates))[0]


def _tally_units(level: Level, units: Float[np.ndarray, "U 3"], candidates: Int[np.ndarray, "T C"]) -> Tally:
    """Count every sample of a level for its winner."""
    tally = _tally(level.tiles.samples, level.weights, level.spacings, units, candidates)
    return Tally(*(np.array(a) for a in tally))


@jax.jit
def _tally(
    samples: Float[jax.Array, "T S 3"],
    weights: Float[jax.Array, "T S"],
    spacings: Float[jax.Array, "T S"],
    units: Float[jax.Array, "U 3"],
    candidates: Int[jax.Array, "T C"],
) -> tuple[jax.Array, ...]:
    capacity = len(units)
    winners, squared = search_tiles(samples, units, candidates, 2)
    first, second = winners[..., 0].ravel(), winners[..., 1].ravel()
    weight = weights.ravel()
    columns = [
        weight,
        weight * squared[..., 0].ravel(),
        weight * spacings.ravel(),
        *(weight * samples[..., k].ravel() for k in range(3)),
    ]
    sums = jnp.zeros((capacity, 6)).at[first].add(jnp.stack(columns, axis=-1))
    counts, errors = sums[:, 0], sums[:, 1]
    share = 1 / jnp.maximum(counts, 1e-9)
    means = jnp.where(counts[:, None] > 0, sums[:, 3:] * share[:, None], units)
    by_error = jnp.argsort(errors)
    rank = jnp.zeros(capacity, jnp.int32).at[by_error].set(jnp.arange(capacity, dtype=jnp.int32))
    worst = jnp.full(capacity, capacity - 1).at[first].min(0)
    worst = worst.at[first].max(jnp.where(weight > 0, rank[second], 0))
    return means, counts, errors, by_error[worst], sums[:, 2] * share


def _insert(slots: Float[np.ndarray, "S 3"], tally: Tally, num_units: int, wanted: int, num_held: int) -> int:
    """Put new units between those of largest error and their worst neighbors.

    Units that won nothing take part as if they were new. A new unit stays within the cell it relieves, so
    that it wins samples even where the worst neighbor lies beyond a gap.
    """
    idle = num_held + np.flatnonzero(tally.counts[num_held:num_units] == 0)
    free = np.concatenate([np.arange(num_units, wanted), idle])
    if len(free) == 0:
        return num_units
    errors, counts = tally.errors[:num_units], tally.counts[:num_units]
    is_splittable = errors >= counts * (_SPLIT_RADIUS * tally.spacings[:num_units]) ** 2
    is_splittable &= errors > 0
    is_splittable[:num_held] = False
    split = np.argsort(np.where(is_splittable, -errors, np.inf), kind="stable")[: len(free)]
    split = split[is_splittable[split]]
    pairs = np.stack([split, tally.worst_neighbors[split]], axis=1)
    _, first = np.unique(np.sort(pairs, axis=1) @ np.array([len(slots), 1]), return_index=True)
    worst, neighbor = pairs[np.sort(first)].T
    offset = tally.means[neighbor] - tally.means[worst]
    radius = np.sqrt(tally.errors[worst] / tally.counts[worst])
    share = np.minimum(0.5, radius / np.maximum(compute_lengths(offset), 1e-30))
    slots[free[: len(worst)]] = tally.means[worst] + share[:, None] * offset
    return num_units + min(len(worst), wanted - num_units)
