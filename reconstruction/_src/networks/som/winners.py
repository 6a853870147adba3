"""The units nearest to every sample: tile search, the hot loop of both networks.

About sixty neighboring samples form a tile; what they share is a short list of candidate units, found
once a tile on the host by a k-d tree; the samples then look through that list only, vectorised over all
tiles. Keys are squared distances with the candidate's place in the list written into the lowest mantissa
bits, so that a running minimum of integers is the whole search.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.geometry.neighbors import query_tree
from reconstruction._src.geometry.rows import Points, compute_lengths
from reconstruction._src.networks.som.compilation import pad_rows, padded_length

_PLACE_BITS = 7
_PLACE_MASK = (1 << _PLACE_BITS) - 1
MAX_CANDIDATES = 1 << _PLACE_BITS  # Units in a tile's list at most: a place in the list has to fit its bits
TILE_SIZE = 64
"""Samples in a tile at most: fewer need more lists, more need longer ones; the result does not depend on it."""
_SLOT_STEP, _SMALL_SLOT_STEP = 4, 16
"""The slots of one of many tiles, and of one of few, are a multiple of these, so that few programs are compiled."""
_FEW_TILES = 128
LIST_STEP = 16  # Likewise for the length of the lists
_TIE = 1e-4
"""Squared distances lose their last seven bits, so that distances agree within less than this share."""
_FARTHEST = 0x7F7FFFFF  # bit pattern of the largest finite float32


class Tiles(NamedTuple):
    """Samples in groups of neighbors; there are few different shapes, so that few programs are compiled."""

    samples: Float[np.ndarray, "T S 3"]  # float32 positions; padded slots repeat other samples
    order: Int[np.ndarray, "T S"]  # int32 index of each slot's sample
    is_real: Bool[np.ndarray, "T S"]  # False in padded slots: they must not count
    centers: Float[np.ndarray, "T 3"]  # middle of each tile's bounding box
    tree: cKDTree  # a k-d tree of the samples, each once, in the order they came in


def make_tiles(samples: Points) -> Tiles:
    """Halve the samples across their longest extent until at most `TILE_SIZE` share a tile."""
    samples = np.ascontiguousarray(samples, dtype=np.float32)
    num_samples, num_tiles = len(samples), 1
    while num_samples > TILE_SIZE * num_tiles:
        num_tiles *= 2
    step = _SLOT_STEP if num_tiles > _FEW_TILES else _SMALL_SLOT_STEP
    num_slots = num_tiles * step * -(-num_samples // (num_tiles * step))
    padding = num_slots - num_samples
    repeated = np.linspace(0, num_samples - 1, padding).astype(np.int64)
    slots = np.concatenate([np.arange(num_samples), repeated])
    leaves = _halve(samples.take(slots, axis=0), num_tiles)
    order = slots[leaves]
    inside = samples.take(order, axis=0)
    columns = np.ascontiguousarray(inside.transpose(0, 2, 1))  # reduced in a fifth of the time
    centers = (columns.max(axis=2) + columns.min(axis=2)) / 2
    tree = cKDTree(samples, balanced_tree=False)
    return Tiles(inside, order.astype(np.int32), leaves < num_samples, centers, tree)


def _halve(positions: Points, num_parts: int) -> Int[np.ndarray, "num_parts S"]:
    """Return the indices of positions in parts of equal size; parts next to each other lie next to each other.

    (A tree's leaves would not do: where several positions share the median, its halves differ in size.)
    """
    parts = np.arange(len(positions)).reshape(1, -1)
    columns = [np.ascontiguousarray(column) for column in positions.T]
    while len(parts) < num_parts:
        inside = np.stack([column[parts] for column in columns])
        longest = (inside.max(axis=2) - inside.min(axis=2)).argmax(axis=0)
        along = inside[longest, np.arange(len(parts))]
        half = parts.shape[1] // 2
        parts = np.take_along_axis(parts, np.argpartition(along, half, axis=1), axis=1).reshape(-1, half)
    return np.sort(parts, axis=1)  # how a partition leaves its halves differs between processors


def choose_num_candidates(num_samples: int, num_units: int, k: int) -> int:
    """Return how many candidate units a tile needs so that nearly every winner is among them.

    A tile spans `TILE_SIZE * U / N` units. Its corners lie 0.8 times the root of that area, in unit spacings, from
    its center; the list reaches a unit beyond, and half the root of k more, where the k-th winner may lie.
    A list too short costs a search by a k-d tree, one too long time for each sample; results do not change.
    """
    spanned = TILE_SIZE * num_units / max(num_samples, 1)
    wanted = int(np.pi * (0.8 * np.sqrt(spanned) + 1.0 + 0.5 * np.sqrt(k)) ** 2)
    return min(LIST_STEP * max(1, -(-wanted // LIST_STEP)), MAX_CANDIDATES, num_units)


def find_candidates(
    tiles: Tiles, units: Float[np.ndarray, "U 3"], num_candidates: int
) -> tuple[Int[np.ndarray, "T C"], Float[np.ndarray, " T"]]:
    """Find the units nearest to each tile's center."""
    distances, candidates = query_tree(cKDTree(units), tiles.centers, k=num_candidates)
    candidates = candidates.reshape(len(tiles.centers), num_candidates).astype(np.int32)
    reach = distances.reshape(len(tiles.centers), num_candidates)[:, -1]
    return candidates, reach if num_candidates < len(units) else np.full(len(reach), np.inf)


@partial(jax.jit, static_argnames="k")
def search_tiles(
    samples: Float[jax.Array, "T S 3"],
    units: Float[jax.Array, "U 3"],
    candidates: Int[jax.Array, "T C"],
    k: int,
) -> tuple[Int[jax.Array, "T S k"], Float[jax.Array, "T S k"]]:
    """Find each sample's k nearest among its tile's candidates."""
    near = units[candidates]
    coordinates = jnp.moveaxis(samples, 2, 0)

    def look_at(best: tuple[jax.Array, ...], place: jax.Array) -> tuple[tuple[jax.Array, ...], None]:
        squared = sum(jnp.square(coordinates[axis] - near[:, place, axis][:, None]) for axis in range(3))
        key = (jax.lax.bitcast_convert_type(jnp.asarray(squared), jnp.int32) & ~_PLACE_MASK) | place
        kept = []
        for rank in range(k):
            kept.append(jnp.minimum(best[rank], key))
            key = jnp.maximum(best[rank], key)
        return tuple(kept), None

    start = tuple(jnp.full(samples.shape[:2], _FARTHEST, jnp.int32) for _ in range(k))
    places = jnp.arange(candidates.shape[1], dtype=jnp.int32)
    best, _ = jax.lax.scan(look_at, start, places)
    keys = jnp.stack(best, axis=-1)
    flat = (keys & _PLACE_MASK).reshape(len(candidates), -1)
    winners = jnp.take_along_axis(candidates, flat, axis=1).reshape(keys.shape)
    return winners, jax.lax.bitcast_convert_type(keys & ~_PLACE_MASK, jnp.float32)


def search_all(tiles: Tiles, units: Float[np.ndarray, "U 3"], k: int) -> Int[np.ndarray, "T S k"]:
    """Find the k nearest units of every slot; by a k-d tree where a tile outgrows its list."""
    units = np.ascontiguousarray(units, dtype=np.float32)
    num_candidates = max(k, choose_num_candidates(tiles.order.size, len(units), k))
    candidates, reach = find_candidates(tiles, units, num_candidates)
    padded = pad_rows(units, padded_length(len(units)))
    found, squared = search_tiles(jnp.asarray(tiles.samples), jnp.asarray(padded), jnp.asarray(candidates), k)
    winners = np.array(found)
    offset = compute_lengths(tiles.samples - tiles.centers[:, None])
    is_doubtful = np.sqrt(np.asarray(squared)[..., -1]) * (1 + _TIE) + offset > reach[:, None]
    if is_doubtful.any():
        _, exact = cKDTree(units).query(tiles.samples[is_doubtful], k=k)
        winners[is_doubtful] = exact.reshape(-1, k)
    return winners
