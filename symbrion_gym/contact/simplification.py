"""The coarsest triangles that follow a surface closely enough."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float

from symbrion_gym.contact.acceptance import AcceptanceConfig
from symbrion_gym.contact.distances import SurfaceDistance


@dataclass(frozen=True)
class SimplificationConfig:
    """How far a surface is simplified.

    Attributes:
        share: the error of simplification is this share of what patches aim at; joining triangles takes the rest.
        fewest: number of triangles that is tried first.
        growth: factor between the numbers that are tried.
    """

    share: float = 0.6
    fewest: int = 12
    growth: float = 1.12


SIMPLIFICATION_DEFAULTS = SimplificationConfig()


def list_counts(num_faces: int, config: SimplificationConfig = SIMPLIFICATION_DEFAULTS) -> list[int]:
    """Return the numbers of triangles that are tried, the fewest first; the last is all."""
    steps = int(np.ceil(np.log(max(num_faces / config.fewest, 1.0)) / np.log(config.growth)))
    return [*(int(config.fewest * config.growth**k) for k in range(steps)), num_faces]


def find_simple(
    surface: trimesh.Trimesh,
    distance: SurfaceDistance,
    accuracy: float,
    acceptance: AcceptanceConfig,
    config: SimplificationConfig = SIMPLIFICATION_DEFAULTS,
) -> int:
    """Return the index in `list_counts` of the fewest triangles that follow the samples closely enough.

    Args:
        surface: manifold.
        distance: samples of the exact surface.
        accuracy: mean distance of contact that is aimed at [m].
        acceptance: other wanted figures.
        config: how far it is simplified.
    """
    counts = list_counts(len(surface.faces), config)
    low, high = 0, len(counts) - 1
    while low < high:
        middle = (low + high) // 2
        simple = simplify_surface(surface, counts[middle])
        gaps = distance.measure_mesh(np.asarray(simple.vertices), np.asarray(simple.faces))
        if _is_close(gaps, distance.config.uncovered, accuracy, acceptance, config.share):
            high = middle
        else:
            low = middle + 1
    return low


def _is_close(
    gaps: Float[np.ndarray, " N"], reach: float, accuracy: float, acceptance: AcceptanceConfig, share: float
) -> bool:
    return bool(
        gaps.mean() <= share * accuracy
        and np.percentile(gaps, 95) <= share * acceptance.p95 * accuracy
        and (gaps > reach).mean() <= share * acceptance.uncovered
    )


def simplify_surface(surface: trimesh.Trimesh, count: int) -> trimesh.Trimesh:
    """Return a surface of about `count` triangles; its boundary stays where it is.

    References:
        Garland, Heckbert (1997), Surface simplification using quadric error metrics; by libigl, which keeps
        boundaries (fast-simplification moves them by meters).
    """
    import igl

    if count >= len(surface.faces):
        return surface
    found = igl.qslim(
        np.asarray(surface.vertices, dtype=np.float64, order="F"),
        np.asarray(surface.faces, dtype=np.int32, order="F"),
        count,
    )
    vertices, faces = (np.ascontiguousarray(array) for array in found[:2])
    simple = trimesh.Trimesh(vertices, faces, process=False)
    is_sound = len(faces) > 0 and bool(np.isfinite(vertices).all())
    return simple if is_sound else surface
