"""Mesh files that arenas are made of."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path

import trimesh

from reconstruction.files.bounded_read import MAX_BYTES, check_size
from symbrion_gym.errors import ArenaError

_UNBOUNDED = (".bz2", ".gz", ".tbz2", ".tgz", ".xz")
"""Packings that trimesh unpacks whatever their size; `zip` tells its size."""


def load_surface(path: str | os.PathLike[str]) -> trimesh.Trimesh:
    """Read a mesh file in any format that trimesh knows; of packed ones .zip and .3mf alone.

    Raises:
        ArenaError: no such file, too large once unpacked, or it holds no triangles.
    """
    path = Path(path)
    if not path.is_file():
        raise ArenaError(f"no mesh file {path}")
    if path.suffix.lower() in _UNBOUNDED:
        raise ArenaError(f"{path}: a packed mesh is not read; unpack it first")
    try:
        if zipfile.is_zipfile(path):  # .zip, .3mf; zipfile unpacks no member beyond the size stated here
            with zipfile.ZipFile(path) as archive:
                check_size(sum(member.file_size for member in archive.infolist()), MAX_BYTES)
        mesh = trimesh.load_mesh(path, process=False)
    except Exception as error:  # trimesh raises whatever its many readers raise
        raise ArenaError(f"{path}: cannot be read as a mesh ({error})") from error
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise ArenaError(f"{path}: holds no triangles; a point cloud wants reconstruct() first")
    return mesh
