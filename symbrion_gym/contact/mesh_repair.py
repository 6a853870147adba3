"""Whatever mesh a user has, made fit for building on, or refused."""

from __future__ import annotations

import logging
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components

from reconstruction.files.bounded_read import MAX_BYTES, check_size
from symbrion_gym.errors import ArenaError

LARGEST_COORDINATE = 1e6
"""[m]; MuJoCo keeps vertices in single precision, 6 cm apart out there."""
_MAX_FACES = 30_000
"""Larger meshes are simplified first: planes need no more, and time is bounded."""
_UNBOUNDED = (".bz2", ".gz", ".tbz2", ".tgz", ".xz")
"""Packings that trimesh unpacks whatever their size; `zip` tells its size."""
_MIN_PART = 0.02
"""Loose parts below this share of the area are dropped."""

_logger = logging.getLogger(__name__)


def load_surface(path: str | Path) -> trimesh.Trimesh:
    """Read a mesh file, as many formats as trimesh knows; of packed ones .zip and .3mf alone.

    Raises:
        ArenaError: no such file, too large once unpacked, or it holds no triangles.
    """
    path = Path(path)
    if not path.is_file():
        raise ArenaError(f"no mesh file {path}")
    if path.suffix.lower() in _UNBOUNDED:
        raise ArenaError(f"{path}: a packed mesh is not read; unpack it first")
    try:
        if zipfile.is_zipfile(path):  # .zip, .3mf; zipfile unpacks no member beyond the size told here
            with zipfile.ZipFile(path) as archive:
                check_size(sum(member.file_size for member in archive.infolist()), MAX_BYTES)
        mesh = trimesh.load_mesh(path, process=False)
    except Exception as error:  # trimesh raises whatever its many readers raise
        raise ArenaError(f"{path}: cannot be read as a mesh ({error})") from error
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise ArenaError(f"{path}: holds no triangles; a point cloud wants reconstruct() first")
    return mesh


def repair_mesh(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return a copy without useless parts, wound one way, open terrain with its normals up.

    Dropped are faces with a vertex that is not finite, flat faces, faces given twice and small loose parts;
    vertices at one place become one, but for those where two fans of faces only touch.

    Raises:
        ArenaError: nothing usable is left, or its size is not that of a place for robots.
    """
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    faces = np.asarray(mesh.faces, dtype=np.int64)
    if faces.ndim != 2 or not len(faces):
        raise ArenaError("the mesh has no faces; a point cloud wants reconstruct() first")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise ArenaError(f"a face names vertex {faces.max()}, but there are {len(vertices)} vertices")
    is_finite = np.asarray(np.all(np.isfinite(vertices), axis=1))
    faces = faces[is_finite[faces].all(axis=1)]
    _refuse_odd_sizes(vertices[faces.ravel()])
    vertices, faces = _merge_vertices(vertices, faces)
    faces = _drop_flat_faces(vertices, faces)
    faces = _drop_small_parts(vertices, faces)
    if len(faces) > _MAX_FACES:
        vertices, faces = simplify(vertices, faces, _MAX_FACES)
    faces = _wind(vertices, faces)
    vertices, faces = _split_pinched(vertices, faces)
    repaired = trimesh.Trimesh(vertices, faces, process=False)
    # MuJoCo wants four vertices.
    return repaired if len(vertices) >= 4 else repaired.subdivide()


def _refuse_odd_sizes(points: np.ndarray) -> None:
    if not len(points):
        raise ArenaError("no face of the mesh has three finite vertices")
    extent = float(np.ptp(points, axis=0).max())
    if not 1e-3 < extent < 1e4:
        raise ArenaError(f"the mesh is {extent:g} m large; 1 mm to 10 km is possible: are its units metres?")
    farthest = float(np.abs(points).max())
    if farthest > LARGEST_COORDINATE:
        raise ArenaError(
            f"the mesh lies {farthest:g} m from the origin, {LARGEST_COORDINATE:g} m is the most: "
            "subtract an offset from its vertices"
        )


def _merge_vertices(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Join vertices at the same place, to a millionth of the extent."""
    used, numbers = np.unique(faces, return_inverse=True)
    vertices, faces = vertices[used], numbers.reshape(-1, 3)
    keys = np.round(vertices / (1e-6 * float(np.ptp(vertices, axis=0).max()))).astype(np.int64)
    _, first, group = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return vertices[first], group.ravel()[faces]


def _drop_flat_faces(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    faces = faces[np.linalg.norm(normals, axis=1) > 1e-6 * np.maximum(longest, 1e-12) ** 2]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    if not len(first):
        raise ArenaError("every face of the mesh is flat (without an area)")
    return faces[np.sort(first)]


def _drop_small_parts(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    links = csr_matrix(
        (np.ones(3 * len(faces)), (faces.ravel(), np.roll(faces, 1, axis=1).ravel())),
        shape=[len(vertices)] * 2,
    )
    _, part = connected_components(links, directed=False)
    part = part[faces[:, 0]]
    corners = vertices[faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    shares = np.bincount(part, areas) / areas.sum()
    is_kept = (shares >= _MIN_PART) | (shares == shares.max())
    if not is_kept[part].all():
        _logger.info("dropped %d faces in small loose parts", int((~is_kept[part]).sum()))
    return faces[is_kept[part]]


def decimate(vertices: np.ndarray, faces: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
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


def simplify(vertices: np.ndarray, faces: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return about `count` faces by quadric decimation, or by clustering vertices where that wrecks the mesh."""
    before = _merge_vertices(vertices, faces)
    vertices, faces = decimate(*before, count)
    is_sound = len(faces) > 0 and np.isfinite(vertices).all()
    if is_sound:
        low, high = before[0].min(axis=0), before[0].max(axis=0)
        reach = 0.02 * float((high - low).max())
        is_sound = bool((vertices >= low - reach).all() and (vertices <= high + reach).all())
    if not is_sound or len(faces) > 2 * count:
        cell = float(np.ptp(before[0], axis=0).max()) / np.sqrt(count)
        _, first, group = np.unique(
            np.floor(before[0] / cell).astype(np.int64), axis=0, return_index=True, return_inverse=True
        )
        vertices, faces = before[0][first], group.ravel()[before[1]]
    return vertices, _drop_flat_faces(vertices, faces)


def _split_pinched(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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
    first: np.ndarray, second: np.ndarray, signs: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Signs `[count]` whose products over links are the given ones along a spanning tree, and the parts."""
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


def _wind(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Turn faces so that neighbours agree, then each part outwards (closed) or up (open)."""
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
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    volume = np.bincount(
        part, np.einsum("fi,fi->f", normals, corners.mean(axis=1) - vertices.mean(axis=0)) / 3
    )
    rise = np.bincount(part, normals[:, 2])
    num_open = np.bincount(part[owner[order[starts[count == 1]]]], minlength=len(rise))
    is_wrong = np.where(num_open == 0, volume < 0, rise < 0)
    return np.where(is_wrong[part][:, None], faces[:, ::-1], faces)
