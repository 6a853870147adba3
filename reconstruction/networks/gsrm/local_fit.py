"""Fit a part of a mesh to its samples while the rest stands still; few shapes, so that little is compiled."""

from functools import partial
from typing import TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction.networks.som.padding import half_octave_length, pad_rows
from reconstruction.networks.surface_fit import (
    FitConfig,
    find_chunk,
    make_ring,
    mean_edge_length,
    solve_moments,
    sum_moments,
)
from reconstruction.surfaces.edge_flips import flip_edges
from reconstruction.surfaces.unfolding import unfold_faces

_MIN_ROOM = 1024
"""Samples for which there is room at least; with the next two few programs are compiled."""
_SAMPLES_PER_VERTEX = 4
"""There is room for one vertex for this many samples."""
_MIN_DEPTH = 12
"""There is room for at least this many faces around a vertex."""
_FAR = 1e6
"""Where padded vertices stand, in mean edges: no sample is near, and squares stay finite in float32."""

Rounds: TypeAlias = tuple[tuple[int, int], ...]
"""Rounds of a fit: iterations, and samples of each movable vertex that take part."""


def fit_turning(
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    is_movable: Bool[np.ndarray, " V"],
    is_inner: Bool[np.ndarray, " F"],
    samples: Float[np.ndarray, "N 3"],
    winners: Int[np.ndarray, " N"],
    config: FitConfig,
    rounds: Rounds,
) -> tuple[Float[np.ndarray, "V 3"], Int[np.ndarray, "F 3"]]:
    """Return the vertices fitted to their samples and unfolded, and the faces with edges turned along the creases.

    Args:
        vertices: positions, each with a face.
        faces: vertex indices of an oriented two-manifold.
        is_movable: the other vertices stay where they are.
        is_inner: which faces may change.
        samples: positions.
        winners: nearest vertex of every sample.
        config: configuration of the fit.
        rounds: number of rounds of the fit; between two of them edges are turned.
    """
    faces = faces.copy()
    for turn, (iterations, most) in enumerate(rounds):
        if turn > 0:
            faces[is_inner] = flip_edges(vertices, faces[is_inner])
        stride = max(1, len(samples) // (most * max(int(is_movable.sum()), 1)))
        vertices = fit_part(
            vertices, faces, is_movable, samples[::stride], winners[::stride], iterations, config
        )
    return np.where(is_movable[:, None], unfold_faces(vertices, faces), vertices), faces


def fit_part(
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    is_movable: Bool[np.ndarray, " V"],
    samples: Float[np.ndarray, "N 3"],
    winners: Int[np.ndarray, " N"],
    iterations: int,
    config: FitConfig,
) -> Float[np.ndarray, "V 3"]:
    """Return the vertices, the movable ones moved so that the faces lie on the samples (see `surface_fit`).

    Args:
        vertices: positions.
        faces: vertex indices.
        is_movable: the other vertices stay where they are.
        samples: positions.
        winners: nearest vertex of every sample, one that has a face.
        iterations: how often to repeat.
        config: configuration of the fit.
    """
    if len(faces) == 0 or len(samples) == 0 or not is_movable.any():
        return vertices.copy()
    center, scale = vertices.mean(axis=0), mean_edge_length(vertices, faces)
    room = half_octave_length(max(len(samples), _SAMPLES_PER_VERTEX * len(vertices), _MIN_ROOM))
    capacity = room // _SAMPLES_PER_VERTEX
    ring = make_ring(faces, len(vertices))
    depth = _MIN_DEPTH
    while depth < ring.shape[1]:
        depth *= 2
    ring = np.pad(ring, ((0, 0), (0, depth - ring.shape[1]), (0, 0)), constant_values=-1)
    scaled = np.asarray((vertices - center) / scale, dtype=np.float32)
    moved = _fit(
        pad_rows(scaled, capacity, _FAR),
        pad_rows(ring, capacity, -1),
        pad_rows(is_movable, capacity, False),
        pad_rows(np.asarray((samples - center) / scale, dtype=np.float32), room),
        pad_rows(np.asarray(winners, dtype=np.int32), room),
        pad_rows(np.ones(len(samples), np.float32), room),
        np.int32(iterations),
        config=config,
        chunk=find_chunk(room),
    )
    step = np.asarray(moved)[: len(vertices)] - scaled
    return np.where(is_movable[:, None], vertices + step.astype(np.float64) * scale, vertices)


@partial(jax.jit, static_argnames=("config", "chunk"))
def _fit(
    vertices: Float[jax.Array, "V 3"],
    ring: Int[jax.Array, "V D 2"],
    is_movable: Bool[jax.Array, " V"],
    samples: Float[jax.Array, "N 3"],
    winners: Int[jax.Array, " N"],
    weights: Float[jax.Array, " N"],
    iterations: Int[jax.Array, ""],
    *,
    config: FitConfig,
    chunk: int,
) -> Float[jax.Array, "V 3"]:
    def iterate(_, positions):
        moments = sum_moments(positions, ring, samples, winners, weights, config, chunk=chunk)
        step = solve_moments(moments, config.stiffness, config.step_limit)
        return positions + jnp.where(is_movable[:, None], step, 0.0)

    return jax.lax.fori_loop(0, iterations, iterate, vertices)
