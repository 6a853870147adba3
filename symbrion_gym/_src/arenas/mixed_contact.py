"""Contact of an arena with primitives: solids as they are, convex pieces for the rest of the surface."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool

from reconstruction._src.surfaces.primitives.find import Primitives
from symbrion_gym._src.arenas.primitives import find_solids, take_solids_out
from symbrion_gym._src.contact.contact import Contact
from symbrion_gym._src.contact.distances import SurfaceDistance
from symbrion_gym._src.contact.options import ContactConfig

_FEWEST = 4
"""Faces of a rest that pieces can be made of."""


class Touched(NamedTuple):
    """A surface that pieces are made of.

    Attributes:
        mesh: the surface.
        is_two_sided: which of its faces were seen from behind, too.
    """

    mesh: trimesh.Trimesh
    is_two_sided: Bool[np.ndarray, " F"] | None


def leave_solids_out(
    mesh: trimesh.Trimesh, is_two_sided: Bool[np.ndarray, " F"] | None, primitives: Primitives
) -> Touched:
    """Return a surface without the faces that solid primitives replace; all of it where hardly any would be left."""
    is_left = take_solids_out(mesh, primitives)
    if is_left.all() or is_left.sum() < _FEWEST:
        return Touched(mesh, is_two_sided)
    rest = trimesh.Trimesh(mesh.vertices, mesh.faces[is_left], process=False)
    rest.remove_unreferenced_vertices()
    return Touched(rest, None if is_two_sided is None else is_two_sided[is_left])


def add_solids(
    contact: Contact, mesh: trimesh.Trimesh, primitives: Primitives, config: ContactConfig
) -> Contact:
    """Return contact with the solid primitives as its last pieces, and its distances from the whole surface."""
    solids = [solid.as_mesh() for solid in find_solids(primitives)]
    kinds = [one.kind for one in primitives.shapes]
    notes = {**contact.notes, "primitives": {kind: kinds.count(kind) for kind in sorted(set(kinds))}}
    if not solids:
        return replace(contact, notes=notes)
    is_rest = take_solids_out(mesh, primitives).sum() >= _FEWEST
    pieces = [*contact.pieces, *solids] if is_rest else solids
    quality = SurfaceDistance(mesh, config.distance).measure(pieces, contact.quality.seconds)
    return replace(contact, pieces=pieces, quality=quality, notes=notes)
