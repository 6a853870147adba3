"""Whether a terrain is made of few planes, and which."""

from __future__ import annotations

from collections.abc import Callable

import trimesh

from symbrion_gym._src.contact.planes import Planes, find_planes
from symbrion_gym._src.contact.seams import share_planes

_SCALES = (1.0, 2.0)
"""Planes are looked for within these multiples of the accuracy, until few enough are found."""
_FEW_PLANES = 32  # Few enough are these: each slab needs one plane or more
_SIMILAR_PLANES = 1.25  # Or no more than this many times those at the coarsest scale
_MOST_PLANES = 40  # A terrain of more planes is rough ground, for which slabs are no model
_HELD = 0.7  # Share of the ground that planes hold; of less, it is rough
MAX_SLABS = 64  # No more slabs than these: beyond, patches follow the ground as well in less time
MAX_UNITED = 24
"""No more slabs go to coacd, whose time grows faster, or have their seams closed: that compares every one with
all others."""
MAX_PARTS = 16  # Slabs are not cut at creases into more parts than these


def select_few_planes(
    top: trimesh.Trimesh,
    accuracy: float,
    is_exceeded: Callable[[], bool],
) -> tuple[Planes, float]:
    """Return the finest planes that are few enough, or about as few as coarser ones, and their tolerance [m].

    Regions that lie apart on one plane share it.
    """
    found: list[tuple[Planes, float]] = []
    for scale in _SCALES:
        planes = find_planes(top, scale * accuracy, is_exceeded=is_exceeded)
        if len(planes.normals) <= _MOST_PLANES:
            planes = share_planes(top, planes, accuracy)
        found.append((planes, scale * accuracy))
        if len(planes.normals) <= _FEW_PLANES or is_exceeded():
            return found[-1]
    fewest = min(len(planes.normals) for planes, _ in found)
    return next(pair for pair in found if len(pair[0].normals) <= _SIMILAR_PLANES * fewest)


def is_smooth(top: trimesh.Trimesh, planes: Planes) -> bool:
    """Return whether a few planes hold most of a terrain."""
    areas = top.area_faces
    held = float(areas[planes.labels >= 0].sum() / areas.sum())
    return held >= _HELD and 0 < len(planes.normals) <= _MOST_PLANES
