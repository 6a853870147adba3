"""`arena.json`: what an arena's folder says of itself, checked by type and range."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from reconstruction.typed_json import JsonError, as_type, read_json
from symbrion_gym.arenas.checks import check_friction, check_name
from symbrion_gym.arenas.course import make_course
from symbrion_gym.arenas.quality import ArenaQuality
from symbrion_gym.errors import ArenaError

FORMAT = 1
_MOST_PIECES = 100_000


@dataclass(frozen=True)
class ArenaDescription:
    """The content of `arena.json`.

    Attributes:
        format: of the folder.
        name: of the arena.
        kind: of contact geometry.
        friction: sliding friction of the ground.
        num_pieces: number of contact pieces in the folder.
        quality: as `ArenaQuality.as_dict` returned it.
        provenance: what the arena was made of.
        course: as `Course.as_dict` returned it; None where there is no course.
    """

    format: int
    name: str
    kind: Literal["convex", "primitives", "hfield", "prisms"]
    friction: float
    num_pieces: int
    quality: dict[str, int | float | None]
    provenance: dict[str, Any]
    course: dict[str, Any] | None

    def __post_init__(self) -> None:
        if self.format < 1:
            raise ArenaError(f"format is {self.format}; formats count from 1")
        check_name(self.name)
        check_friction(self.friction)
        if not 0 <= self.num_pieces <= _MOST_PIECES:
            raise ArenaError(f"num_pieces is {self.num_pieces}; 0 to {_MOST_PIECES} are possible")
        if (self.kind == "hfield") != (self.num_pieces == 0):
            raise ArenaError(
                f"num_pieces is {self.num_pieces} and kind {self.kind!r}; "
                "a height field has no pieces, every other kind has some"
            )

    def as_arena_fields(self) -> dict[str, Any]:
        """Return the fields of an `Arena` that are not geometry.

        Raises:
            ArenaError: a field of quality or course is missing, unknown, of another type or out of range.
        """
        return {
            "name": self.name,
            "kind": self.kind,
            "friction": self.friction,
            "course": None if self.course is None else make_course(self.course),
            "quality": ArenaQuality.from_dict(self.quality),
            "provenance": self.provenance,
        }

    def name_pieces(self) -> list[str]:
        """Return the files of the contact pieces, relative to the folder."""
        return [f"pieces/{index:03d}.obj" for index in range(self.num_pieces)]


def load_description(path: Path) -> tuple[dict[str, Any], list[str]]:
    """Read `arena.json`; entries that it does not know are left alone.

    Returns:
        The fields of an `Arena` that are not geometry, and the files of its pieces.

    Raises:
        ArenaError: missing, damaged, of a newer format, or a field is wrong; the message names file and field.
    """
    if not path.is_file():
        raise ArenaError(f"{path.parent} holds no {path.name}")
    try:
        content = read_json(path)
        _refuse_newer(content)
        description = as_type(content, ArenaDescription, others_allowed=True)
        return description.as_arena_fields(), description.name_pieces()
    except (JsonError, ArenaError) as error:
        raise ArenaError(f"{path}: {error}; build the arena again with make_arena") from error


def _refuse_newer(content: Any) -> None:
    """Refuse a folder of a later release, whose other fields may be anything."""
    version = content.get("format") if isinstance(content, dict) else None
    if isinstance(version, int) and version > FORMAT:
        raise ArenaError(f"format is {version}, of a newer release; this one reads up to {FORMAT}")
