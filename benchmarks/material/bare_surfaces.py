"""Arenas that know nothing but a surface: what was seen, turned and moved as one likes."""

from __future__ import annotations

import trimesh

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.contact.quality import ArenaQuality


def make_bare(surface: trimesh.Trimesh, yaw: float = 0.0, move: tuple[float, float] = (0.0, 0.0)) -> Arena:
    """Return an arena without course and contact geometry.

    Args:
        surface: its surface.
        yaw: angle by which it is turned about z [rad].
        move: (x, y) by which it is moved after that [m].
    """
    pose = trimesh.transformations.rotation_matrix(yaw, [0, 0, 1])
    pose[:2, 3] = move
    turned = surface.copy().apply_transform(pose)
    return Arena("bare", [], turned, ArenaQuality(mean=0.0, p95=0.0, max=0.0, num_pieces=0))
