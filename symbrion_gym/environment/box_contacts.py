"""Contact pieces as boxes, where boxes are as good: a track touches a box eight times faster than a hull.

A piece of a course is a slab: each plane of its top becomes a box beneath it, as deep as the ground hides it.
Boxes take a piece's place only where what can be touched agrees; all other pieces stay as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import mujoco
import numpy as np
import trimesh
from scipy.spatial import ConvexHull

TOLERANCE = 0.003
"""How far the outside of the boxes may lie from that of the pieces [m]: as far as pieces from a scan."""
_MOST_PIECES = 24
"""With more pieces the search would take longer than it saves."""
_SAME_PLANE = np.cos(np.deg2rad(3.0))
_SMALLEST_SHARE = 0.01
"""Planes with a smaller share of a piece's top are its rounded edges."""
_DEPTHS = (0.40, 0.30, 0.25, 0.20, 0.15, 0.10, 0.05)
_CLEAR = 0.01
"""So far before a surface it must be free for the surface to be touched [m]."""
_RIM = 0.03
"""Nothing is touched so close to the rim of the arena [m]: a module's centre beyond it has fallen off."""
_SPACING = 0.08
_SLIVER = 0.002
"""Faces narrower than this are left to their neighbours [m]."""


class Box(NamedTuple):
    """A box.

    Attributes:
        center: `[3]` [m].
        half_sizes: `[3]` [m].
        axes: `[3, 3]` its axes, as columns.
    """

    center: np.ndarray
    half_sizes: np.ndarray
    axes: np.ndarray

    @property
    def planes(self) -> np.ndarray:
        """Its sides, `[6, 4]`: n and c with n x <= c inside."""
        normals = np.concatenate([self.axes.T, -self.axes.T])
        return np.column_stack([normals, normals @ self.center + np.tile(self.half_sizes, 2)])

    @property
    def mesh(self) -> trimesh.Trimesh:
        """Its surface."""
        box = trimesh.creation.box(2 * self.half_sizes)
        return trimesh.Trimesh(box.vertices @ self.axes.T + self.center, box.faces, process=False)


def replace_by_boxes(spec: mujoco.MjSpec, pieces: Sequence[trimesh.Trimesh]) -> None:
    """Let boxes stand for the pieces of an arena in its model, `arena_piece_i`, where they are as good."""
    geoms = [spec.geom(f"arena_piece_{i}") for i in range(len(pieces))]
    if all(geom.type == mujoco.mjtGeom.mjGEOM_BOX for geom in geoms):
        return
    for i, boxes in find_boxes(pieces).items():
        geom = geoms[i]
        if geom.type == mujoco.mjtGeom.mjGEOM_BOX:
            continue
        spec.delete(spec.mesh(geom.meshname))
        geom.meshname = ""
        for k, box in enumerate(boxes):
            part = geom
            if k > 0:
                part = spec.worldbody.add_geom(name=f"{geom.name}_{k}", group=geom.group, rgba=geom.rgba)
                part.friction = geom.friction
            quaternion = np.empty(4)
            mujoco.mju_mat2Quat(quaternion, box.axes.ravel())
            part.type, part.pos = mujoco.mjtGeom.mjGEOM_BOX, box.center
            part.size, part.quat = box.half_sizes, quaternion


def find_boxes(pieces: Sequence[trimesh.Trimesh], tolerance: float = TOLERANCE) -> dict[int, list[Box]]:
    """Return the boxes that may take a piece's place, by number of the piece.

    Args:
        pieces: the convex pieces of an arena.
        tolerance: largest distance of the two outsides [m].
    """
    if len(pieces) > _MOST_PIECES:
        return {}
    corners = [np.ascontiguousarray(piece.vertices, dtype=np.float64).tobytes() for piece in pieces]
    return dict(_find_boxes(tuple(corners), tolerance))


@lru_cache(maxsize=32)
def _find_boxes(corners: tuple[bytes, ...], tolerance: float) -> dict[int, list[Box]]:
    hulls = [trimesh.convex.convex_hull(np.frombuffer(one).reshape(-1, 3)) for one in corners]
    planes = [_find_planes(np.asarray(hull.vertices)) for hull in hulls]
    found: dict[int, list[Box]] = {}
    for i, hull in enumerate(hulls):
        surface, rest = _sample(hull), planes[:i] + planes[i + 1 :]
        is_bridge = _is_over_free_space(surface, rest)
        boxes = _fit_boxes(hull, planes, tolerance, is_bridge)
        if not boxes:
            continue
        bare = surface[_find_gap(surface[:, :3], [box.planes for box in boxes] + rest) > tolerance]
        if not _is_touchable(bare, planes, is_bridge).any():
            found[i] = boxes
    return found


def _find_planes(vertices: np.ndarray) -> np.ndarray:
    """Return the sides of a convex body, `[F, 4]`: n and c with n x <= c inside."""
    equations = ConvexHull(vertices).equations
    return np.unique(np.round(equations * [1, 1, 1, -1], 9), axis=0)


def _find_gap(points: np.ndarray, shapes: Sequence[np.ndarray]) -> np.ndarray:
    """Return how far points lie outside of the nearest convex body, `[N]` [m]; negative inside."""
    gaps = [(planes[:, :3] @ points.T - planes[:, 3:]).max(axis=0) for planes in shapes]
    return np.min(gaps, axis=0) if gaps else np.full(len(points), np.inf)


def _find_tops(xy: np.ndarray, shapes: Sequence[np.ndarray]) -> np.ndarray:
    """Return the highest z of each body over places, `[S, N]` [m]; -inf beside it."""
    tops = np.full((len(shapes), len(xy)), -np.inf)
    for top, planes in zip(tops, shapes, strict=True):
        slope = planes[:, 2]
        level, up, down = np.abs(slope) < 1e-6, slope >= 1e-6, slope <= -1e-6
        rest = planes[:, 3:] - planes[:, :2] @ xy.T
        high = (rest[up] / slope[up, None]).min(axis=0)
        low = (rest[down] / slope[down, None]).max(axis=0)
        is_over = (low <= high) & (rest[level] >= 0.0).all(axis=0)
        top[is_over] = high[is_over]
    return tops


def _is_touchable(samples: np.ndarray, shapes: Sequence[np.ndarray], is_bridge: bool) -> np.ndarray:
    """Return which samples `[N, 6]`, place and outward normal, a robot could touch.

    Args:
        samples: of a surface.
        shapes: all pieces of the arena.
        is_bridge: the surface may be touched from below too.
    """
    before = samples[:, :3] + _CLEAR * samples[:, 3:]
    around = [before[:, :2] + _RIM * np.array(d) for d in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    is_inner = np.all([np.isfinite(_find_tops(xy, shapes).max(axis=0)) for xy in around], axis=0)
    return is_inner & (is_bridge | (before[:, 2] > _find_tops(before[:, :2], shapes).max(axis=0)))


def _is_over_free_space(surface: np.ndarray, others: Sequence[np.ndarray]) -> bool:
    """Return whether there is air between a piece, of which samples are given, and what lies below it."""
    below = surface[surface[:, 5] < -0.3, :3] - [0.0, 0.0, _CLEAR]
    if not others or not len(below):
        return False
    tops = _find_tops(below[:, :2], others)
    has_ground = (np.isfinite(tops) & (tops < below[:, 2])).any(axis=0)
    return bool((has_ground & (_find_gap(below, others) > 0.0)).any())


def _sample(mesh: trimesh.Trimesh) -> np.ndarray:
    """Return points on a mesh a few centimetres apart, with outward normals, `[N, 6]`."""
    samples = [np.zeros((0, 6))]
    for corners, normal in zip(mesh.triangles, mesh.face_normals, strict=True):
        lengths = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
        a, b, c = np.roll(corners, -int(lengths.argmax()), axis=0)
        height = np.linalg.norm(np.cross(b - a, c - a)) / lengths.max()
        if height < _SLIVER:
            continue
        along, up = (int(v / _SPACING) + 2 for v in (lengths.max(), height))
        s, t = (v.ravel() for v in np.meshgrid(np.linspace(0, 1, along), np.linspace(0, 1, up)))
        points = a + (s * (1 - t))[:, None] * (b - a) + t[:, None] * (c - a)
        samples.append(np.column_stack([points, np.broadcast_to(normal, points.shape)]))
    return np.concatenate(samples)


def _fit_boxes(
    hull: trimesh.Trimesh, planes: list[np.ndarray], tolerance: float, is_bridge: bool
) -> list[Box]:
    """Return a box beneath each plane of a piece's top; none where one of them would stick out."""
    boxes = []
    for faces in _group_top(hull):
        areas = hull.area_faces[faces]
        normal = np.average(hull.face_normals[faces], axis=0, weights=areas)
        normal /= np.linalg.norm(normal)
        level = float(np.average(hull.triangles_center[faces] @ normal, weights=areas))
        corners = hull.vertices[np.unique(hull.faces[faces])]
        error, top, half, axes = _fit_rectangle(corners, normal, level, planes, is_bridge)
        if np.isinf(error):
            return []
        for depth in (float(np.ptp(hull.vertices @ normal)), *_DEPTHS):
            box = Box(top - normal * depth / 2, np.array([*half, depth / 2]), axes)
            samples = _sample(box.mesh)
            proud = samples[_find_gap(samples[:, :3], planes) > tolerance]
            if not _is_touchable(proud, planes, is_bridge).any():
                boxes.append(box)
                break
        else:
            return []
    return boxes


def _group_top(hull: trimesh.Trimesh) -> list[np.ndarray]:
    """Return the faces of each plane of the top."""
    rest = [i for i in np.argsort(-hull.area_faces) if hull.face_normals[i, 2] > 0.3]
    total, groups = hull.area_faces[rest].sum(), []
    while rest:
        is_like = hull.face_normals[rest] @ hull.face_normals[rest[0]] > _SAME_PLANE
        group = np.array(rest)[is_like]
        rest = [i for i, like in zip(rest, is_like, strict=True) if not like]
        if hull.area_faces[group].sum() > _SMALLEST_SHARE * total:
            groups.append(group)
    return groups


def _fit_rectangle(
    corners: np.ndarray, normal: np.ndarray, level: float, planes: list[np.ndarray], is_bridge: bool
) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
    """Return error, centre `[3]`, half sizes `[2]` and axes (columns) `[3, 3]` of a face as a rectangle.

    Its edges that can be touched decide; those at the rim of the arena hardly count.
    """
    u = np.cross([0.0, 1.0, 0.0] if abs(normal[1]) < 0.7 else [1.0, 0.0, 0.0], normal)
    u /= np.linalg.norm(u)
    plane = np.stack([u, np.cross(normal, u)])
    flat = corners @ plane.T
    ring = flat[ConvexHull(flat).vertices]
    edges = np.roll(ring, -1, axis=0) - ring
    lengths = np.linalg.norm(edges, axis=1)
    points = (ring[:, None] + np.linspace(0.02, 0.98, 33)[:, None] * edges[:, None]).reshape(-1, 2)
    outward = np.repeat(np.column_stack([edges[:, 1], -edges[:, 0]]) / lengths[:, None], 33, axis=0)
    samples = np.column_stack([points @ plane + level * normal, outward @ plane])
    weight = np.repeat(lengths, 33) * np.where(_is_touchable(samples, planes, is_bridge), 1.0, 1e-3)
    fits = [_fit_sides(points, outward, weight, edges[k]) for k in np.argsort(-lengths)[:6]]
    error, limits, frame = min(fits, key=lambda fit: fit[0])
    axes = np.column_stack([*(frame @ plane), normal])
    return error, axes @ np.array([*limits.mean(axis=1), level]), np.ptp(limits, axis=1) / 2, axes


def _fit_sides(
    points: np.ndarray, outward: np.ndarray, weight: np.ndarray, edge: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray]:
    """Return squared error, limits `[2, 2]` and axes (rows) `[2, 2]` of a rectangle along an edge.

    A triangle has too few sides: its error is infinite.
    """
    along = edge / np.linalg.norm(edge)
    frame = np.array([along, [-along[1], along[0]]])
    turned, place = outward @ frame.T, points @ frame.T
    axis = np.abs(turned).argmax(axis=1)
    rows = np.arange(len(points))
    side, value = 2 * axis + (turned[rows, axis] > 0.0), place[rows, axis]
    if len(np.unique(side)) < 4:
        return np.inf, np.zeros((2, 2)), frame
    limits = np.array([np.average(value[side == k], weights=weight[side == k]) for k in range(4)])
    return float(weight @ (value - limits[side]) ** 2), limits.reshape(2, 2), frame
