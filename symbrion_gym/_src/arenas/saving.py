"""Saving an arena as a folder: a kill at any moment leaves the old arena or the new one, and the files of others stay.

`arena.json` decides: it says where the meshes lie, and lists the arena's own files. Saving writes everything twice,
first with the meshes in `.arena/`, then under the names listed in `folder`. Either time the meshes are written first
and `arena.json` after them, and what it no longer names is removed last. Exports have a manifest of this kind, too.
"""

import io
import os
import re
from collections.abc import Iterable, Set
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from reconstruction._src.base.atomic_write import find_leftovers, write_file
from reconstruction._src.base.bounded_read import read_npz
from reconstruction._src.base.typed_json import JsonError, as_type, read_json, write_json
from symbrion_gym._src.arenas.checks import (
    check_friction,
    check_height_field,
    check_names,
    check_piece,
    check_surface,
)
from symbrion_gym._src.arenas.course import make_course
from symbrion_gym._src.arenas.friction_map import FrictionMap
from symbrion_gym._src.arenas.placed_objects import read_objects
from symbrion_gym._src.arenas.primitives import primitives_from_dict
from symbrion_gym._src.arenas.spec import ArenaGeometry, make_arena_spec
from symbrion_gym._src.arenas.surface_file import format_obj, load_obj
from symbrion_gym._src.arenas.texture import TEXTURE_FILE, SurfaceTexture, load_png, to_png
from symbrion_gym._src.arenas.verdict import Verdict
from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.contact.quality import ArenaQuality
from symbrion_gym._src.errors import ArenaError


class FileOwner(NamedTuple):
    """What owns the files of a folder that its manifest lists under `files`."""

    what: str  # what it is, in messages
    manifest: str  # name of the manifest
    newest: int  # largest format that this version reads
    pattern: re.Pattern[str]  # names that its files may have: whatever a manifest says, no other is touched

    def read_manifest(self, folder: Path, ignored: str = "") -> dict[str, Any]:
        """Return the manifest; without a folder, or anything in it but the ignored name, an empty one."""
        if folder.exists() and not folder.is_dir():
            raise ArenaError(f"{folder} is a file; choose another folder")
        path = folder / self.manifest
        if not path.exists():
            entries = set(folder.iterdir()) if folder.exists() else set()
            if entries - find_leftovers(folder).keys() - {folder / ignored}:
                raise ArenaError(f"{folder} is not empty and holds no {self.what}; choose another folder")
            return {}
        try:
            about = read_json(path)
            if not isinstance(about["format"], int) or not isinstance(about["files"], list):
                raise ValueError(f"no manifest of an {self.what}")
        except (OSError, ValueError, TypeError, KeyError) as error:
            raise ArenaError(
                f"{path} is damaged or of another program, so that nobody knows which files beside it are an "
                f"{self.what}'s; choose another folder"
            ) from error
        if about["format"] > self.newest:
            raise ArenaError(f"{path}: written by a newer version; choose another folder")
        return about

    def list_files(self, about: dict[str, Any]) -> frozenset[str]:
        """Return the files that a manifest lists, and itself."""
        named = {name for name in about.get("files", ()) if isinstance(name, str)}
        own = {name for name in named if self.pattern.fullmatch(name)}
        return frozenset(own | {self.manifest}) if about else frozenset()

    def refuse_foreign(self, folder: Path, wanted: Set[str], own: Set[str]) -> None:
        """Refuse to write where something else lies: a file, a folder, a link."""
        inside = _find_inside(folder, wanted)
        for name in sorted(wanted):
            path = folder / name
            is_free = not os.path.lexists(path) and (path.parent.is_dir() or not os.path.lexists(path.parent))
            if name not in inside or not (is_free or (name in own and path.is_file())):
                raise ArenaError(
                    f"{path} is in the way and no file of the {self.what} in {folder}; move it, or choose another "
                    "folder"
                )


def _find_inside(folder: Path, names: Set[str]) -> set[str]:
    """Return the names that lead to that place in the folder, and by no link elsewhere."""
    root = os.path.realpath(folder)
    places = {os.path.dirname(name) for name in names}
    inside = {place for place in places if Path(os.path.realpath(folder / place)) == Path(root, place)}
    return {name for name in names if os.path.dirname(name) in inside and not (folder / name).is_symlink()}


def format_arrays(arrays: dict[str, np.ndarray]) -> bytes:
    """Return arrays as the content of an `.npz`."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def remove_files(folder: Path, names: Set[str], places: Iterable[str], keep: Set[str]) -> None:
    """Remove own files but some, the temporary files of killed writers, and the places that are empty then."""
    for name in _find_inside(folder, names - keep):
        if (folder / name).is_file():
            (folder / name).unlink()
    for place in (*places, ""):
        found = find_leftovers(folder / place).items()
        leftovers = {f"{place}{path.name}" for path, name in found if f"{place}{name}" in names}
        for name in _find_inside(folder, leftovers):
            (folder / name).unlink(missing_ok=True)
        is_emptied = any(name.startswith(place) for name in names) and (folder / place).is_dir()
        if (
            place
            and is_emptied
            and _find_inside(folder, {place.rstrip("/")})
            and not any((folder / place).iterdir())
        ):
            (folder / place).rmdir()


FORMAT = 1
ABOUT, MODEL = "arena.json", "arena.xml"
PLAIN, SPARE = "", ".arena/"
"""Where the meshes of an arena may lie in its folder; spare only while it takes the place of another."""
_MOST_PIECES = 100_000
_SURFACE_DIGITS, _PIECE_DIGITS = 4, 6
_MESH = r"surface\.obj|surface\.png|height_field\.npz|pieces/\d{3,}\.obj"
_PATTERN = rf"(?:{re.escape(SPARE)})?(?:{_MESH})|{re.escape(MODEL)}|{re.escape(ABOUT)}"
_OWNER = FileOwner("arena", ABOUT, FORMAT, re.compile(_PATTERN))


class OwnFiles(NamedTuple):
    """The files of an arena in a folder."""

    place: str  # where its meshes lie
    names: frozenset[str]  # its files, relative to the folder; the others are somebody else's


def save_arena(folder: str | Path, geometry: ArenaGeometry, about: dict[str, Any]) -> None:
    """Write an arena as a folder; of what is there, only the files of a former arena are replaced."""
    folder = Path(folder)
    meshes, about = _format_meshes(geometry), {"format": FORMAT, **about}
    spec = make_arena_spec(geometry, use_files=True)
    spec.assets = meshes
    spec.compile()
    model = spec.to_xml()
    models = {PLAIN: model, SPARE: model.replace('file="', f'file="{SPARE}')}
    own = find_own_files(folder)
    wanted = {f"{place}{name}" for place in (SPARE, PLAIN) for name in meshes} | {MODEL, ABOUT}
    _OWNER.refuse_foreign(folder, wanted, own.names)
    _drop_stale_model(folder, own.place)
    for place in (PLAIN,) if own.place == SPARE else (SPARE, PLAIN):
        current = {f"{place}{name}" for name in meshes} | {MODEL, ABOUT}
        for name, content in meshes.items():
            path = folder / f"{place}{name}"
            is_twin = SPARE not in (place, own.place)  # else what is spare is of an older arena
            if not (is_twin and _link(folder / SPARE / name, path)):
                write_file(path, content)
        files = sorted(current if place == PLAIN else own.names | wanted)
        write_json(folder / ABOUT, about | {"place": place, "files": files})
        write_file(folder / MODEL, models[place].encode())
        places = (f"{SPARE}pieces/", SPARE, "pieces/")
        remove_files(folder, own.names | wanted, places, keep=current)


def find_own_files(folder: Path) -> OwnFiles:
    """Return which files in a folder are an arena's; none where there is no folder, or nothing in it."""
    about = _OWNER.read_manifest(folder, ignored=SPARE)
    places = [folder / SPARE, folder / SPARE / "pieces"]
    paths = [path for place in places if place.is_dir() for path in place.iterdir() if path.is_file()]
    spare = {path.relative_to(folder).as_posix() for path in paths}
    own = {name for name in spare if _OWNER.pattern.fullmatch(name)}
    return OwnFiles(SPARE if about.get("place") == SPARE else PLAIN, _OWNER.list_files(about) | own)


def _link(source: Path, path: Path) -> bool:
    """Give a file that is on the disk another name, which is faster than to write it again; return whether it has."""
    try:
        path.parent.mkdir(exist_ok=True)
        os.link(source, path, follow_symlinks=False)
    except OSError:  # no source, something there, or no links on this disk
        return False
    return True


def _drop_stale_model(folder: Path, place: str) -> None:
    """Remove an `arena.xml` that a killed saving left behind: its meshes are overwritten next."""
    path = folder / MODEL
    if path.is_file() and (f'file="{SPARE}'.encode() in path.read_bytes()) != (place == SPARE):
        path.unlink()


def _format_meshes(geometry: ArenaGeometry) -> dict[str, bytes]:
    """Return name -> content."""
    files = {"surface.obj": format_obj(geometry.surface, geometry.texture, _SURFACE_DIGITS)}
    if geometry.texture is not None:
        files[TEXTURE_FILE] = to_png(geometry.texture.image)
    for i, piece in enumerate(geometry.pieces):
        files[f"pieces/{i:03d}.obj"] = format_obj(piece, None, _PIECE_DIGITS)
    if geometry.height_field is not None:
        files["height_field.npz"] = format_arrays(geometry.height_field._asdict())
    return files


@dataclass(frozen=True)
class _Description:
    """The content of `arena.json`, checked by type and range."""

    format: int
    name: str
    kind: Literal["convex", "hfield", "prisms", "mixed"]
    friction: float
    num_pieces: int  # number of contact pieces in the folder
    quality: dict[str, Any]  # as `ArenaQuality.as_dict` returned it
    provenance: dict[str, Any]
    place: Literal["", ".arena/"]  # where the meshes lie, relative to the folder
    files: tuple[str, ...]  # the arena's own files
    course: dict[str, Any] | None = None  # as `Course.as_dict` returned it; None for scanned ones
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    friction_source: str = "given"
    has_texture: bool = False  # whether the surface has colors
    friction_map: FrictionMap | None = None
    primitives: dict[str, Any] | None = None  # as `primitives_to_dict` returned them, for the kind "mixed"
    objects: tuple[dict[str, Any], ...] = ()  # as `PlacedObject.as_dict` returned them
    unseen: tuple[int, ...] = ()  # numbers of faces of the surface
    verdict: Verdict | None = None  # None in folders of earlier releases

    def __post_init__(self) -> None:
        if self.format < 1:
            raise ArenaError(f"format is {self.format}; formats count from 1")
        check_names(self.name, self.friction_source)
        check_friction(self.friction)
        if not 0 <= self.num_pieces <= _MOST_PIECES:
            raise ArenaError(f"num_pieces is {self.num_pieces}; 0 to {_MOST_PIECES} are possible")
        if (self.kind == "hfield") != (self.num_pieces == 0):
            raise ArenaError(
                f"num_pieces is {self.num_pieces} and kind {self.kind!r}; a height field alone has no pieces"
            )
        for index in range(self.num_pieces + 1 if self.place == PLAIN else 0):  # else two arenas are listed
            name, is_wanted = f"pieces/{index:03d}.obj", index < self.num_pieces
            if (name in self.files) != is_wanted:
                how = "not listed" if is_wanted else "listed"
                raise ArenaError(f"num_pieces is {self.num_pieces}, but {name} is {how} in files")

    def as_arena_fields(self) -> dict[str, Any]:
        """Return the fields of an `Arena` that are not geometry."""
        same = ("name", "kind", "friction", "provenance", "offset", "friction_source", "unseen", "verdict")
        return {name: getattr(self, name) for name in (*same, "friction_map")} | {
            "course": None if self.course is None else make_course(self.course),
            "quality": ArenaQuality.from_dict(self.quality),
            "primitives": None if self.primitives is None else primitives_from_dict(self.primitives),
            "objects": read_objects(self.objects),
        }


def load_arena_folder(folder: str | Path) -> dict[str, Any]:
    """Return the fields of the arena in a folder; entries of `arena.json` that it does not know are left alone."""
    folder = Path(folder)
    path = folder / ABOUT
    if not path.is_file():
        within = folder / "arena"  # as of a training
        given = str(within) if (within / ABOUT).is_file() else "an arena folder, or a file"
        raise ArenaError(f"{folder} holds no {ABOUT}: it is no arena; give {given}")
    try:
        content = read_json(path)
        version = content.get("format") if isinstance(content, dict) else None
        if isinstance(version, int) and version > FORMAT:  # whose other fields may be anything
            raise ArenaError(f"format is {version}, of a newer release; this one reads up to {FORMAT}")
        about = as_type(content, _Description, others_allowed=True)
        fields = about.as_arena_fields()
    except (JsonError, ArenaError, OSError) as error:
        raise ArenaError(f"{path}: {error}; build the arena again with make_arena") from error
    return fields | _load_geometry(folder, about)


def _load_geometry(folder: Path, about: _Description) -> dict[str, Any]:
    """Return the fields of an `Arena` that are geometry."""
    meshes, real = folder / about.place, Path(os.path.realpath(folder)) / about.place
    pieces = [f"pieces/{index:03d}.obj" for index in range(about.num_pieces)]
    for name in ("surface.obj", TEXTURE_FILE, "height_field.npz", *pieces):
        if os.path.realpath(meshes / name) != str(real / name):
            raise ArenaError(f"{meshes / name} is a link to elsewhere; put the file itself there")
    surface, uv = load_obj(meshes / "surface.obj")
    check_surface(surface, meshes / "surface.obj")
    if about.unseen and not 0 <= min(about.unseen) <= max(about.unseen) < len(surface.faces):
        raise ArenaError(
            f"{meshes}: unseen names faces that the surface lacks; build it again with make_arena"
        )
    pieces = []
    for index in range(about.num_pieces):
        path = meshes / f"pieces/{index:03d}.obj"
        pieces.append(load_obj(path)[0])
        check_piece(pieces[-1], path)
    field = _load_height_field(meshes / "height_field.npz") if about.kind == "hfield" else None
    found = {"surface": surface, "pieces": pieces, "height_field": field}
    if about.has_texture and uv is None:
        raise ArenaError(
            f"{meshes / 'surface.obj'} has no places in its texture; build it again with make_arena"
        )
    if about.has_texture and uv is not None:
        found["texture"] = SurfaceTexture(load_png(meshes / TEXTURE_FILE), uv)
    return found


def _load_height_field(path: Path) -> HeightField:
    try:
        arrays = read_npz(path, HeightField._fields)
        field = HeightField(*(arrays[name] for name in HeightField._fields))
    except (KeyError, TypeError, ValueError, OSError) as error:
        raise ArenaError(f"{path}: damaged ({error}); build the arena again with make_arena") from error
    check_height_field(field, path)
    return field
