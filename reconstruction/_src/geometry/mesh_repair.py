"""Whatever mesh a user has, repaired so that others can build on it, or refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.geometry.manifold import group_sides, make_winding
from reconstruction._src.geometry.orientation import (
    OPEN_SHARE,
    compute_components,
    is_room,
    orient_outwards,
    split_fans,
)
from reconstruction._src.geometry.rows import (
    Faces,
    Vertices,
    all_rows,
    compute_area_vectors,
    compute_areas,
    compute_lengths,
    drop_unused,
    sum_by_owner,
)

LARGEST_COORDINATE = 1e6  # [m]; numbers in single precision are 6 cm apart out there
_EXTENTS = (1e-3, 1e4)
"""Smallest and largest extent of a place for robots [m]: others are meshes in another unit."""
_SAME_PLACE = 1e-6
"""Vertices closer than this, relative to the extent, are one: the resolution of single precision."""
_FLAT = 1e-6  # A face whose height is smaller, relative to its longest edge, is flat
_SHORTEST = 1e-12  # Keeps the square of an edge above zero [m]
_OVERSHOOT = 0.02
"""Quadric decimation may leave the bounds of the mesh by this share of the extent; beyond, it has gone wrong."""
_LONGEST = 5.0
"""A sliver: its edge at the rim is longer than this many median edges of the surface: a network leaves none ..."""
_MIN_ANGLE_DEG = 120.0  # ... and its corner off the rim has an angle above this [degrees]: it is low ...
_MIN_BEND_DEG = 10.0
"""... and it is bent against its neighbors by more than this [degrees]: a low triangle of flat ground is part of it."""
_TOLD = 0.9  # Share of the area of a part that is wound alike, less the rest: its winding tells its outside
_UPRIGHT = 0.2
"""A part is a wall where the upward part of its mean normal, of length 1, is less: it is 78 degrees steep."""
_MAX_FACES = 30_000  # Larger meshes are simplified first: planes need no more, and time is bounded
_MIN_PART = 3e-4
"""Loose parts with a smaller share of the area are dropped: specks that a scan leaves in the air. Larger shares lose
furniture."""
_ROUNDS = 20  # Slivers behind slivers are removed, too, in no more rounds than these


def repair_mesh(
    mesh: trimesh.Trimesh, *, keeps_winding: bool = False, drops_slivers: bool = False
) -> trimesh.Trimesh:
    """Return a copy without useless parts, wound one way, open terrain with its normals up.

    A winding that tells where free space is stays if asked for, and parts that it parts come apart. Else neighbors are
    turned alike, closed parts as they are wound, if they are so throughout, or outwards, and open ones up.

    Dropped are faces with a vertex that is not finite, flat faces, faces given twice and small loose parts, and
    slivers at the rim if asked for; vertices at one place become one, but for those where two fans of faces only touch.
    """
    vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
    if faces.ndim != 2 or not len(faces):
        raise ReconstructionError("the mesh has no faces; a point cloud wants reconstruct() first")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise ReconstructionError(
            f"a face names vertex {faces.max()}, but there are {len(vertices)} vertices"
        )
    if vertices.shape[1:] != (3,):
        raise ReconstructionError(f"vertices have three coordinates, not {vertices.shape[-1]}")
    faces = faces[all_rows(all_rows(np.isfinite(vertices))[faces])]
    _refuse_odd_sizes(vertices[faces.ravel()])
    vertices, faces = merge_vertices(vertices, faces)
    faces = drop_flat_faces(vertices, faces)
    part, areas = compute_components(faces, len(vertices)), compute_areas(vertices, faces)
    shares = np.bincount(part, areas) / areas.sum()
    faces = faces[((shares >= _MIN_PART) | (shares == shares.max()))[part]]
    if drops_slivers:
        faces = drop_rim_slivers(vertices, faces)
    if len(faces) > _MAX_FACES:
        vertices, faces = simplify(vertices, faces, _MAX_FACES)
    wound = faces if keeps_winding else make_winding(vertices, faces)
    is_kept = (wound == faces).all(axis=1)
    vertices, faces = drop_unused(*split_fans(vertices, wound))
    if not keeps_winding:
        faces = _turn_parts(vertices, faces, is_kept)
    repaired = trimesh.Trimesh(vertices, faces, process=False)
    # A solid has four vertices or more, and simulators want no fewer of a surface.
    return repaired if len(vertices) >= 4 else repaired.subdivide()


def merge_vertices(vertices: Vertices, faces: Faces) -> tuple[Float[np.ndarray, "W 3"], Faces]:
    """Join vertices at the same place, to a millionth of the extent; drop those of no face."""
    vertices, faces = drop_unused(vertices, faces)
    keys = np.round(vertices / (_SAME_PLACE * float(np.ptp(vertices, axis=0).max()))).astype(np.int64)
    _, first, group = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return vertices[first], group.ravel()[faces]


def drop_flat_faces(vertices: Vertices, faces: Faces) -> Int[np.ndarray, "G 3"]:
    """Drop faces without an area, and all but the first of faces with the same corners."""
    longest = _compute_sides(vertices, faces).max(axis=1)
    double = 2 * compute_areas(vertices, faces)
    faces = faces[double > _FLAT * np.maximum(longest, _SHORTEST) ** 2]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    if not len(first):
        raise ReconstructionError("every face of the mesh is flat (without an area)")
    return faces[np.sort(first)]


def simplify(
    vertices: Vertices, faces: Faces, count: int
) -> tuple[Float[np.ndarray, "W 3"], Int[np.ndarray, "G 3"]]:
    """Return about `count` faces by quadric decimation, or by clustering vertices where that wrecks the mesh."""
    import fast_simplification

    all_vertices, all_faces = merge_vertices(vertices, faces)
    if count >= len(all_faces):
        return all_vertices, drop_flat_faces(all_vertices, all_faces)
    arrays: Any = fast_simplification.simplify(
        np.ascontiguousarray(all_vertices, dtype=np.float32),  # pyright: ignore[reportArgumentType]
        np.ascontiguousarray(all_faces, dtype=np.int32),
        target_count=count,
    )
    vertices, faces = np.asarray(arrays[0], dtype=np.float64), np.asarray(arrays[1], dtype=np.int64)
    low, high = all_vertices.min(axis=0), all_vertices.max(axis=0)
    extent = float((high - low).max())
    reach = _OVERSHOOT * extent
    is_inside = (vertices >= low - reach) & (vertices <= high + reach)  # False where not finite
    if not 0 < len(faces) <= 2 * count or not is_inside.all():
        keys = np.floor(all_vertices / (extent / np.sqrt(count))).astype(np.int64)
        _, first, group = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        vertices, faces = all_vertices[first], group.ravel()[all_faces]
    return vertices, drop_flat_faces(vertices, faces)


def drop_rim_slivers(vertices: Vertices, faces: Faces) -> Int[np.ndarray, "G 3"]:
    """Return the faces without slivers at the rim, which bridge ground that no vertex stands for."""
    longest = _LONGEST * float(np.median(_compute_sides(vertices, faces))) if len(faces) else 0.0
    for _ in range(_ROUNDS):
        is_sliver = _find_slivers(vertices, faces, longest)
        if not is_sliver.any() or is_sliver.all():
            break
        faces = faces[~is_sliver]
    return faces


def _refuse_odd_sizes(points: Float[np.ndarray, "N 3"]) -> None:
    if not len(points):
        raise ReconstructionError("no face of the mesh has three finite vertices")
    extent, farthest = float(np.ptp(points, axis=0).max()), float(np.abs(points).max())
    if not _EXTENTS[0] < extent < _EXTENTS[1]:
        raise ReconstructionError(
            f"the mesh is {extent:g} m large; 1 mm to 10 km is possible: are its units meters?"
        )
    if farthest > LARGEST_COORDINATE:
        raise ReconstructionError(
            f"the mesh lies {farthest:g} m from the origin, {LARGEST_COORDINATE:g} m is the most: "
            "subtract an offset from its vertices"
        )


def _turn_parts(vertices: Vertices, faces: Faces, is_kept: Bool[np.ndarray, " F"]) -> Faces:
    """Return the faces, open parts turned up, and closed ones, rooms and upright walls as their file winds them.

    Who scans a room winds it inwards: where nearly all of such a part was wound alike, that tells, of all parts of a
    surface whose floors look up and whose ceilings down. Else as by `orient_outwards`.
    """
    part = compute_components(faces, len(vertices))
    normals = compute_area_vectors(vertices, faces)
    middles, areas = vertices[faces].mean(axis=1), compute_lengths(normals)
    size, total = np.bincount(part, areas), sum_by_owner(part, normals, part.max() + 1)
    kept = np.bincount(part, np.where(is_kept, areas, -areas))
    sides = group_sides(faces, len(vertices))
    rim = sides.slots[sides.starts[sides.counts == 1]] // 3
    is_open = np.bincount(part[rim], minlength=len(size)) > 0
    is_sheet = is_open & (compute_lengths(total) > OPEN_SHARE * size)
    is_sheet &= np.abs(total[:, 2]) > _UPRIGHT * compute_lengths(total)  # of a wall, up tells nothing
    is_inside = is_room(np.where(is_kept, normals[:, 2], -normals[:, 2]), areas, middles[:, 2])
    is_told = (np.abs(kept) > _TOLD * size) & ~(is_sheet & ~is_inside)
    as_told = np.where((kept < 0)[part, None], faces[:, ::-1], faces)
    return np.where(is_told[part, None], as_told, orient_outwards(vertices, faces))


def _compute_sides(vertices: Vertices, faces: Faces) -> Float[np.ndarray, "F 3"]:
    """Return the length of the edge opposite of every corner [m]."""
    corners = vertices[faces]
    return compute_lengths(np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1))


def _find_slivers(vertices: Vertices, faces: Faces, longest: float) -> Bool[np.ndarray, " F"]:
    lengths = _compute_sides(vertices, faces)
    rows, corner = np.arange(len(faces)), lengths.argmax(axis=1)
    long = lengths[rows, corner]
    others = np.sort(lengths, axis=1)[:, :2]
    # Law of cosines at the corner opposite of the longest edge.
    cosine = (others[:, 0] ** 2 + others[:, 1] ** 2 - long**2) / (2.0 * others[:, 0] * others[:, 1])
    is_low = (long > longest) & (cosine < np.cos(np.radians(_MIN_ANGLE_DEG)))
    if not is_low.any():
        return is_low
    sides = group_sides(faces, len(vertices))
    is_rim = np.zeros(3 * len(faces), dtype=bool)
    is_rim[sides.slots[sides.starts[sides.counts == 1]]] = True
    is_low &= is_rim.reshape(-1, 3)[rows, (corner + 1) % 3]
    return is_low & (_compute_bends(vertices, faces) > np.radians(_MIN_BEND_DEG))


def _compute_bends(vertices: Vertices, faces: Faces) -> Float[np.ndarray, " F"]:
    """Return the largest angle of each face with a neighbor [rad]."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    pairs: Int[np.ndarray, "P 2"] = np.asarray(mesh.face_adjacency).reshape(-1, 2)
    bends = np.zeros(len(faces))
    np.maximum.at(bends, pairs.ravel(), np.repeat(np.asarray(mesh.face_adjacency_angles), 2))
    return bends
