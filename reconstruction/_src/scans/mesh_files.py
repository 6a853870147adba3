"""Meshes, with their faces: .ply .obj .stl .off .glb .gltf .dae, read by trimesh."""

from __future__ import annotations

import json
import os
import re
import zipfile
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from reconstruction._src.base.bounded_read import (
    MAX_BYTES,
    PACKINGS,
    check_size,
    find_kind,
    name_file,
    open_bounded,
)
from reconstruction._src.base.errors import ScanError
from reconstruction._src.base.extras import require_extras
from reconstruction._src.scans.frames import RawPoints, find_offset, to_meters
from reconstruction._src.scans.ply import find_num_faces
from reconstruction._src.scans.text_points import has_obj_faces

if TYPE_CHECKING:
    import trimesh

_REMEDIES = {
    ".db3": "make it an .mcap by `ros2 bag convert`",
    ".pcap .pcapng": "export the frames as .las or .pcd with the maker's viewer (VeloView, Ouster Studio, PandarView)",
    ".rcp .rcs": "export it from Autodesk ReCap as .e57",
    ".fls .fws .lsproj": "export it from FARO SCENE as .e57",
    ".zfs .zfprj": "export it from Z+F LaserControl as .e57",
    ".imp .lgs": "export it from Leica Cyclone as .e57",
    ".rxp .rdbx": "export it from RIEGL RiSCAN PRO as .e57 or .las",
    ".ptx": "open it in CloudCompare and save it as .e57, which keeps the scanner's positions",
    ".bin": "open it in CloudCompare and save it as .ply or .e57",
    ".dp": "export it from Dot3D as .e57 or .ply",
    ".tif": "give the intrinsics of the camera if it is a depth image (`--intrinsics`); an elevation model becomes "
    ".xyz by `gdal_translate -of XYZ`",
    ".zip .7z": "unpack it, and give one of its files",
    ".xz": "unpack it with `unxz`",
    ".zst": "unpack it with `unzstd`",
    ".vtp .vtu": "save it from ParaView as .ply",
    ".usd .usdz .usda .usdc .fbx .blend .3ds": "export it from Blender as .glb",
    ".step .stp .iges .igs": "export it from the CAD program, or from FreeCAD, as .stl or .glb",
    ".hdf5 .h5": "save its points as .npy or .npz",
    ".mat": "save its points as .csv: writematrix(points, 'points.csv')",
    ".parquet": "save its columns x, y, z as .csv",
}
CONVERTERS = {ending: remedy for endings, remedy in _REMEDIES.items() for ending in endings.split()}
"""Ending of a file that is not read -> what to do with it."""
MESH_ENDINGS = (".ply", ".obj", ".stl", ".off", ".glb", ".gltf", ".dae")
"""Files that hold meshes; .ply and .obj also points alone."""
_GLTF = (".glb", ".gltf")
_FARTHEST = 1e15  # Coordinates beyond this are no place in any unit
_GLB_MAGIC, _GLB_HEADER = b"glTF", 20
"""A .glb begins with magic, version, length, and the length and kind of the JSON chunk: five numbers of 4 bytes."""
_VALUE_BYTES = 64  # Most bytes of an element of a glTF accessor: a matrix of 16 floats
_PART_VALUES = 100  # What trimesh keeps of a part besides, in such values
_COLLADA_HEAD = 1 << 16  # Bytes at the beginning of a .dae that hold its unit and axes
_COLLADA_UP = re.compile(rb"<up_axis>\s*([XYZ])_UP")
_COLLADA_UNIT = re.compile(rb"<unit\b[^>]*\bmeter\s*=\s*[\"']([0-9.eE+-]+)")


def load_mesh(
    path: str | os.PathLike[str],
    unit: str | None = None,
    up: str | None = None,
    scale: float = 1.0,
    max_bytes: float = MAX_BYTES,
) -> trimesh.Trimesh:
    """Read a mesh with its faces, in meters and with z up; all parts of a scene become one mesh.

    The faces keep the order of their vertices. What was subtracted from large coordinates, `[3]` [m], is
    ``mesh.metadata["offset"]``: see `load_cloud`; the axis of the file that points up, or None where nothing says it,
    ``mesh.metadata["up"]``.

    Args:
        path: .ply .obj .stl .off .glb .gltf .dae; not compressed.
        unit: "m", "cm", "mm", "ft", "us-ft" or "in"; None: what the file says (.gltf and .glb: meters; .dae its
            unit), meters where it does not.
        up: axis that points up: "x", "y", "z", "-x", "-y" or "-z"; None: what the format says (.gltf, .glb, .dae:
            mostly "y"), "z" where it does not.
        scale: a further factor, for files whose unit has no name.
        max_bytes: most bytes that the file may hold.

    Raises:
        ScanError: the file is absent, broken, too large, of another kind, or holds no triangles.
        MissingExtraError: a .dae is read and pycollada is not installed.
    """
    path = Path(path)
    with name_file(path):
        mesh, raw = read_mesh(path, max_bytes)
        vertices = to_meters(raw.points, raw, unit, up, scale)
    offset = find_offset(vertices)
    mesh.vertices = vertices - offset
    mesh.metadata = {"offset": offset, "up": up or raw.up}
    return mesh


def is_mesh(path: str | os.PathLike[str], max_bytes: float = MAX_BYTES) -> bool:
    """Return whether a file holds a mesh with faces, rather than points.

    Raises:
        ScanError: a .ply or .obj that cannot be read.
    """
    kind = find_kind(Path(path))
    if kind not in (".ply", ".obj"):
        return kind in MESH_ENDINGS
    with name_file(path), open_bounded(path, max_bytes) as file:
        return bool(find_num_faces(file)) if kind == ".ply" else has_obj_faces(file)


def check_plain(path: Path, kind: str, max_bytes: float) -> None:
    """Refuse a file that is absent, packed, empty or too large, for libraries that read it by its path."""
    if not path.is_file():
        raise ScanError("is a folder, not a file" if path.is_dir() else "there is no such file")
    if path.suffix.lower() in PACKINGS:
        raise ScanError(f"a packed {kind} file is not read; unpack it first")
    if not path.stat().st_size:
        raise ScanError("is empty")
    check_size(path.stat().st_size, max_bytes)


def read_mesh(path: Path, max_bytes: float) -> tuple[trimesh.Trimesh, RawPoints]:
    """Return the mesh, and its vertices with what the file says about its frame."""
    import trimesh

    kind = find_kind(path)
    check_plain(path, kind, max_bytes)
    if kind not in MESH_ENDINGS:
        remedy = CONVERTERS.get(kind, f"there are: {' '.join(MESH_ENDINGS)}")
        raise ScanError(f"{kind or 'a file without ending'} is no mesh; {remedy}")
    if kind == ".dae" and zipfile.is_zipfile(path):  # pycollada would unpack all of it
        raise ScanError("is a zip archive; unpack it, and give the .dae in it")
    if kind == ".dae":
        require_extras("a .dae file", "formats")
    if kind in _GLTF:
        _check_accessors(path, kind, max_bytes)
    # A texture may be an EPS, whatever its ending, for which Pillow would start another program
    with suppress(ImportError):
        from PIL import EpsImagePlugin

        EpsImagePlugin.gs_binary = False
    try:
        mesh = trimesh.load_mesh(path, process=False)
    except Exception as error:  # trimesh raises whatever its many readers raise
        raise ScanError(f"is no readable mesh: {error or type(error).__name__}; export it again") from error
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise ScanError("holds no triangles; points are read by load_cloud")
    if mesh.vertices.shape[1] != 3:
        raise ScanError(f"has vertices of {mesh.vertices.shape[1]} coordinates; 3 are needed")
    if not (np.abs(mesh.vertices) < _FARTHEST).all():
        raise ScanError(f"has vertices that are not finite, or beyond {_FARTHEST:g}; repair it first")
    low, high = mesh.faces.min(), mesh.faces.max()
    if low < 0 or high >= len(mesh.vertices):
        raise ScanError(f"has faces of the vertices {low} to {high}, and {len(mesh.vertices)} vertices")
    if kind == ".stl":  # repeats the vertices in every triangle
        mesh.merge_vertices()
    meters, up = _find_frame(path, kind)
    return mesh, RawPoints(np.array(mesh.vertices, np.float64), _find_colors(mesh), meters=meters, up=up)


def _check_accessors(path: Path, kind: str, max_bytes: float) -> None:
    """Refuse a glTF file that promises more values than the limit allows: without data they are zeros, and every node
    has a copy of its mesh.
    """
    data = path.read_bytes()
    try:
        if kind == ".glb":
            if data[:4] != _GLB_MAGIC:
                raise ValueError("it does not begin with 'glTF'")
            length = int.from_bytes(data[12:16], "little")
            data = data[_GLB_HEADER : _GLB_HEADER + length]
        content = json.loads(data)
        counts = [max(0, int(accessor["count"])) for accessor in content.get("accessors", ())]
        total = max(sum(counts), _count_copies(content, counts))
    except Exception as error:  # what is no glTF raises every kind of error
        raise ScanError(f"no readable {kind} file: {error}") from error
    check_size(total * _VALUE_BYTES, max_bytes)


def _count_copies(content: dict[str, Any], counts: list[int]) -> int:
    """Return how many values the meshes of a glTF file have, each as often as nodes that use it are referred to.

    trimesh follows each reference once: neither cycles nor children of several parents grow beyond it.
    """
    nodes, meshes = content.get("nodes", []), content.get("meshes", [])
    scenes = content.get("scenes", [])
    roots = scenes[content.get("scene", 0)].get("nodes", []) if scenes else []
    children = (child for node in nodes for child in node.get("children", []))
    used = Counter(nodes[index].get("mesh") for index in (*roots, *children))
    total = 0
    for number, mesh in enumerate(meshes):
        parts = [[*part["attributes"].values(), part.get("indices")] for part in mesh["primitives"]]
        size = sum(counts[index] for part in parts for index in part if index is not None)
        total += (size + _PART_VALUES * len(parts)) * max(1, used[number])
    return total


def _find_frame(path: Path, kind: str) -> tuple[float | None, str | None]:
    """Return the meters of a unit and the axis that points up, as far as the file says."""
    if kind in _GLTF:
        return 1.0, "y"  # glTF 2.0, 3.4: right-handed, y up, meters
    if kind != ".dae":
        return None, None
    with path.open("rb") as file:
        head = file.read(_COLLADA_HEAD)
    up, unit = _COLLADA_UP.search(head), _COLLADA_UNIT.search(head)
    try:
        meters = float(unit[1]) if unit else 1.0
    except ValueError:
        meters = 1.0
    return meters if 0 < meters < np.inf else 1.0, up[1].decode().lower() if up else "y"


def _find_colors(mesh: trimesh.Trimesh) -> Any:
    """Return the colors of the vertices, where the file has them."""
    if mesh.visual is None or mesh.visual.kind != "vertex":
        return None
    colors = np.asarray(mesh.visual.vertex_colors)  # type: ignore[union-attr]
    return np.ascontiguousarray(colors[:, :3], np.uint8) if len(colors) == len(mesh.vertices) else None
