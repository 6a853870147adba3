"""Where contact geometry no longer follows a surface that has changed: pieces to remove, faces without contact."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int

from reconstruction._src.base.range_checks import check_positive
from reconstruction._src.geometry.boxes import find_near_box
from reconstruction._src.geometry.rows import any_corner
from reconstruction._src.geometry.sampling import sample_area
from reconstruction._src.surfaces.far_updates import Sheet, find_same_faces
from symbrion_gym._src.contact.distances import find_nearest
from symbrion_gym._src.contact.inside import ConvexSolids
from symbrion_gym._src.errors import ArenaError


@dataclass(frozen=True)
class UpdateConfig:
    """When contact geometry is made again, and where. Distances are in accuracies of the arena.

    Attributes:
        tolerance: a changed place of the surface needs other contact where it is farther from contact than this: what
            good contact geometry keeps at 95 of 100 places.
        min_samples: fewer places of a piece that stand in front of the surface are noise.
        sample_spacing: distance of the places that are looked at [m]: a third of a Scout's width.
        max_samples: places that are looked at on the surface, and on each piece.
        most_area: where more than this share of the surface needs other contact, all of it is made again.
        least_points: places on which the distances of a changed part are measured, at least.
        context_rings: rings of faces around a part that are looked at when it is built: they tell its planes. More are
            slower, and reach into other planes.
        more_pieces: all is built again where there would be more than this many times the pieces ...
        more_few: ... and this many more: contacts with many pieces are slower.
        least_share: a part is built with this share of the points of a whole surface, at least.
        digits: decimals to which vertices are equal [m]: those of an arena's files.

    Raises:
        ArenaError: a field is not above 0.
    """

    tolerance: float = 3.0
    min_samples: int = 3
    sample_spacing: float = 0.03
    max_samples: int = 20_000
    most_area: float = 0.5
    least_points: int = 2_000
    context_rings: int = 4
    more_pieces: float = 2.0
    more_few: int = 128
    least_share: float = 0.1
    digits: int = 4

    def __post_init__(self) -> None:
        check_positive(self, [field.name for field in fields(self)], ArenaError)


UPDATE_DEFAULTS = UpdateConfig()
_SAME_DISTANCE = 1e-6
"""Two faces are equally far from a place where their distances differ by no more [m]."""
_AGAINST = -0.99
"""Cosine between the normals of two faces that look at one another: 172 degrees and more."""
_WEIGHTS = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / np.array([[3], [6], [6], [6]])
"""Barycentric coordinates of the places of a face that are looked at."""


class LocalChanges(NamedTuple):
    """Where contact geometry no longer follows the surface.

    Attributes:
        is_removed: pieces that stand where nothing is any more.
        is_open: faces of the new surface that the other pieces do not follow.
        is_changed: faces of the new surface that the old one does not have.
    """

    is_removed: Bool[np.ndarray, " P"]
    is_open: Bool[np.ndarray, " F"]
    is_changed: Bool[np.ndarray, " F"]


def find_local_changes(
    old: trimesh.Trimesh,
    new: trimesh.Trimesh,
    pieces: list[trimesh.Trimesh],
    accuracy: float,
    config: UpdateConfig = UPDATE_DEFAULTS,
) -> LocalChanges:
    """Compare the contact geometry of a surface with what the surface is now.

    Args:
        old: the surface that the pieces were made of.
        new: the surface now; what did not change is equal but for the rounding of files.
        pieces: convex solids.
        accuracy: of the pieces [m].
        config: what counts.
    """
    is_changed, was_changed = find_changed_faces(old, new, config.digits)
    is_removed = np.zeros(len(pieces), dtype=bool)
    is_open = np.zeros(len(new.faces), dtype=bool)
    if not is_changed.any() and not was_changed.any():
        return LocalChanges(is_removed, is_open, is_changed)
    limit = config.tolerance * accuracy
    same = trimesh.Trimesh(new.vertices, np.asarray(new.faces)[~is_changed], process=False)
    is_changed &= ~_find_covered(new, is_changed, same, 10.0**-config.digits)
    places = np.concatenate(
        [new.triangles[is_changed].reshape(-1, 3), old.triangles[was_changed].reshape(-1, 3)]
    )
    low, high = places.min(axis=0) - limit, places.max(axis=0) + limit
    for row, piece in enumerate(pieces):
        if (piece.bounds[0] <= high).all() and (piece.bounds[1] >= low).all():
            others = [other for place, other in enumerate(pieces) if place != row and _may_meet(piece, other)]
            is_removed[row] = _stands_alone(piece, others, old, new, same, limit, config)
    # What only removed pieces followed needs contact too, also where the surface did not change.
    about = is_changed.copy()
    for row in np.flatnonzero(is_removed):
        is_near = np.zeros(len(new.vertices), dtype=bool)
        is_near[find_near_box(np.asarray(new.vertices), pieces[row].bounds, limit)] = True
        about |= any_corner(is_near, np.asarray(new.faces))
    kept = [piece for piece, gone in zip(pieces, is_removed, strict=True) if not gone]
    tested = np.flatnonzero(about)
    is_open[tested] = _find_open(new, tested, pieces, kept, is_changed[tested], limit, config)
    return LocalChanges(is_removed, is_open, is_changed)


def find_changed_faces(
    old: trimesh.Trimesh, new: trimesh.Trimesh, digits: int
) -> tuple[Bool[np.ndarray, " G"], Bool[np.ndarray, " F"]]:
    """Return which faces of the new surface the old one does not have, and which of the old one are gone.

    Args:
        old: the surface before, as it was made or as it was read from a file that rounds.
        new: the surface now.
        digits: decimals that are compared [m].
    """
    place = find_same_faces(_sort_corners(old, digits), _sort_corners(new, digits))
    was_changed = np.ones(len(old.faces), dtype=bool)
    was_changed[place[place >= 0]] = False
    return place < 0, was_changed


def _sort_corners(mesh: trimesh.Trimesh, digits: int) -> Sheet:
    """Return the rounded surface with each face beginning at its lowest corner: equal wherever it began."""
    # + 0.0 turns -0.0 into 0.0: their bits differ.
    vertices = np.ascontiguousarray(np.round(np.asarray(mesh.vertices, dtype=np.float64), digits) + 0.0)
    faces = np.asarray(mesh.faces, dtype=np.int64)
    order = np.empty(len(vertices), dtype=np.int64)
    order[np.lexsort(vertices.T)] = np.arange(len(vertices))
    first = order[faces].argmin(axis=1)
    return Sheet(vertices, np.take_along_axis(faces, (first[:, None] + np.arange(3)) % 3, axis=1))


def _find_covered(
    mesh: trimesh.Trimesh, is_tested: Bool[np.ndarray, " F"], same: trimesh.Trimesh, limit: float
) -> Bool[np.ndarray, " F"]:
    """Return which faces lie on what is unchanged and look into it: nothing can touch the bottom of a box on a floor.

    Args:
        mesh: the new surface.
        is_tested: faces that are looked at.
        same: what both surfaces have.
        limit: faces this near lie on one another [m].
    """
    is_covered = np.zeros(len(mesh.faces), dtype=bool)
    rows = np.flatnonzero(is_tested)
    if not len(rows) or not len(same.faces):
        return is_covered
    places, normals = sample_faces(mesh, rows)
    distance, face, _ = find_nearest(places, np.asarray(same.vertices), np.asarray(same.faces))
    is_against = np.einsum("ni,ni->n", normals, same.face_normals[face]) < _AGAINST
    is_covered[rows] = ((distance <= limit) & is_against).reshape(len(rows), -1).all(axis=1)
    return is_covered


def _may_meet(one: trimesh.Trimesh, other: trimesh.Trimesh) -> bool:
    return bool((one.bounds[0] <= other.bounds[1]).all() and (one.bounds[1] >= other.bounds[0]).all())


def _stands_alone(
    piece: trimesh.Trimesh,
    others: list[trimesh.Trimesh],
    old: trimesh.Trimesh,
    new: trimesh.Trimesh,
    same: trimesh.Trimesh,
    limit: float,
    config: UpdateConfig,
) -> bool:
    """Return whether a piece stands in front of the new surface where it did not stand in front of the old one.

    Args:
        piece: a convex solid.
        others: pieces that may hide parts of it.
        old: the surface before.
        new: the surface now.
        same: what both have.
        limit: how far counts [m].
        config: what counts.
    """
    number = int(np.clip(piece.area / config.sample_spacing**2, config.min_samples, config.max_samples))
    places = sample_area(np.asarray(piece.vertices), np.asarray(piece.faces), number)
    heights = find_heights(places, new)
    places, heights = places[heights > limit], heights[heights > limit]
    if len(places) >= config.min_samples:
        is_new = find_heights(places, old) < limit / 2
        places, heights = places[is_new], heights[is_new]
    if len(places) >= config.min_samples and len(same.faces):
        # Where two faces lie on one another, as the bottom of a box on a floor does, the old one decides.
        behind = -find_heights(places, same)
        places = places[~((behind > 0) & (behind <= heights + _SAME_DISTANCE))]
    if len(places) >= config.min_samples and others:
        places = places[ConvexSolids(others).find_depths(places) <= 0.0]
    return len(places) >= config.min_samples


def find_heights(places: Float[np.ndarray, "N 3"], mesh: trimesh.Trimesh) -> Float[np.ndarray, " N"]:
    """Return how far places are from a surface [m]; below 0 behind it."""
    distance, face, nearest = find_nearest(places, np.asarray(mesh.vertices), np.asarray(mesh.faces))
    side = np.einsum("ni,ni->n", places - nearest, mesh.face_normals[face])
    return np.where(side < 0, -distance, distance)


def _find_open(
    mesh: trimesh.Trimesh,
    tested: Int[np.ndarray, " T"],
    pieces: list[trimesh.Trimesh],
    kept: list[trimesh.Trimesh],
    is_changed: Bool[np.ndarray, " T"],
    limit: float,
    config: UpdateConfig,
) -> Bool[np.ndarray, " T"]:
    """Return which faces have a place that the kept pieces do not follow, and of unchanged ones that all did.

    Args:
        mesh: the new surface.
        tested: faces that are looked at.
        pieces: all pieces.
        kept: those that stay.
        is_changed: of the tested faces.
        limit: distance up to which a piece follows [m].
        config: what counts.
    """
    places, normals = sample_faces(mesh, tested)
    is_far = measure_gaps(places, normals, kept) > limit
    if len(kept) < len(pieces):
        was_far = measure_gaps(places, normals, pieces) > limit
        is_far &= ~was_far | np.repeat(is_changed, len(_WEIGHTS))
    else:
        is_far &= np.repeat(is_changed, len(_WEIGHTS))
    return np.asarray(is_far.reshape(len(tested), -1).any(axis=1))


def sample_faces(
    mesh: trimesh.Trimesh, rows: Int[np.ndarray, " R"]
) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, "N 3"]]:
    """Return the middle of some faces and half the way from there to each corner [m], and where these look."""
    places = np.einsum("sc,fci->fsi", _WEIGHTS, mesh.triangles[rows]).reshape(-1, 3)
    return places, np.repeat(mesh.face_normals[rows], len(_WEIGHTS), axis=0)


def measure_gaps(
    places: Float[np.ndarray, "N 3"], normals: Float[np.ndarray, "N 3"], pieces: list[trimesh.Trimesh]
) -> Float[np.ndarray, " N"]:
    """Return how far places on a surface are from the nearest contact [m], inside of pieces or outside.

    Args:
        places: on the surface [m].
        normals: where the surface looks there.
        pieces: convex solids; infinity where there are none.
    """
    if not pieces:
        return np.full(len(places), np.inf)
    solids = ConvexSolids(pieces)
    raised = solids.find_depths_behind(places, normals)
    distance, _, _ = find_nearest(places, solids.vertices, solids.faces)
    return np.where(raised > 0, raised, distance)
