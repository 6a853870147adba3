"""Contact geometry: what a robot touches, how well that follows the surface, and how it came about."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import trimesh

from symbrion_gym.contact.kinds import HeightField
from symbrion_gym.contact.quality import ArenaQuality


@dataclass(frozen=True)
class Contact:
    """Contact geometry of a surface.

    Attributes:
        pieces: convex solids.
        height_field: in place of pieces, for the kind "hfield".
        quality: distances from the surface.
        notes: how it came about, for JSON.
    """

    pieces: list[trimesh.Trimesh]
    quality: ArenaQuality
    height_field: HeightField | None = None
    notes: dict[str, Any] = field(default_factory=dict)


def select_best(candidates: list[Contact], max_pieces: int) -> Contact:
    """Return the one that keeps to the number of pieces; of several, the most accurate, the first of equals."""

    def rank(contact: Contact) -> tuple[int, float]:
        too_many = max(len(contact.pieces) - max_pieces, 0)
        return too_many, contact.quality.mean + contact.quality.uncovered

    return min(candidates, key=rank)
