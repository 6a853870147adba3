"""An arena as a folder: `arena.xml` for MuJoCo's viewer, OBJ meshes, `arena.json` with where it came from.

arena.xml            contact pieces and surface; drag it into MuJoCo's viewer
arena.json           name, kind, friction, course, quality, provenance
surface.obj          the exact surface, to 0.1 mm
pieces/000.obj ...   the contact pieces, to 1 µm
height_field.npz     in place of pieces, for the kind "hfield"

While an arena takes the place of another, its meshes lie in `.arena/`; `arena.json` says where (`saving`).
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from symbrion_gym.arenas.contact_kinds import HeightField
from symbrion_gym.arenas.course import make_course
from symbrion_gym.arenas.quality import ArenaQuality
from symbrion_gym.errors import ArenaError

FORMAT = 1
PLAIN, SPARE = "", ".arena/"
"""Where the meshes of an arena may lie in its folder."""


def load_arena_folder(folder: str | Path) -> dict[str, Any]:
    """Return the fields of the arena in a folder.

    Raises:
        ArenaError: it holds no arena, or a damaged one; the message names the file.
    """
    folder = Path(folder)
    about_path = folder / "arena.json"
    if not about_path.is_file():
        raise ArenaError(f"{folder} holds no arena.json")
    try:
        about = json.loads(about_path.read_text())
        if about["format"] > FORMAT:
            raise ArenaError(f"{about_path}: written by a newer version (format {about['format']})")
        meshes = folder / find_place(about)
        height_field = None
        if (meshes / "height_field.npz").is_file():
            with np.load(meshes / "height_field.npz", allow_pickle=False) as arrays:
                height_field = HeightField(*(arrays[name] for name in HeightField._fields))
        return {
            "name": about["name"],
            "kind": about["kind"],
            "friction": about["friction"],
            "course": make_course(about["course"]) if about["course"] else None,
            "quality": ArenaQuality.from_dict(about["quality"]),
            "provenance": about["provenance"],
            "surface": _read_obj(meshes / "surface.obj"),
            "pieces": [_read_obj(meshes / f"pieces/{i:03d}.obj") for i in range(about["num_pieces"])],
            "height_field": height_field,
        }
    except (KeyError, TypeError, ValueError, OSError) as error:
        if isinstance(error, ArenaError):
            raise
        raise ArenaError(f"{folder}: damaged arena ({error!r}); build it again with make_arena") from error


def find_place(about: dict[str, Any]) -> str:
    """Return where the meshes lie, given the content of `arena.json`: `PLAIN` or `SPARE`."""
    place = about.get("place", PLAIN)
    if place not in (PLAIN, SPARE):
        raise ArenaError(f"arena.json: place {place!r} is none; there are {PLAIN!r} and {SPARE!r}")
    return place


def _read_obj(path: Path) -> trimesh.Trimesh:
    if not path.is_file():
        raise ArenaError(f"{path} is missing; build the arena again with make_arena")
    rows: dict[str, list[list[str]]] = {"v": [], "f": []}
    for line in path.read_text().splitlines():
        kind, _, rest = line.partition(" ")
        if kind in rows:
            rows[kind].append(rest.split())
    vertices = np.array(rows["v"], dtype=np.float64).reshape(-1, 3)
    faces = np.array(rows["f"], dtype=np.int64).reshape(-1, 3) - 1
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise ArenaError(f"{path}: a face names a vertex that is not there")
    return trimesh.Trimesh(vertices, faces, process=False)
