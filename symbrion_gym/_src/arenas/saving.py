"""Saving an arena as a folder: a kill at any moment leaves the old arena or the new one, and the files of others stay.

`arena.json` decides: it says where the meshes lie, and lists the arena's own files. Saving writes everything twice,
first with the meshes in `.arena/`, then under the names listed in `folder`. Either time the meshes are written first
and `arena.json` after them, and what it no longer names is removed last.
"""

from __future__ import annotations

import io
import json
import logging
import os
import re
from collections.abc import Set
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np

from reconstruction._src.base.atomic_write import find_leftovers, write_atomically
from reconstruction._src.base.bounded_read import read_npz
from reconstruction._src.base.typed_json import read_json
from symbrion_gym._src.arenas.checks import check_height_field, check_piece, check_surface
from symbrion_gym._src.arenas.description import FORMAT, PLAIN, SPARE, load_description
from symbrion_gym._src.arenas.friction_map import FrictionMap
from symbrion_gym._src.arenas.placed_objects import PlacedObject, add_objects
from symbrion_gym._src.arenas.spec import ArenaGeometry, make_arena_spec
from symbrion_gym._src.arenas.surface_file import format_surface, load_colored_obj, load_obj
from symbrion_gym._src.arenas.texture import TEXTURE_FILE, SurfaceTexture, load_png, to_png
from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.errors import ArenaError

logger = logging.getLogger(__name__)
ABOUT, MODEL = "arena.json", "arena.xml"
_SURFACE_DIGITS, _PIECE_DIGITS = 4, 6
_MESH = r"surface\.obj|surface\.png|height_field\.npz|pieces/\d{3,}\.obj"
_OWN = re.compile(rf"(?:{re.escape(SPARE)})?(?:{_MESH})|{re.escape(MODEL)}|{re.escape(ABOUT)}")
"""Every name that a file of an arena may have; whatever a manifest says, no other is touched."""


class OwnFiles(NamedTuple):
    """The files of an arena in a folder."""

    place: str  # where its meshes lie
    names: frozenset[str]  # its files, relative to the folder; the others are somebody else's


def save_arena(
    folder: str | Path,
    name: str,
    geometry: ArenaGeometry,
    friction: float,
    about: dict[str, Any],
    friction_map: FrictionMap | None = None,
    objects: tuple[PlacedObject, ...] = (),
) -> None:
    """Write an arena as a folder; of what is there, only the files of a former arena are replaced."""
    folder = Path(folder)
    meshes, about = _format_meshes(geometry), {"format": FORMAT, **about}
    spec = make_arena_spec(name, geometry, friction, use_files=True, friction_map=friction_map)
    add_objects(spec, objects)
    model = _format_model(spec, meshes)
    models = {PLAIN: model, SPARE: model.replace('file="', f'file="{SPARE}')}
    own = find_own_files(folder)
    if not objects and count_objects(folder):
        logger.warning("%s: its %d known objects are replaced by none", folder, count_objects(folder))
    wanted = {f"{place}{name}" for place in (SPARE, PLAIN) for name in meshes} | {MODEL, ABOUT}
    _refuse_foreign(folder, wanted, own.names)
    _drop_stale_model(folder, own.place)
    for place in (PLAIN,) if own.place == SPARE else (SPARE, PLAIN):
        current = {f"{place}{name}" for name in meshes} | {MODEL, ABOUT}
        for name, content in meshes.items():
            _write(folder / f"{place}{name}", content)
        files = sorted(current if place == PLAIN else own.names | wanted)
        _write(folder / ABOUT, _to_json(about | {"place": place, "files": files}))
        _write(folder / MODEL, models[place].encode())
        _remove(folder, own.names | wanted, keep=current)


def find_own_files(folder: Path) -> OwnFiles:
    """Return which files in a folder are an arena's; none where there is no folder, or nothing in it."""
    if folder.exists() and not folder.is_dir():
        raise ArenaError(f"{folder} is a file; choose another folder")
    spare = {f"{SPARE}{name}" for name in _list_files(folder / SPARE)}
    spare = {name for name in spare if _OWN.fullmatch(name)}
    if not (folder / ABOUT).exists():
        entries = set(folder.iterdir()) if folder.exists() else set()
        if entries - find_leftovers(folder).keys() - {folder / SPARE}:
            raise ArenaError(f"{folder} is not empty and holds no arena; choose another folder")
        return OwnFiles(PLAIN, frozenset(spare))
    about = _read_about(folder / ABOUT)
    files = about.get("files")
    if files is None:  # saved before there was a manifest
        files = [name for name in _list_files(folder) if _was_in_format_1(name, about)]
    named = {name for name in files if isinstance(name, str) and _OWN.fullmatch(name)}
    return OwnFiles(about.get("place", PLAIN), frozenset(named | spare | {ABOUT}))


def count_objects(folder: Path) -> int:
    """Return how many known objects the arena in a folder has; 0 where there is none."""
    if not (folder / ABOUT).exists():
        return 0
    objects = _read_about(folder / ABOUT).get("objects", [])
    return len(objects) if isinstance(objects, list) else 0


def _read_about(path: Path) -> dict[str, Any]:
    try:
        about = read_json(path)
        if about["format"] > FORMAT:
            raise ArenaError(f"{path}: written by a newer version; choose another folder")
        if not isinstance(about.get("files", []), list) or about["num_pieces"] < 0 or not about["kind"]:
            raise ValueError("not an arena's")
        if about.get("place", PLAIN) not in (PLAIN, SPARE):
            raise ValueError("no place of an arena's meshes")
    except (OSError, ValueError, TypeError, KeyError) as error:
        if isinstance(error, ArenaError):
            raise
        raise ArenaError(
            f"{path} is damaged or of another program, so that nobody knows which files beside it are an arena's; "
            "choose another folder"
        ) from error
    return about


def _was_in_format_1(name: str, about: dict[str, Any]) -> bool:
    if name.startswith("pieces/"):
        return bool(_OWN.fullmatch(name)) and int(Path(name).stem) < about["num_pieces"]
    return name in (MODEL, "surface.obj") or (name == "height_field.npz" and about["kind"] == "hfield")


def _list_files(folder: Path) -> list[str]:
    """Return the files of a folder and of its `pieces`, relative to it."""
    paths = [path for place in (folder, folder / "pieces") if place.is_dir() for path in place.iterdir()]
    return [path.relative_to(folder).as_posix() for path in paths if path.is_file()]


def _refuse_foreign(folder: Path, wanted: Set[str], own: Set[str]) -> None:
    """Refuse to write where something lies that is no file of the arena: a file, a folder, a link."""
    for name in sorted(wanted):
        path = folder / name
        is_free = not os.path.lexists(path) and (path.parent.is_dir() or not os.path.lexists(path.parent))
        if not _is_inside(folder, name) or not (is_free or (name in own and path.is_file())):
            raise ArenaError(
                f"{path} is in the way and no file of the arena in {folder}; move it, or choose another folder"
            )


def _is_inside(folder: Path, name: str) -> bool:
    """Return whether a name leads to that place in the folder, and by no link elsewhere."""
    return (folder / name).resolve() == folder.resolve() / name


def _drop_stale_model(folder: Path, place: str) -> None:
    """Remove an `arena.xml` that a killed saving left behind: its meshes are overwritten next."""
    path = folder / MODEL
    if path.is_file() and (f'file="{SPARE}'.encode() in path.read_bytes()) != (place == SPARE):
        path.unlink()


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with write_atomically(path) as temporary:
        temporary.write_bytes(content)


def _remove(folder: Path, names: Set[str], keep: Set[str]) -> None:
    """Remove own files but some, the temporary files of killed savings, and the folders that are empty then."""
    for name in names - keep:
        if _is_inside(folder, name) and (folder / name).is_file():
            (folder / name).unlink()
    for place in (f"{SPARE}pieces/", SPARE, "pieces/", ""):
        for path, name in find_leftovers(folder / place).items():
            if f"{place}{name}" in names and _is_inside(folder, f"{place}{path.name}"):
                path.unlink(missing_ok=True)
        if place and (folder / place).is_dir() and not any((folder / place).iterdir()):
            (folder / place).rmdir()


def _format_meshes(geometry: ArenaGeometry) -> dict[str, bytes]:
    """Return name -> content."""
    files = {"surface.obj": format_surface(geometry.surface, geometry.texture, _SURFACE_DIGITS)}
    if geometry.texture is not None:
        files[TEXTURE_FILE] = to_png(geometry.texture.image)
    for i, piece in enumerate(geometry.pieces):
        files[f"pieces/{i:03d}.obj"] = format_surface(piece, None, _PIECE_DIGITS)
    if geometry.height_field is not None:
        buffer = io.BytesIO()
        np.savez_compressed(buffer, **geometry.height_field._asdict())
        files["height_field.npz"] = buffer.getvalue()
    return files


def _format_model(spec: mujoco.MjSpec, meshes: dict[str, bytes]) -> str:
    """Return `arena.xml`; it compiles."""
    spec.assets = meshes
    spec.compile()
    return spec.to_xml()


def _to_json(about: dict[str, Any]) -> bytes:
    return (json.dumps(about, indent=2, allow_nan=False) + "\n").encode()


def load_arena_folder(folder: str | Path) -> dict[str, Any]:
    """Return the fields of the arena in a folder."""
    folder = Path(folder)
    fields, files = load_description(folder / "arena.json")
    surface, uv = load_colored_obj(files.surface)
    pieces = [load_obj(path) for path in files.pieces]
    check_surface(surface, files.surface)
    texture = None
    if files.texture is not None:
        texture = SurfaceTexture(load_png(files.texture), np.zeros((0, 3, 2)) if uv is None else uv)
    for piece, path in zip(pieces, files.pieces, strict=True):
        check_piece(piece, path)
    height_field = None if files.height_field is None else _load_height_field(files.height_field)
    shapes = {"surface": surface, "pieces": pieces, "height_field": height_field}
    return fields | shapes | ({} if texture is None else {"texture": texture})


def _load_height_field(path: Path) -> HeightField:
    try:
        arrays = read_npz(path, HeightField._fields)
        field = HeightField(*(arrays[name] for name in HeightField._fields))
    except (KeyError, TypeError, ValueError, OSError) as error:
        raise ArenaError(f"{path}: damaged ({error}); build the arena again with make_arena") from error
    check_height_field(field, path)
    return field
