"""Fit a part of a mesh to its samples while the rest stands still."""

from typing import TypeAlias

import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction._src.networks.least_squares import FitConfig
from reconstruction._src.networks.surface_fit import fit_surface
from reconstruction._src.surfaces.edge_flips import flip_edges

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
    """Return the vertices fitted to their samples, and the faces with edges turned along the creases.

    Faces may fold or intersect: `unfold_part` takes that out once the whole map has learned.

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
        if is_movable.any():
            vertices = fit_surface(
                vertices,
                faces,
                samples[::stride],
                iterations=iterations,
                winners=winners[::stride],
                is_movable=is_movable,
                config=config,
            )
    return vertices, faces
