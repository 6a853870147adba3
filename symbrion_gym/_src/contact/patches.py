"""Convex patches of a surface: neighboring triangles joined while their convex hull stays close to the surface.

Coplanar triangles of a simplified mesh join to convex polygons; rough ground is left as small patches. A patch and
the surface behind it make one convex solid, whatever shape the whole surface has.

References:
    Hertel, Mehlhorn (1983), Fast triangulation of simple polygons: removing diagonals while the parts stay convex
    leaves at most four times as many parts as are needed.
Differs: triangles lie in 3-D, and parts may be concave by a tolerance.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int
from scipy.spatial import ConvexHull, QhullError

from reconstruction._src.geometry.rows import compute_areas, make_hull
from symbrion_gym._src.contact.quality import RayMesh

Depths = Float[np.ndarray, " V"]  # Of the solid behind each vertex [m]
Check = Callable[[Float[np.ndarray, "N 3"]], Bool[np.ndarray, " N"]]  # Of places

_FLAT = 1e-9  # Points whose spread along an axis is smaller lie in a plane [m]
_MAX_TILT_DEG = 35.0
"""A face of a patch is turned from the mean of the patch by no more: a solid behind a more strongly bent patch
would reach far beneath the surface."""
_MAX_VERTICES = 28
"""A patch has no more vertices: with those behind the surface, twice as many make a solid, and MuJoCo's
contacts slow down with more than 64."""
_DEPTH_SHARE = 0.5  # A convex patch may bulge by this share of its thickness
_STEPS = (0.05, 0.3, 1.0)
"""Shares of the tolerance at which all neighbors are tried, the finest first: so that what fits exactly is
joined before what fits loosely."""
_THICKNESS = 0.03
"""Of the solid where nothing lies behind the surface [m]: more than a robot sinks in during a few steps; beams that
pass a boundary of the surface meet the sides of thicker ones."""
_LARGEST_SHARE = 0.05  # A solid is no thicker than this share of the extent of the surface
_NEAR_SHARE = 0.9
"""Of the distance to whatever surface lies behind, where that is nearer: a thin wall stays one."""
_LEAST_THICKNESS = 0.004  # Thinner solids are flat to a simulator [m]
_TWO_SIDED = 0.01
"""Thickness of the solid behind faces that were seen from behind, too [m]: a sheet that stands for both sides of a thin
wall; a robot sinks in less than this."""
_START = 5e-4  # A ray into the solid begins this far behind the surface [m]
_MIN_COSINE = 0.3
"""An inner vertex lies behind every face of its vertex: where the normals at a vertex differ by more than the angle of
this cosine, each face has inner vertices of its own."""
_LEAST_DIRECTION = 0.5  # Unit vectors are longer; the normal of a flat face is not
_THICK = 1e-8  # A solid with an area times depth of more has a volume in single precision, too [m³]
_FLAT_VOLUME = 1e-10
"""A solid with less after rounding to single precision, as MuJoCo stores it, is flat [m³]."""


def thicken_patches(
    mesh: trimesh.Trimesh, tolerance: float, extent: float, is_seen_from_behind: Check
) -> list[trimesh.Trimesh]:
    """Return a convex solid behind each convex patch of a mesh; behind each face where the tolerance is 0."""
    depths = compute_thickness(mesh, extent, is_seen_from_behind)
    vertices, corners = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    patches = join_faces(mesh, depths, tolerance) if tolerance > 0 else list(np.arange(len(corners))[:, None])
    solids, areas = [], np.asarray(mesh.area_faces)
    inner, inner_corners = _find_inner_points(mesh, depths)
    for faces in patches:
        behind = inner[np.unique(inner_corners[faces])]
        hull = make_hull(np.concatenate([vertices[np.unique(corners[faces])], behind]))
        if hull is None:
            continue
        if float(areas[faces].sum() * depths[corners[faces]].min()) <= _THICK:
            rounded = make_hull(np.asarray(hull.vertices, dtype=np.float32))
            if rounded is None or rounded.volume <= _FLAT_VOLUME:
                continue  # MuJoCo refuses flat ones
        solids.append(hull)
    return solids


def compute_thickness(mesh: trimesh.Trimesh, extent: float, is_seen_from_behind: Check) -> Depths:
    """Return how thick the solid behind each vertex may be: up to the other side of a thin wall [m]."""
    scale = min(1.0, _LARGEST_SHARE * extent / _THICKNESS)
    corners, normals = np.asarray(mesh.triangles), np.asarray(mesh.face_normals)
    count = len(mesh.faces)
    places = [corners.mean(axis=1), *((corners[:, k] + corners[:, k - 2]) / 2 for k in range(3))]
    starts = np.concatenate([*places, mesh.vertices])
    inwards = -np.concatenate([np.tile(normals, (4, 1)), np.asarray(mesh.vertex_normals)])
    has_direction = np.linalg.norm(inwards, axis=1) > _LEAST_DIRECTION
    reach = np.full(len(starts), np.inf)
    first = (starts + scale * _START * inwards)[has_direction]
    reach[has_direction] = RayMesh([mesh]).cast(first, inwards[has_direction])
    allowed = np.clip(_NEAR_SHARE * (reach + scale * _START), scale * _LEAST_THICKNESS, scale * _THICKNESS)
    limits = np.where(is_seen_from_behind(starts), scale * _TWO_SIDED, np.inf)
    allowed = np.minimum(allowed, limits)
    faces, depths = allowed[: 4 * count].reshape(4, count).min(axis=0), allowed[4 * count :]
    for k in range(3):
        np.minimum.at(depths, np.asarray(mesh.faces)[:, k], faces)
    return depths


def _find_inner_points(
    mesh: trimesh.Trimesh, depths: Depths
) -> tuple[Float[np.ndarray, "N 3"], Int[np.ndarray, "F 3"]]:
    """Return points behind a mesh, at the depth of each vertex, in ascending order; and those of every face."""
    corners = np.asarray(mesh.faces)
    directions = np.asarray(mesh.vertex_normals)[corners]
    normals = np.asarray(mesh.face_normals)[:, None]
    cosines = np.einsum("fki,fki->fk", directions, np.broadcast_to(normals, directions.shape))
    directions = np.where(cosines[..., None] < _MIN_COSINE, normals, directions)
    inner = np.asarray(mesh.vertices)[corners] - depths[corners][..., None] * directions
    points, numbers = np.unique(inner.reshape(-1, 3), axis=0, return_inverse=True)
    return points, numbers.reshape(-1, 3)


@dataclass
class _Patch:
    """Joined faces."""

    number: int  # of its own
    vertices: set[int]  # numbers of their vertices
    boundary: set[tuple[int, int]]  # edges with one face of the patch, as (low, high)
    creases: set[tuple[int, int]]  # edges between its faces, where they are not flat
    normal: Float[np.ndarray, " 3"]  # sum of the faces' normals, as long as their area [m²]
    normals: Float[np.ndarray, "M 3"]  # of the faces
    areas: Float[np.ndarray, " M"]  # of the faces [m²]
    faces: list[int]  # their numbers
    depth: float  # thickness of the thinnest vertex [m]


def join_faces(mesh: trimesh.Trimesh, depths: Depths, tolerance: float) -> list[Int[np.ndarray, " M"]]:
    """Return the faces of each convex patch."""
    patches = _make_patches(mesh, depths)
    order = _order_edges(mesh)
    owner = np.arange(len(mesh.faces))
    vertices, count = np.asarray(mesh.vertices), len(owner)
    for share in _STEPS:
        failed: set[tuple[int, int]] = set()
        has_joined = True
        while has_joined:
            has_joined = False
            for first, second in order:
                a, b = _find_root(owner, first), _find_root(owner, second)
                # Numbers of patches are used once: a pair that failed is tried again when either has grown.
                pair = (patches[a].number, patches[b].number)
                if a == b or pair in failed:
                    continue
                joined = _join(patches[a], patches[b], vertices, share * tolerance, count)
                if joined is None:
                    failed.add(pair)
                    continue
                count += 1
                patches[a], has_joined = joined, True
                del patches[b]
                owner[b] = a
    return [np.sort(patch.faces) for patch in patches.values()]


def _make_patches(mesh: trimesh.Trimesh, depths: Depths) -> dict[int, _Patch]:
    """Return one patch a face."""
    areas = compute_areas(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    patches = {}
    for i, (face, normal, area) in enumerate(
        zip(mesh.faces.tolist(), mesh.face_normals, areas.tolist(), strict=True)
    ):
        a, b, c = face
        boundary = {(min(p, q), max(p, q)) for p, q in ((a, b), (b, c), (c, a))}
        depth = float(depths[face].min())
        patches[i] = _Patch(
            i, {a, b, c}, boundary, set(), normal * area, normal[None], np.array([area]), [i], depth
        )
    return patches


def _order_edges(mesh: trimesh.Trimesh) -> list[tuple[int, int]]:
    """Return pairs of faces with a common edge: the flattest first, of equals the longest edge."""
    pairs = np.asarray(mesh.face_adjacency).reshape(-1, 2)
    edges = np.asarray(mesh.vertices)[np.asarray(mesh.face_adjacency_edges).reshape(-1, 2)]
    lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
    bends = np.round(np.asarray(mesh.face_adjacency_angles), 3)
    return [tuple(pair) for pair in pairs[np.lexsort([-lengths, bends])].tolist()]


def _find_root(owner: Int[np.ndarray, " F"], face: int) -> int:
    while owner[face] != face:
        owner[face] = owner[owner[face]]
        face = int(owner[face])
    return face


def _join(
    a: _Patch, b: _Patch, vertices: Float[np.ndarray, "V 3"], tolerance: float, number: int
) -> _Patch | None:
    """Return two patches as one with a number of its own; None where that is not convex within the tolerance."""
    members = a.vertices | b.vertices
    if len(members) > _MAX_VERTICES:
        return None
    normal = a.normal + b.normal
    length = math.sqrt(float(normal @ normal))
    if length < _FLAT**2:
        return None
    axis = normal / length
    normals = np.concatenate([a.normals, b.normals])
    cosines = normals @ axis
    if cosines.min() < math.cos(math.radians(_MAX_TILT_DEG)):
        return None
    depth = min(a.depth, b.depth)
    numbers = sorted(members)
    points = vertices[numbers]
    heights = points @ axis
    bulge = float(heights.max() - heights.min())
    if bulge > max(tolerance, _DEPTH_SHARE * depth):
        return None
    areas = np.concatenate([a.areas, b.areas])
    boundary = a.boundary ^ b.boundary
    place = {vertex: i for i, vertex in enumerate(numbers)}
    outline = np.array(sorted({place[v] for pair in boundary for v in pair}))
    flat = _to_plane(points, axis)
    if not _is_convex(flat, outline, float(areas @ cosines), tolerance):
        return None
    creases = a.creases | b.creases | (a.boundary & b.boundary)
    if bulge > tolerance:
        ends = np.array([(place[p], place[q]) for p, q in sorted(creases)])
        local = np.concatenate([flat, heights[:, None]], axis=1)
        if not _is_cap(local, local[ends].mean(axis=1), tolerance):
            return None
    return _Patch(number, members, boundary, creases, normal, normals, areas, a.faces + b.faces, depth)


def _to_plane(points: Float[np.ndarray, "N 3"], axis: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "N 2"]:
    """Return points as seen along an axis.

    References:
        Duff et al. (2017), Building an orthonormal basis, revisited, equation 1.
    """
    x, y, z = axis.tolist()
    sign = math.copysign(1.0, z)
    p = -1.0 / (sign + z)
    q = x * y * p
    frame = np.array([[1.0 + sign * x * x * p, q], [sign * q, sign + y * y * p], [-sign * x, -y]])
    return (points - points[0]) @ frame


def _is_convex(
    points: Float[np.ndarray, "N 2"], outline: Int[np.ndarray, " B"], area: float, tolerance: float
) -> bool:
    """Return whether an outline with an area is convex within a tolerance."""
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return False
    perimeter = float(hull.area)  # of two dimensions
    if float(hull.volume) - area > 0.5 * tolerance * perimeter:
        return False
    inwards = -(points[outline] @ hull.equations[:, :2].T + hull.equations[:, 2])
    return bool(inwards.min(axis=1).max() <= tolerance)


def _is_cap(points: Float[np.ndarray, "N 3"], middles: Float[np.ndarray, "E 3"], tolerance: float) -> bool:
    """Return whether all points, and middles of edges, lie close beneath the upper side of the convex hull."""
    try:
        planes = ConvexHull(points).equations
    except (QhullError, ValueError):
        return True  # flat
    upper = planes[planes[:, 2] > 1e-6]
    places = np.concatenate([points, middles])
    above = -(places @ upper[:, :3].T + upper[:, 3]) / upper[:, 2]
    return bool(above.min(axis=1).max() <= tolerance)
