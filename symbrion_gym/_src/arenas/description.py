"""`arena.json`, the description of an arena's folder, checked by type and range."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

from reconstruction._src.base.typed_json import JsonError, as_type, read_json
from symbrion_gym._src.arenas.checks import check_friction, check_friction_source, check_name
from symbrion_gym._src.arenas.course import make_course
from symbrion_gym._src.arenas.friction_map import FrictionMap
from symbrion_gym._src.arenas.placed_objects import read_objects
from symbrion_gym._src.arenas.primitives import primitives_from_dict
from symbrion_gym._src.arenas.texture import TEXTURE_FILE
from symbrion_gym._src.contact.quality import ArenaQuality
from symbrion_gym._src.errors import ArenaError

FORMAT = 1
PLAIN, SPARE = "", ".arena/"
"""Where the meshes of an arena may lie in its folder; spare only while it takes the place of another."""
_MOST_PIECES = 100_000


class ArenaFiles(NamedTuple):
    """The files of geometry in an arena's folder."""

    surface: Path  # the exact surface
    pieces: list[Path]  # contact pieces, in order
    height_field: Path | None  # in place of pieces, for the kind "hfield"
    texture: Path | None = None  # the picture of the surface's colors


@dataclass(frozen=True)
class ArenaDescription:
    """The content of `arena.json`.

    Raises:
        ArenaError: a field is out of range.
    """

    format: int  # format of the folder
    name: str  # name of the arena
    kind: Literal["convex", "hfield", "prisms", "mixed"]  # kind of contact geometry
    friction: float  # sliding friction of the ground
    num_pieces: int  # number of contact pieces in the folder
    quality: dict[str, Any]  # as `ArenaQuality.as_dict` returned it
    provenance: dict[str, Any]  # what the arena was made of
    # as `Course.as_dict` returned it, for arenas made in code; None for scanned ones
    course: dict[str, Any] | None = None
    place: Literal["", ".arena/"] = PLAIN  # where the meshes lie, relative to the folder
    files: tuple[str, ...] | None = None  # the arena's own files, where the folder lists them
    # what was subtracted from the coordinates of the scan [m]
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    friction_source: str = "given"  # see `Arena`
    has_texture: bool = False  # whether the surface has colors
    # as `FrictionMap.as_dict` returned it; None for one friction for all
    friction_map: dict[str, Any] | None = None
    primitives: dict[str, Any] | None = None  # as `primitives_to_dict` returned them, for the kind "mixed"
    objects: tuple[dict[str, Any], ...] = ()  # known objects, as `PlacedObject.as_dict` returned them

    def __post_init__(self) -> None:
        if self.format < 1:
            raise ArenaError(f"format is {self.format}; formats count from 1")
        check_name(self.name)
        check_friction(self.friction)
        check_friction_source(self.friction_source)
        if not 0 <= self.num_pieces <= _MOST_PIECES:
            raise ArenaError(f"num_pieces is {self.num_pieces}; 0 to {_MOST_PIECES} are possible")
        if (self.kind == "hfield") != (self.num_pieces == 0):
            raise ArenaError(
                f"num_pieces is {self.num_pieces} and kind {self.kind!r}; "
                "a height field has no pieces, every other kind has some"
            )

    def as_arena_fields(self) -> dict[str, Any]:
        """Return the fields of an `Arena` that are not geometry."""
        return {
            "name": self.name,
            "kind": self.kind,
            "friction": self.friction,
            "course": None if self.course is None else make_course(self.course),
            "quality": ArenaQuality.from_dict(self.quality),
            "provenance": self.provenance,
            "offset": self.offset,
            "friction_source": self.friction_source,
            "friction_map": None if self.friction_map is None else FrictionMap.from_dict(self.friction_map),
            "primitives": None if self.primitives is None else primitives_from_dict(self.primitives),
            "objects": read_objects(self.objects),
        }

    def find_files(self, folder: Path) -> ArenaFiles:
        """Return the files of geometry that the arena in a folder consists of."""
        meshes = folder / self.place
        pieces = [f"pieces/{index:03d}.obj" for index in range(self.num_pieces)]
        if self.place == PLAIN:  # elsewhere the files of two arenas are listed
            self._check_pieces(meshes)
        height_field = meshes / "height_field.npz"
        has_height_field = self.kind == "hfield"
        is_there = height_field.is_file() if self.files is None else height_field.name in self.files
        if has_height_field != is_there and self.place == PLAIN:
            raise ArenaError(
                f"kind is {self.kind!r} and {height_field} {'missing' if has_height_field else 'there'}"
            )
        return ArenaFiles(
            surface=meshes / "surface.obj",
            pieces=[meshes / name for name in pieces],
            height_field=height_field if has_height_field else None,
            texture=meshes / TEXTURE_FILE if self.has_texture else None,
        )

    def _check_pieces(self, meshes: Path) -> None:
        """Refuse another number of pieces than is listed, or lies there in a row where none is listed."""
        listed = set(self.files or ())
        for index in range(self.num_pieces + 1):
            name, is_wanted = f"pieces/{index:03d}.obj", index < self.num_pieces
            is_there = (meshes / name).is_file() if self.files is None else name in listed
            if is_there != is_wanted:
                how = "" if is_there else "not "
                what = f"is {how}there" if self.files is None else f"is {how}listed in files"
                raise ArenaError(f"num_pieces is {self.num_pieces}, but {meshes / name} {what}")


def load_description(path: Path) -> tuple[dict[str, Any], ArenaFiles]:
    """Read `arena.json`; entries that it does not know are left alone."""
    if not path.is_file():
        raise ArenaError(f"{path.parent} holds no {path.name}")
    try:
        content = read_json(path)
        _refuse_newer(content)
        description = as_type(content, ArenaDescription, others_allowed=True)
        return description.as_arena_fields(), description.find_files(path.parent)
    except (JsonError, ArenaError, OSError) as error:
        raise ArenaError(f"{path}: {error}; build the arena again with make_arena") from error


def _refuse_newer(content: Any) -> None:
    """Refuse a folder of a later release, whose other fields may be anything."""
    version = content.get("format") if isinstance(content, dict) else None
    if isinstance(version, int) and version > FORMAT:
        raise ArenaError(f"format is {version}, of a newer release; this one reads up to {FORMAT}")
