"""Whatever mesh a user has, repaired so that others can build on it, or refused."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float, Int
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.geometry.outlines import drop_rim_slivers
from reconstruction._src.geometry.rows import compute_areas

_SAME_PLACE = 1e-6
"""Vertices closer than this, relative to the extent, are one: the resolution of single precision."""
_FLAT = 1e-6  # A face whose height is smaller, relative to its longest edge, is flat
_SHORTEST = 1e-12  # Keeps the square of an edge above zero [m]
_OVERSHOOT = 0.02
"""Quadric decimation may leave the bounds of the mesh by this share of the extent; beyond, it has gone wrong."""


def merge_vertices(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> tuple[Float[np.ndarray, "W 3"], Int[np.ndarray, "F 3"]]:
    """Join vertices at the same place, to a millionth of the extent; drop those of no face."""
    used, numbers = np.unique(faces, return_inverse=True)
    vertices, faces = vertices[used], numbers.reshape(-1, 3)
    keys = np.round(vertices / (_SAME_PLACE * float(np.ptp(vertices, axis=0).max()))).astype(np.int64)
    _, first, group = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return vertices[first], group.ravel()[faces]


def drop_flat_faces(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> Int[np.ndarray, "G 3"]:
    """Drop faces without an area, and all but the first of faces with the same corners."""
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    faces = faces[np.linalg.norm(normals, axis=1) > _FLAT * np.maximum(longest, _SHORTEST) ** 2]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    if not len(first):
        raise ReconstructionError("every face of the mesh is flat (without an area)")
    return faces[np.sort(first)]


def decimate(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], count: int
) -> tuple[Float[np.ndarray, "W 3"], Int[np.ndarray, "G 3"]]:
    """Return about `count` faces by quadric decimation; the result may be wrecked: check it."""
    import fast_simplification

    if count >= len(faces):
        return vertices, faces
    arrays: Any = fast_simplification.simplify(
        np.ascontiguousarray(vertices, dtype=np.float32),  # pyright: ignore[reportArgumentType]
        np.ascontiguousarray(faces, dtype=np.int32),
        target_count=count,
    )
    return np.asarray(arrays[0], dtype=np.float64), np.asarray(arrays[1], dtype=np.int64)


def simplify(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], count: int
) -> tuple[Float[np.ndarray, "W 3"], Int[np.ndarray, "G 3"]]:
    """Return about `count` faces by quadric decimation, or by clustering vertices where that wrecks the mesh."""
    before = merge_vertices(vertices, faces)
    vertices, faces = decimate(*before, count)
    is_sound = len(faces) > 0 and np.isfinite(vertices).all()
    if is_sound:
        low, high = before[0].min(axis=0), before[0].max(axis=0)
        reach = _OVERSHOOT * float((high - low).max())
        is_sound = bool((vertices >= low - reach).all() and (vertices <= high + reach).all())
    if not is_sound or len(faces) > 2 * count:
        cell = float(np.ptp(before[0], axis=0).max()) / np.sqrt(count)
        _, first, group = np.unique(
            np.floor(before[0] / cell).astype(np.int64), axis=0, return_index=True, return_inverse=True
        )
        vertices, faces = before[0][first], group.ravel()[before[1]]
    return vertices, drop_flat_faces(vertices, faces)


LARGEST_COORDINATE = 1e6  # [m]; numbers in single precision are 6 cm apart out there
_EXTENTS = (1e-3, 1e4)
"""Smallest and largest extent of a place for robots [m]: others are meshes in another unit."""

_logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class RepairConfig:
    """What of a mesh is kept."""

    max_faces: int = 30_000  # larger meshes are simplified first: planes need no more, and time is bounded
    # loose parts with a smaller share of the area are dropped: specks that a scan leaves in the air. Larger
    # shares lose furniture.
    min_part: float = 3e-4
    # the winding tells where free space is: each part stays wound as most of its area is. Else closed parts
    # are turned outwards, open ones up.
    keeps_winding: bool = False
    drops_slivers: bool = False  # whether slivers at the rim of an open surface are dropped


REPAIR_DEFAULTS = RepairConfig()


def repair_mesh(mesh: trimesh.Trimesh, config: RepairConfig = REPAIR_DEFAULTS) -> trimesh.Trimesh:
    """Return a copy without useless parts, wound one way, open terrain with its normals up.

    Dropped are faces with a vertex that is not finite, flat faces, faces given twice and small loose parts, and
    slivers at the rim if asked for; vertices at one place become one, but for those where two fans of faces only touch.
    """
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    faces = np.asarray(mesh.faces, dtype=np.int64)
    if faces.ndim != 2 or not len(faces):
        raise ReconstructionError("the mesh has no faces; a point cloud wants reconstruct() first")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise ReconstructionError(
            f"a face names vertex {faces.max()}, but there are {len(vertices)} vertices"
        )
    if vertices.shape[1:] != (3,):
        raise ReconstructionError(f"vertices have three coordinates, not {vertices.shape[-1]}")
    is_finite = np.asarray(np.all(np.isfinite(vertices), axis=1))
    faces = faces[is_finite[faces].all(axis=1)]
    _refuse_odd_sizes(vertices[faces.ravel()])
    vertices, faces = merge_vertices(vertices, faces)
    faces = drop_flat_faces(vertices, faces)
    faces = _drop_small_parts(vertices, faces, config.min_part)
    if config.drops_slivers:
        count = len(faces)
        faces = drop_rim_slivers(vertices, faces)
        _logger.info("dropped %d slivers at the rim", count - len(faces))
    if len(faces) > config.max_faces:
        vertices, faces = simplify(vertices, faces, config.max_faces)
    faces = _wind(vertices, faces, config.keeps_winding)
    vertices, faces = _split_pinched(vertices, faces)
    repaired = trimesh.Trimesh(vertices, faces, process=False)
    # A solid has four vertices or more, and simulators want no fewer of a surface.
    return repaired if len(vertices) >= 4 else repaired.subdivide()


def _refuse_odd_sizes(points: Float[np.ndarray, "N 3"]) -> None:
    if not len(points):
        raise ReconstructionError("no face of the mesh has three finite vertices")
    extent = float(np.ptp(points, axis=0).max())
    if not _EXTENTS[0] < extent < _EXTENTS[1]:
        raise ReconstructionError(
            f"the mesh is {extent:g} m large; 1 mm to 10 km is possible: are its units meters?"
        )
    farthest = float(np.abs(points).max())
    if farthest > LARGEST_COORDINATE:
        raise ReconstructionError(
            f"the mesh lies {farthest:g} m from the origin, {LARGEST_COORDINATE:g} m is the most: "
            "subtract an offset from its vertices"
        )


def _drop_small_parts(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], min_part: float
) -> Int[np.ndarray, "G 3"]:
    links = csr_matrix(
        (np.ones(3 * len(faces)), (faces.ravel(), np.roll(faces, 1, axis=1).ravel())),
        shape=[len(vertices)] * 2,
    )
    _, part = connected_components(links, directed=False)
    part = part[faces[:, 0]]
    corners = vertices[faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    shares = np.bincount(part, areas) / areas.sum()
    is_kept = (shares >= min_part) | (shares == shares.max())
    if not is_kept[part].all():
        _logger.info("dropped %d faces in small loose parts", int((~is_kept[part]).sum()))
    return faces[is_kept[part]]


def _split_pinched(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> tuple[Float[np.ndarray, "W 3"], Int[np.ndarray, "F 3"]]:
    """Give every fan of faces a vertex of its own: faces belong together where two share an edge."""
    corners = np.arange(faces.size).reshape(faces.shape)
    starts, ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    start_corners, end_corners = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    keys = np.stack([np.minimum(starts, ends), np.maximum(starts, ends)], axis=1)
    _, edge, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(edge.ravel(), kind="stable")
    first = order[(np.cumsum(count) - count)[count == 2]]
    second = order[(np.cumsum(count) - count)[count == 2] + 1]
    runs_back = starts[first] == ends[second]
    partner = np.where(runs_back, end_corners[second], start_corners[second])
    other = np.where(runs_back, start_corners[second], end_corners[second])
    rows, columns = np.append(start_corners[first], end_corners[first]), np.append(partner, other)
    links = csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(faces.size, faces.size))
    _, fan = connected_components(links, directed=False)
    _, member = np.unique(fan, return_index=True)
    return vertices[starts[member]], fan.reshape(faces.shape)


def _spread_signs(
    first: Int[np.ndarray, " L"], second: Int[np.ndarray, " L"], signs: Float[np.ndarray, " L"], count: int
) -> tuple[Float[np.ndarray, " count"], Int[np.ndarray, " count"]]:
    """Find signs whose products over links are the given ones along a spanning tree, and the connected parts."""
    links = csr_matrix((np.ones(len(first)), (first, second)), shape=[count, count])
    num_parts, part = connected_components(links, directed=False)
    # One root above all parts makes one tree of them.
    seeds = np.unique(part, return_index=True)[1]
    rows, columns = np.append(first, np.full(num_parts, count)), np.append(second, seeds)
    joined = csr_matrix((np.ones(len(rows)), (rows, columns)), shape=[count + 1, count + 1])
    reached, before = breadth_first_order(joined, count, directed=False)
    keys = np.concatenate([first * (count + 1) + second, second * (count + 1) + first])
    order = np.argsort(keys, kind="stable")
    wanted = before[reached[1:]].astype(np.int64) * (count + 1) + reached[1:]
    slot = np.minimum(np.searchsorted(keys[order], wanted), max(len(keys) - 1, 0))
    is_link = keys[order][slot] == wanted if len(keys) else np.zeros(len(wanted), dtype=bool)
    step = np.where(is_link, np.concatenate([signs, signs])[order][slot] if len(keys) else 1.0, 1.0)
    turn = np.ones(count + 1)
    for face, parent, sign in zip(
        reached[1:].tolist(), before[reached[1:]].tolist(), step.tolist(), strict=True
    ):
        turn[face] = turn[parent] * sign
    return turn[:count], part


def _wind(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], keeps_winding: bool
) -> Int[np.ndarray, "F 3"]:
    """Turn faces so that neighbors agree, then each part as it was (kept), or outwards (closed), or up (open)."""
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    owner = np.repeat(np.arange(len(faces)), 3)
    is_up = edges[:, 0] < edges[:, 1]
    _, edge, count = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(edge.ravel(), kind="stable")
    starts = np.cumsum(count) - count
    pairs = np.stack([order[starts[count == 2]], order[starts[count == 2] + 1]], axis=1)
    # Two faces agree where their common edge runs both ways.
    agrees = is_up[pairs[:, 0]] != is_up[pairs[:, 1]]
    first, second = owner[pairs[:, 0]], owner[pairs[:, 1]]
    turn, part = _spread_signs(first, second, np.where(agrees, 1.0, -1.0), len(faces))
    faces = np.where(turn[:, None] < 0, faces[:, ::-1], faces)
    if keeps_winding:
        is_turned = np.bincount(part, turn * compute_areas(vertices, faces)) < 0
        return np.where(is_turned[part][:, None], faces[:, ::-1], faces)
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    volume = np.bincount(
        part, np.einsum("fi,fi->f", normals, corners.mean(axis=1) - vertices.mean(axis=0)) / 3
    )
    rise = np.bincount(part, normals[:, 2])
    num_open = np.bincount(part[owner[order[starts[count == 1]]]], minlength=len(rise))
    is_wrong = np.where(num_open == 0, volume < 0, rise < 0)
    return np.where(is_wrong[part][:, None], faces[:, ::-1], faces)
