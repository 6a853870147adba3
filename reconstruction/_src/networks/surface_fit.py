"""Fit a finished mesh to its samples by least squares: creases get sharp, the boundary comes out to the data.

A self-organizing map ends with every unit at the mean of the samples it wins. That rounds off edges and draws the
boundary inwards by half a cell. The fit takes the surface for what it is, a union of triangles, and moves the
vertices until the triangles, not the vertices, lie on the samples.
"""

from functools import partial

import jax
import numpy as np
from jaxtyping import Bool, Float, Int, Num

from reconstruction._src.geometry.rows import Faces, Vertices, compute_lengths
from reconstruction._src.networks.least_squares import FitConfig, compute_chunk, fit_once
from reconstruction._src.networks.som.compilation import half_octave_length, pad_rows, padded_length

_MIN_SAMPLES = 1024  # There is room for at least this many samples: smaller meshes share their programs
_SAMPLES_PER_VERTEX = 4
"""Where few programs are to be compiled, there is room for one vertex for this many samples."""
_MIN_DEPTH = 12
"""Where few programs are to be compiled, there is room for this many faces around a vertex, or for twice as many, and
so on."""
_CONFIG = FitConfig()  # How a mesh is fitted


def fit_surface(
    vertices: Num[np.ndarray, "V 3"],
    faces: Faces,
    samples: Num[np.ndarray, "N 3"],
    *,
    iterations: int = 3,
    winners: Int[np.ndarray, " N"],
    weights: Num[np.ndarray, " N"] | None = None,
    is_movable: Bool[np.ndarray, " V"] | None = None,
) -> Vertices:
    """Return vertices moved so that the faces lie on the samples (see `least_squares`).

    Samples beyond the boundary pull it out. Outliers count little: the weight falls with the part of the residual along
    the face's normal (Cauchy), and vanishes beyond `FitConfig.reach`.
    """
    vertices = np.asarray(vertices, dtype=np.float64)
    faces = np.asarray(faces)
    if len(faces) == 0 or len(samples) == 0 or iterations <= 0:
        return vertices.copy()
    center, scale = vertices.mean(axis=0), mean_edge_length(vertices, faces)
    if not scale > 0:
        return vertices.copy()
    ring = make_ring(faces, len(vertices), doubling=is_movable is not None)
    if is_movable is not None:
        num_samples = half_octave_length(max(len(samples), _SAMPLES_PER_VERTEX * len(vertices), _MIN_SAMPLES))
        num_vertices = num_samples // _SAMPLES_PER_VERTEX
    else:
        num_samples, num_vertices = padded_length(len(samples), _MIN_SAMPLES), padded_length(len(vertices))
    weights = np.ones(len(samples), np.float32) if weights is None else np.asarray(weights, np.float32)
    scaled = pad_rows(np.asarray((vertices - center) / scale, dtype=np.float32), num_vertices)
    ring = pad_rows(ring, num_vertices, -1)
    is_movable = None if is_movable is None else pad_rows(is_movable, num_vertices, False)
    samples = pad_rows(np.asarray((samples - center) / scale, dtype=np.float32), num_samples)
    winners = pad_rows(np.asarray(winners, dtype=np.int32), num_samples)
    weights = pad_rows(weights, num_samples)
    moved = _fit(
        scaled,
        ring,
        is_movable,
        samples,
        winners,
        sort_by_degree(ring, winners) if is_movable is None else None,
        weights,
        np.int32(iterations),
        config=_CONFIG,
        chunk=compute_chunk(num_samples),
    )
    step = np.asarray(moved - scaled)[: len(vertices)]
    return vertices + step.astype(np.float64) * scale


def mean_edge_length(vertices: Vertices, faces: Faces) -> float:
    """Return the mean length of the faces' sides."""
    corners = vertices[faces]
    return float(compute_lengths(corners - np.roll(corners, 1, axis=1)).mean())


def make_ring(faces: Faces, num_vertices: int, *, doubling: bool = False) -> Int[np.ndarray, "V D 2"]:
    """Return the faces around every vertex: the other two corners of each in order, -1 where none."""
    owner = faces.ravel()
    others = np.stack([faces[:, [1, 2]], faces[:, [2, 0]], faces[:, [0, 1]]], axis=1).reshape(-1, 2)
    order = np.argsort(owner, kind="stable")
    count = np.bincount(owner, minlength=num_vertices)
    widest = int(count.max(initial=1))
    depth = -(-widest // 4) * 4
    if doubling:
        depth = _MIN_DEPTH * 2 ** max(0, (-(-widest // _MIN_DEPTH) - 1).bit_length())
    slot = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    ring = np.full((num_vertices, depth, 2), -1, dtype=np.int32)
    ring[owner[order], slot] = others[order]
    return ring


def sort_by_degree(ring: Int[np.ndarray, "V D 2"], winners: Int[np.ndarray, " N"]) -> Int[np.ndarray, " N"]:
    """Return the order of samples in which the numbers of faces round their winners rise."""
    degree = (ring[..., 0] >= 0).sum(axis=1).astype(np.uint16)
    return np.argsort(degree[winners], kind="stable").astype(np.int32)


@partial(jax.jit, static_argnames=("config", "chunk"))
def _fit(
    vertices: Float[jax.Array, "V 3"],
    ring: Int[jax.Array, "V D 2"],
    is_movable: Bool[jax.Array, " V"] | None,
    samples: Float[jax.Array, "N 3"],
    winners: Int[jax.Array, " N"],
    order: Int[jax.Array, " N"] | None,
    weights: Float[jax.Array, " N"],
    iterations: Int[jax.Array, ""],
    *,
    config: FitConfig,
    chunk: int,
) -> Float[jax.Array, "V 3"]:
    """Repeat the step; all lengths in mean edges. Only whole meshes need an order."""

    def iterate(_, positions):
        return fit_once(
            positions,
            ring,
            samples,
            winners,
            weights,
            config,
            chunk=chunk,
            order=order,
            is_movable=is_movable,
        )

    return jax.lax.fori_loop(0, iterations, iterate, vertices)
