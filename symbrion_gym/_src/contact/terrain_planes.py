"""The planes of a terrain: few enough for slabs, or too many."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import trimesh

from symbrion_gym._src.contact.planes import PlaneConfig, Planes, find_planes
from symbrion_gym._src.contact.shared_planes import SharingConfig, share_planes


@dataclass(frozen=True)
class SlabPassConfig:
    """Which terrains become slabs, and what is done with slabs.

    Attributes:
        scales: planes are looked for within these multiples of the accuracy, until few enough are found.
        few_planes: few enough are these: each slab needs one plane or more.
        similar_planes: or no more than this many times those at the coarsest scale.
        most_planes: a terrain of more planes is rough ground, for which slabs are no model.
        held: share of the ground that planes hold; of less, it is rough.
        max_slabs: no more slabs than these: beyond, patches follow the ground as well in less time.
        max_united: no more slabs go to coacd, whose time grows faster, or have their seams closed: that compares
            every one with all others.
        max_parts: slabs are not cut at creases into more parts than these.
        sharing: which regions share a plane.
    """

    scales: tuple[float, ...] = (1.0, 2.0)
    few_planes: int = 32
    similar_planes: float = 1.25
    most_planes: int = 40
    held: float = 0.7
    max_slabs: int = 64
    max_united: int = 24
    max_parts: int = 16
    sharing: SharingConfig = field(default_factory=SharingConfig)


def find_few_planes(
    top: trimesh.Trimesh,
    accuracy: float,
    config: SlabPassConfig,
    plane_config: PlaneConfig,
    is_exceeded: Callable[[], bool],
) -> tuple[Planes, float]:
    """Return the finest planes that are few enough, or about as few as coarser ones, and their tolerance [m].

    Regions that lie apart on one plane share it.
    """
    found: list[tuple[Planes, float]] = []
    for scale in config.scales:
        planes = find_planes(top, scale * accuracy, is_exceeded=is_exceeded, config=plane_config)
        if len(planes.normals) <= config.most_planes:
            planes = share_planes(top, planes, accuracy, config.sharing)
        found.append((planes, scale * accuracy))
        if len(planes.normals) <= config.few_planes or is_exceeded():
            return found[-1]
    fewest = min(len(planes.normals) for planes, _ in found)
    return next(pair for pair in found if len(pair[0].normals) <= config.similar_planes * fewest)


def is_smooth(top: trimesh.Trimesh, planes: Planes, config: SlabPassConfig) -> bool:
    """Return whether a few planes hold most of a terrain."""
    areas = top.area_faces
    held = float(areas[planes.labels >= 0].sum() / areas.sum())
    return held >= config.held and 0 < len(planes.normals) <= config.most_planes
