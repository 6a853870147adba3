"""Contact geometry: what a robot touches, how well that follows the surface, and how it came about."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import trimesh

from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.contact.quality import ArenaQuality


@dataclass(frozen=True)
class Contact:
    """Contact geometry of a surface.

    Attributes:
        pieces: convex solids.
        quality: distances from the surface.
        height_field: in place of pieces, for the kind "hfield".
        notes: how it came about, for JSON.
    """

    pieces: list[trimesh.Trimesh]
    quality: ArenaQuality
    height_field: HeightField | None = None
    notes: dict[str, Any] = field(default_factory=dict)
