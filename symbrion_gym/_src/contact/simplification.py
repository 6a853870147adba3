"""The coarsest triangles that follow a surface closely enough."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float

from symbrion_gym._src.contact.acceptance import AcceptanceConfig
from symbrion_gym._src.contact.distances import SurfaceDistance


@dataclass(frozen=True)
class SimplificationConfig:
    """How far a surface is simplified.

    Attributes:
        share: the error of simplification is this share of what patches aim at; joining triangles takes the rest.
        fewest: number of triangles that is tried first.
        growth: factor between the numbers that are tried.
        worst: of a drawn surface no place is farther off than this many times what patches aim at: it has no noise,
            and one edge too few takes a tread away, which no mean shows. A scan has spikes of noise, which cost pieces.
        drawn: a surface is drawn where at least this share of its area lies in faces that are flat with a neighbor ...
        flat: ... to within this angle [rad]: noise never leaves two triangles as flat.
    """

    share: float = 0.6
    fewest: int = 12
    growth: float = 1.12
    worst: float = 3.0
    drawn: float = 0.5
    flat: float = 1e-3


SIMPLIFICATION_DEFAULTS = SimplificationConfig()


def is_drawn(surface: trimesh.Trimesh, config: SimplificationConfig = SIMPLIFICATION_DEFAULTS) -> bool:
    """Return whether a surface was drawn, not scanned: most of its faces are flat with a neighbor."""
    pairs = np.asarray(surface.face_adjacency).reshape(-1, 2)
    is_flat = np.zeros(len(surface.faces), dtype=bool)
    is_flat[pairs[np.asarray(surface.face_adjacency_angles) < config.flat].ravel()] = True
    areas = np.asarray(surface.area_faces)
    return bool(areas[is_flat].sum() >= config.drawn * areas.sum())


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
    is_exact: bool = False,
) -> int:
    """Return the index in `list_counts` of the fewest triangles that follow the samples closely enough."""
    worst = config.worst * accuracy if is_exact else float("inf")
    counts = list_counts(len(surface.faces), config)
    low, high = 0, len(counts) - 1
    while low < high:
        middle = (low + high) // 2
        simple = simplify_surface(surface, counts[middle])
        gaps = distance.measure_mesh(np.asarray(simple.vertices), np.asarray(simple.faces))
        is_close = _is_close(gaps, distance.config.uncovered, accuracy, acceptance, config.share)
        if is_close and gaps.max() <= worst:
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
