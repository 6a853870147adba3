"""Growing self-reconstruction map, batched."""

from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from reconstruction.progress import Progress, silent
from reconstruction.surface_fit import fit_surface
from reconstruction.topology import build_surface
from reconstruction.winners import Tiles, find_candidates, make_tiles, search_all, search_tiles

_NOWHERE = 1e6  # where padded units wait; distances stay finite in float32


@dataclass(frozen=True)
class GSRMConfig:
    """How the map grows."""

    units: int = 2200
    growth: float = 1.5
    samples_per_unit: int = 8
    refinements: int = 5
    fit_iterations: int = 3


class State(NamedTuple):
    """A map: `units [U, 3]` and `faces [F, 3]`."""

    units: np.ndarray
    faces: np.ndarray


class Pass(NamedTuple):
    means: jax.Array
    counts: jax.Array
    errors: jax.Array
    worst_neighbors: jax.Array


@jax.jit
def _adapt(samples, weights, units, candidates) -> Pass:
    """One pass of all samples."""
    capacity = len(units)
    winners, squared = search_tiles(samples, units, candidates, 2)
    first, second = winners[..., 0].ravel(), winners[..., 1].ravel()
    w = weights.ravel()
    columns = [w, w * squared[..., 0].ravel()] + [w * samples[..., a].ravel() for a in range(3)]
    counts, errors, *sums = (jax.ops.segment_sum(c, first, capacity) for c in columns)
    means = jnp.where(counts[:, None] > 0, jnp.stack(sums, -1) / jnp.maximum(counts, 1e-9)[:, None], units)
    rank = jnp.argsort(jnp.argsort(errors))
    worst = jax.ops.segment_max(jnp.where(w > 0, rank[second], -1), first, capacity)
    return Pass(means, counts, errors, jnp.argsort(errors)[jnp.maximum(worst, 0)])


def _at_level(tiles: Tiles, wanted: int, rng) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Thin the samples, merging neighbouring tiles."""
    num_tiles, size = tiles.order.shape
    merge = 1
    while num_tiles // merge > 1 and (num_tiles // (4 * merge)) * size >= wanted:
        merge *= 4
    if merge == 1:
        return tiles.samples, tiles.is_real.astype(np.float32), tiles.centers
    pick = rng.integers(0, merge, size=size) + merge * np.arange(size)
    samples = tiles.samples.reshape(num_tiles // merge, size * merge, 3)[:, pick]
    is_real = tiles.is_real.reshape(num_tiles // merge, size * merge)[:, pick]
    centers = (samples.max(axis=1) + samples.min(axis=1)) / 2
    return samples, is_real.astype(np.float32), centers


def train(points, config=GSRMConfig(), seed=0, progress: Progress = silent) -> State:
    """Grow."""
    rng = np.random.default_rng(seed)
    points = np.asarray(points, dtype=np.float64)
    center = points.mean(axis=0)
    scale = np.sqrt(((points - center) ** 2).sum(axis=1).mean())
    scaled = ((points - center) / scale).astype(np.float32)
    tiles = make_tiles(scaled)
    units = grow(tiles, scaled, config, rng)
    winners = search_all(tiles, units, 3)[tiles.is_real]
    units, faces, _ = build_surface(units, winners)
    if config.fit_iterations:
        units = fit_surface(units, faces, scaled, iterations=config.fit_iterations)
    return State(units * scale + center, faces)


def grow(tiles, scaled, config, rng):
    capacity = config.units
    padded = np.full((capacity, 3), _NOWHERE, np.float32)
    padded[:, 0] += np.arange(capacity)
    num = min(3, capacity)
    padded[:num] = scaled[rng.choice(len(scaled), num, replace=False)]
    num_candidates = min(48, capacity)
    settle = config.refinements
    while True:
        wanted = config.samples_per_unit * num if num < capacity else 32 * num
        samples, weights, centers = _at_level(tiles, max(wanted, 1024), rng)
        found, _ = find_candidates(Tiles(samples, weights, weights, centers), padded, num_candidates)
        result = _adapt(samples, weights, padded, found)
        means, counts, errors, worst = (np.array(a) for a in result)
        is_dead = counts[:num] == 0
        padded[:num] = means[:num]
        if num == capacity:
            settle -= 1
            if settle == 0:
                return padded
        order = np.argsort(-errors[:num], kind="stable")
        room = min(capacity - num, max(1, int(num * (config.growth - 1))))
        dead = np.flatnonzero(is_dead)
        chosen = order[: room + len(dead)]
        pair = np.sort(np.stack([chosen, worst[chosen]], 1), 1)
        _, first = np.unique(pair @ np.array([capacity, 1]), return_index=True)
        pair = pair[np.sort(first)]
        slots = np.concatenate([dead, np.arange(num, num + room)])[: len(pair)]
        padded[slots] = (means[pair[: len(slots), 0]] + means[pair[: len(slots), 1]]) / 2
        num += max(0, len(slots) - len(dead))
