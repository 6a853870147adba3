"""Fit a part of a mesh to its samples while the rest stands still; few shapes, so that little is compiled."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from reconstruction.networks.som.padding import pad_rows
from reconstruction.networks.surface_fit import (
    REACH,
    STEP_LIMIT,
    STIFFNESS,
    find_chunk,
    make_ring,
    mean_edge_length,
    solve_moments,
    sum_moments,
)
from reconstruction.surfaces.edge_flips import flip_edges
from reconstruction.surfaces.unfolding import unfold_faces

LEAST_SAMPLES = 1024
SAMPLES_PER_VERTEX = 4
"""Room is made for one vertex for so many samples."""
LEAST_DEPTH = 12
"""Room is made for so many faces round a vertex."""
FAR = 1e6
"""Where padded vertices stand."""
STEPS = ((2, 12), (1, 28))
"""Iterations of the fit, and samples of each movable vertex that take part: before edges are turned along the
creases that have come out, and after."""


def fit_turning(
    vertices: np.ndarray,
    faces: np.ndarray,
    is_movable: np.ndarray,
    is_inner: np.ndarray,
    samples: np.ndarray,
    winners: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices fitted to their samples and unfolded, and the faces with edges turned along the creases.

    Args:
        vertices: `[V, 3]`, each with a face.
        faces: `[F, 3]` of an oriented two-manifold.
        is_movable: `[V]`; the others stay where they are.
        is_inner: `[F]` which faces may change.
        samples: `[N, 3]`.
        winners: `[N]` nearest vertex of every sample.
    """
    faces = faces.copy()
    for turn, (iterations, most) in enumerate(STEPS):
        if turn > 0:
            faces[is_inner] = flip_edges(vertices, faces[is_inner])
        chosen = slice(None, None, max(1, len(samples) // (most * max(int(is_movable.sum()), 1))))
        vertices = fit_part(vertices, faces, is_movable, samples[chosen], winners[chosen], iterations)
    return np.where(is_movable[:, None], unfold_faces(vertices, faces), vertices), faces


def fit_part(
    vertices: np.ndarray,
    faces: np.ndarray,
    is_movable: np.ndarray,
    samples: np.ndarray,
    winners: np.ndarray,
    iterations: int,
) -> np.ndarray:
    """Return the vertices, the movable ones moved so that the faces lie on the samples (see `surface_fit`).

    Args:
        vertices: `[V, 3]`.
        faces: `[F, 3]`.
        is_movable: `[V]`.
        samples: `[N, 3]`.
        winners: `[N]` nearest vertex of every sample, one that has a face.
        iterations: how often to repeat.
    """
    if len(faces) == 0 or len(samples) == 0 or not is_movable.any():
        return vertices.copy()
    center, scale = vertices.mean(axis=0), mean_edge_length(vertices, faces)
    wanted = max(len(samples), SAMPLES_PER_VERTEX * len(vertices), LEAST_SAMPLES)
    step = 2 ** ((wanted - 1).bit_length() - 2)  # two sizes an octave
    room = -(-wanted // step) * step
    capacity = room // SAMPLES_PER_VERTEX
    ring = make_ring(faces, len(vertices))
    depth = LEAST_DEPTH
    while depth < ring.shape[1]:
        depth *= 2
    ring = np.pad(ring, ((0, 0), (0, depth - ring.shape[1]), (0, 0)), constant_values=-1)
    scaled = np.asarray((vertices - center) / scale, dtype=np.float32)
    moved = _fit(
        pad_rows(scaled, capacity, FAR),
        pad_rows(ring, capacity, -1),
        pad_rows(is_movable, capacity, False),
        pad_rows(np.asarray((samples - center) / scale, dtype=np.float32), room),
        pad_rows(np.asarray(winners, dtype=np.int32), room),
        pad_rows(np.ones(len(samples), np.float32), room),
        np.int32(iterations),
        chunk=find_chunk(room),
    )
    step = np.asarray(moved)[: len(vertices)] - scaled
    return np.where(is_movable[:, None], vertices + step.astype(np.float64) * scale, vertices)


@partial(jax.jit, static_argnames="chunk")
def _fit(vertices, ring, is_movable, samples, winners, weights, iterations, *, chunk):
    def iterate(_, positions):
        moments = sum_moments(positions, ring, samples, winners, weights, REACH, chunk=chunk)
        step = solve_moments(moments, STIFFNESS, STEP_LIMIT)
        return positions + jnp.where(is_movable[:, None], step, 0.0)

    return jax.lax.fori_loop(0, iterations, iterate, vertices)
