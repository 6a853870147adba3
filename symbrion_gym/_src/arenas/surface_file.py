"""Mesh files: those that arenas are made of, and OBJ as arenas are saved and exported."""

from pathlib import Path
from typing import TypeAlias

import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction._src.base.bounded_read import UnreadableFileError, find_npz_names
from reconstruction._src.base.errors import ScanError
from reconstruction._src.base.printable import make_printable
from reconstruction._src.surfaces.color import WHITE, add_alpha, find_vertex_colors
from symbrion_gym._src.arenas.texture import SurfaceTexture
from symbrion_gym._src.errors import ArenaError


def check_has_surface(path: Path) -> None:
    """Refuse a file of points, which has no surface."""
    if path.is_file() and _holds_points(path):
        stem = path.name.split(".")[0] or "surface"
        raise ArenaError(
            f"{path} holds points without a surface; first: symbrion reconstruct {path} --out {stem}-surface.npz "
            "(with its --unit, --up or --scale, if it needs one)"
        )


def _holds_points(path: Path) -> bool:
    """Return whether a file holds points, rather than faces or a reconstruction; False where it is damaged."""
    from reconstruction._src.scans.cloud_file import POINT_ENDINGS
    from reconstruction._src.scans.mesh_files import find_kind, is_mesh

    kind = find_kind(path)
    try:
        if kind == ".npz":
            names = set(find_npz_names(path))
            return bool({"points", "ranges"} & names) and "header" not in names
        return kind in POINT_ENDINGS or (kind in (".ply", ".obj") and not is_mesh(path))
    except (ScanError, UnreadableFileError, OSError):
        return False


_LARGEST = 2**30  # Bytes of one mesh; a million faces take 0.06 GB
_COLOR_DIGITS = 4  # Decimals of a channel: enough for bytes


LoadedObj: TypeAlias = tuple[trimesh.Trimesh, Float[np.ndarray, "F 3 2"] | None]
"""A mesh exactly as its file has it, and the places of the corners of its faces in a texture; None without one."""


def load_obj(path: Path) -> LoadedObj:
    """Read what `format_obj` wrote."""
    # Not by trimesh: it gives corners with several places in the texture vertices of their own.
    if not path.is_file():
        raise ArenaError(f"{path} is missing; build the arena again with make_arena")
    try:
        if path.stat().st_size > _LARGEST:
            raise ValueError(f"larger than {_LARGEST // 2**30} GB")
        return _parse_obj(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, OverflowError) as error:
        raise ArenaError(
            f"{path}: not a mesh of triangles ({make_printable(error, 200)}); build the arena again with make_arena"
        ) from error


def _parse_obj(text: str) -> LoadedObj:
    rows: dict[str, list[list[str]]] = {"v": [], "f": [], "vt": []}
    for line in text.splitlines():
        kind, _, rest = line.partition(" ")
        if kind in rows:
            rows[kind].append(rest.split())
    is_colored = bool(rows["v"]) and len(rows["v"][0]) == 6
    counts = {"v": 6 if is_colored else 3, "f": 3, "vt": 2}
    for kind, name in (("v", "vertex"), ("f", "face"), ("vt", "place in the texture")):
        wrong = next((row for row in rows[kind] if len(row) != counts[kind]), None)
        if wrong is not None:
            raise ValueError(f"the {name} {' '.join(wrong)!r} has {len(wrong)} entries, not {counts[kind]}")
    values = np.array(rows["v"], dtype=np.float64).reshape(-1, counts["v"])
    corners = [word.split("/") for row in rows["f"] for word in row]
    places = np.array(rows["vt"], dtype=np.float64)
    uv = None
    if len(places):
        numbers = [words[1] if len(words) > 1 else "0" for words in corners]
        corners = [words[:1] for words in corners]
        uv = places[_as_indices(numbers, len(places), "place in the texture")]
    faces = _as_indices(["/".join(words) for words in corners], len(values), "vertex")
    mesh = trimesh.Trimesh(np.ascontiguousarray(values[:, :3]), faces, process=False)
    if is_colored:
        colors = np.clip(np.round(WHITE * values[:, 3:]), 0, WHITE).astype(np.uint8)
        mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=add_alpha(colors))
    return mesh, uv


def _as_indices(words: list[str], count: int, what: str) -> np.ndarray:
    """Return the numbers of the corners of faces, which OBJ counts from 1."""
    numbers = np.array(words, dtype=np.int64).reshape(-1, 3) - 1
    if len(numbers) and (numbers.min() < 0 or numbers.max() >= count):
        raise ValueError(f"a face names a {what} that is not there")
    return numbers


def format_obj(
    mesh: trimesh.Trimesh, texture: SurfaceTexture | None = None, digits: int = 6, used: int = 0
) -> bytes:
    """Return a mesh as OBJ: colors of its vertices behind their places, places in a texture as `vt`.

    `used` is the number of vertices before it in the file: OBJ counts them over all objects, from 1.
    """
    # + 0.0 turns -0.0 into 0.0.
    vertices = np.round(np.asarray(mesh.vertices, dtype=np.float64), digits) + 0.0
    lines = [f"v {x:.{digits}f} {y:.{digits}f} {z:.{digits}f}" for x, y, z in vertices.tolist()]
    faces = (np.asarray(mesh.faces) + 1 + used).tolist()
    if texture is None:
        lines += [f"f {a} {b} {c}" for a, b, c in faces]
        return ("\n".join(lines) + "\n").encode()
    colors = find_vertex_colors(mesh)
    if colors is not None:
        ends = [" ".join(f"{share:.{_COLOR_DIGITS}f}" for share in row) for row in (colors / WHITE).tolist()]
        lines = [f"{line} {end}" for line, end in zip(lines, ends, strict=True)]
    lines += [f"vt {u:.12g} {v:.12g}" for u, v in texture.uv.reshape(-1, 2).tolist()]
    corners = enumerate(faces)
    lines += [f"f {a}/{3 * i + 1} {b}/{3 * i + 2} {c}/{3 * i + 3}" for i, (a, b, c) in corners]
    return ("\n".join(lines) + "\n").encode()
