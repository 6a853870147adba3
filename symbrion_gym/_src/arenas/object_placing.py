"""Objects that were found in a scan, placed in its arena."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import trimesh

from reconstruction._src.geometry.mesh_repair import simplify
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.placed_objects import PlacedObject
from symbrion_gym._src.errors import ArenaError

MAX_FACES = 2000  # Meshes with more faces are simplified to as many


def place_objects(arena: Arena, found: Iterable[Any], meshes: Mapping[str, trimesh.Trimesh]) -> Arena:
    """Return an arena with objects that were found in its scan, as `arena.objects`.

    Args:
        arena: stays as it is; its offset is subtracted from the positions. Of its objects those of other names are
            kept.
        found: what `reconstruction.find_objects` returned.
        meshes: the objects' meshes, by name.

    Raises:
        ArenaError: an object has no mesh, or cannot be placed.
    """
    placed = [each for each in arena.objects if each.name not in meshes]
    for each in found:
        if each.name not in meshes:
            raise ArenaError(f"no mesh for object {each.name!r}; there are: {', '.join(meshes) or 'none'}")
        position = np.asarray(each.position, np.float64) - np.asarray(arena.offset)
        placed.append(PlacedObject(each.name, position, each.rotation, _lighten(meshes[each.name])))
    return replace(arena, objects=tuple(placed))


def _lighten(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
    if len(faces) > MAX_FACES:
        vertices, faces = simplify(vertices, faces, MAX_FACES)
    return trimesh.Trimesh(np.round(vertices, 6), faces, process=False)
