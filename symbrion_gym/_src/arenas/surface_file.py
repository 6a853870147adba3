"""Mesh files that arenas are made of."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path

import trimesh

from reconstruction._src.base.bounded_read import MAX_BYTES, UnreadableFileError, check_size, find_npz_names
from reconstruction._src.base.errors import ScanError
from symbrion_gym._src.errors import ArenaError

_UNBOUNDED = (".bz2", ".gz", ".tbz2", ".tgz", ".xz")
"""Packings that trimesh unpacks whatever their size; `zip` tells its size."""


_POINT_ENDINGS = (
    ".xyz",
    ".txt",
    ".csv",
    ".asc",
    ".dat",
    ".pts",
    ".npy",
    ".pcd",
    ".vtk",
    ".las",
    ".laz",
    ".e57",
    ".3d",
)
"""Files that hold points alone; .ply and .obj hold either."""


def check_has_surface(path: Path) -> None:
    """Refuse a file of points, which has no surface."""
    if path.is_file() and _holds_points(path):
        stem = path.name.split(".")[0] or "surface"
        raise ArenaError(
            f"{path} holds points without a surface; first: symbrion reconstruct {path} --out {stem}-surface.npz"
        )


def _holds_points(path: Path) -> bool:
    """Return whether a file holds points, rather than faces or a reconstruction; False where it is damaged."""
    from reconstruction._src.scans.mesh_files import is_mesh
    from reconstruction._src.scans.point_files import find_kind

    kind = find_kind(path)
    try:
        if kind == ".npz":
            return bool({"points", "ranges"} & set(find_npz_names(path))) and "header" not in find_npz_names(
                path
            )
        return kind in _POINT_ENDINGS or (kind in (".ply", ".obj") and not is_mesh(path))
    except (ScanError, UnreadableFileError, OSError):
        return False


def load_surface(path: str | os.PathLike[str]) -> trimesh.Trimesh:
    """Read a mesh file in any format that trimesh knows; of packed ones .zip and .3mf alone."""
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
