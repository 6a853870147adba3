"""Mesh files that arenas are made of."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path

import numpy as np
import trimesh
from jaxtyping import Float, Int, UInt8

from reconstruction._src.base.bounded_read import MAX_BYTES, UnreadableFileError, check_size, find_npz_names
from reconstruction._src.base.errors import ScanError
from reconstruction._src.base.printable import make_printable
from reconstruction._src.surfaces.color import WHITE, add_alpha, find_vertex_colors
from symbrion_gym._src.arenas.texture import SurfaceTexture
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
    from reconstruction._src.scans.mesh_files import find_kind, is_mesh

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


_LARGEST = 2**30  # Bytes of one mesh; a million faces take 0.06 GB
_COLORED = 6  # Entries of a vertex with a color
_COLOR_DIGITS = 4  # Decimals of a channel: enough for bytes


def load_obj(path: Path) -> trimesh.Trimesh:
    """Read a mesh exactly as the file has it."""
    return load_colored_obj(path)[0]


def load_colored_obj(path: Path) -> tuple[trimesh.Trimesh, Float[np.ndarray, "F 3 2"] | None]:
    """Read a mesh exactly as the file has it, with colors of its vertices, and places of its faces in a texture."""
    if not path.is_file():
        raise ArenaError(f"{path} is missing; build the arena again with make_arena")
    try:
        if path.stat().st_size > _LARGEST:
            raise ValueError(f"larger than {_LARGEST // 2**30} GB")
        vertices, colors, faces, uv = _parse(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, OverflowError) as error:
        raise ArenaError(
            f"{path}: not a mesh of triangles ({make_printable(error, 200)}); build the arena again with make_arena"
        ) from error
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    if colors is not None:
        mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=add_alpha(colors))
    return mesh, uv


def format_surface(mesh: trimesh.Trimesh, texture: SurfaceTexture | None, digits: int) -> bytes:
    """Return a mesh as a file: colors of its vertices behind their places, places in a texture as `vt`."""
    # + 0.0 turns -0.0 into 0.0.
    vertices = np.round(np.asarray(mesh.vertices, dtype=np.float64), digits) + 0.0
    lines = [f"v {x:.{digits}f} {y:.{digits}f} {z:.{digits}f}" for x, y, z in vertices.tolist()]
    colors = None if texture is None else find_vertex_colors(mesh)
    if colors is not None:
        shares = (colors / WHITE).tolist()
        ends = [" ".join(f"{value:.{_COLOR_DIGITS}f}" for value in row) for row in shares]
        lines = [f"{line} {end}" for line, end in zip(lines, ends, strict=True)]
    faces = (np.asarray(mesh.faces) + 1).tolist()
    if texture is None:
        lines += [f"f {a} {b} {c}" for a, b, c in faces]
    else:
        lines += [f"vt {u:.12g} {v:.12g}" for u, v in texture.uv.reshape(-1, 2).tolist()]
        corners = enumerate(faces)
        lines += [f"f {a}/{3 * i + 1} {b}/{3 * i + 2} {c}/{3 * i + 3}" for i, (a, b, c) in corners]
    return ("\n".join(lines) + "\n").encode()


def _parse(
    text: str,
) -> tuple[
    Float[np.ndarray, "V 3"],
    UInt8[np.ndarray, "V 3"] | None,
    Int[np.ndarray, "F 3"],
    Float[np.ndarray, "F 3 2"] | None,
]:
    """Return vertices, their colors, faces, and their places in a texture."""
    rows: dict[str, list[list[str]]] = {"v": [], "f": [], "vt": []}
    for line in text.splitlines():
        kind, _, rest = line.partition(" ")
        if kind in rows:
            rows[kind].append(rest.split())
    is_colored = bool(rows["v"]) and len(rows["v"][0]) == _COLORED
    counts = {"v": _COLORED if is_colored else 3, "f": 3, "vt": 2}
    for kind, name in (("v", "vertex"), ("f", "face"), ("vt", "place in the texture")):
        wrong = next((row for row in rows[kind] if len(row) != counts[kind]), None)
        if wrong is not None:
            raise ValueError(f"the {name} {' '.join(wrong)!r} has {len(wrong)} entries, not {counts[kind]}")
    values = np.array(rows["v"], dtype=np.float64).reshape(-1, counts["v"])
    vertices = np.ascontiguousarray(values[:, :3])
    uv = _find_places(rows["f"], rows["vt"]) if rows["vt"] else None
    if uv is not None:
        rows["f"] = [[word.partition("/")[0] for word in row] for row in rows["f"]]
    faces = np.array(rows["f"], dtype=np.int64).reshape(-1, 3) - 1
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise ValueError("a face names a vertex that is not there")
    colors = np.clip(np.round(WHITE * values[:, 3:]), 0, WHITE).astype(np.uint8) if is_colored else None
    return vertices, colors, faces, uv


def _find_places(faces: list[list[str]], rows: list[list[str]]) -> Float[np.ndarray, "F 3 2"]:
    """Return the places of the corners of faces in a texture."""
    numbers = np.array([[word.split("/")[1] if "/" in word else "0" for word in row] for row in faces], int)
    numbers = numbers.reshape(-1, 3) - 1
    if len(numbers) and (numbers.min() < 0 or numbers.max() >= len(rows)):
        raise ValueError("a face names a place in the texture that is not there")
    return np.array(rows, dtype=np.float64)[numbers]
