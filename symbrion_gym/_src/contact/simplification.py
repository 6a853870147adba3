"""What kind of surface it is, and the triangles that pieces are made of.

Open terrain, an open surface with overhangs, or a closed body; fewer triangles where they still follow the surface, on
planes, none of them long.
"""

from typing import Literal

import numpy as np
import trimesh
from jaxtyping import Bool, Int
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.sampling import sample_grid
from symbrion_gym._src.contact.distances import UNCOVERED_BEYOND, SurfaceDistance
from symbrion_gym._src.contact.kinds import ACCEPTANCE_P95, UNCOVERED
from symbrion_gym._src.contact.planes import Planes

Shape = Literal["terrain", "overhang", "closed"]

_MAX_OVERHANG = 0.03  # Share of the area that may lie beneath other ground in a terrain: folds of a noisy map
_MIN_GROUND = 0.05  # Share of the area that a terrain has in plan, at least; less is nothing but walls
_WALL_RISE = 0.3  # Faces whose normal rises less are walls, not hidden ground
_HIDDEN_DEPTH = 0.01  # Ground this far beneath other ground is hidden, relative to the extent
_BLOCK_POINTS = 120  # Points a side of the grid on which a closed body is compared with a block
_BLOCK_ERROR = 0.05  # Share of its volume by which a block may differ from the space beneath its top
_UNDERSIDE = 1e-3  # Faces this close to the lowest level belong to the underside, relative to the height
_SIDE_RISE = 0.05  # Faces whose normal rises less, and that reach the lowest level, are the sides of a block
_TOP_RISE = -0.2  # Faces whose normal rises less look down: they are no part of the top
_MAX_FANS = 0.02
"""Area of the fans that close holes, relative to the mesh: a tube shorter than 50 radii stays open."""


def find_shape(mesh: trimesh.Trimesh, elevation: Elevation) -> Shape:
    """Tell a terrain (seen whole from above) from an open surface with overhangs and from a closed body.

    A closed body that is a terrain with a flat underside counts as terrain.
    """
    areas, rises = mesh.area_faces, mesh.face_normals[:, 2]
    if float(areas @ np.abs(rises)) < _MIN_GROUND * float(areas.sum()):
        return "overhang"  # nothing but walls: there is no ground to follow
    if not mesh.is_watertight:
        hidden = _measure_hidden(mesh, elevation)
        return "terrain" if hidden <= _MAX_OVERHANG else "overhang"
    return "terrain" if _is_block(mesh, elevation) else "closed"


def take_top(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return the part of a mesh that is ground or wall, without an underside."""
    is_top = mesh.face_normals[:, 2] > _TOP_RISE
    if mesh.is_watertight:
        is_top &= ~_find_underside(mesh)
    top = trimesh.Trimesh(mesh.vertices, mesh.faces[is_top], process=False)
    top.remove_unreferenced_vertices()
    return top


def close_holes(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return the mesh with a fan in every hole, if the holes are small against the mesh."""
    rim = find_rim(mesh)
    if not len(rim):
        return mesh
    count = len(mesh.vertices)
    links = csr_matrix((np.ones(len(rim)), (rim[:, 0], rim[:, 1])), shape=(count, count))
    _, loop = connected_components(links, directed=False)
    loops, number = np.unique(loop[rim[:, 0]], return_inverse=True)
    middles = np.zeros((len(loops), 3))
    np.add.at(middles, number, mesh.vertices[rim[:, 0]])
    middles /= np.bincount(number)[:, None]
    fans = np.column_stack([rim[:, 1], rim[:, 0], count + number])
    vertices, faces = np.concatenate([mesh.vertices, middles]), np.concatenate([mesh.faces, fans])
    closed = trimesh.Trimesh(vertices, faces, process=False)
    return closed if closed.area <= (1.0 + _MAX_FANS) * mesh.area else mesh


def find_rim(mesh: trimesh.Trimesh) -> Int[np.ndarray, "E 2"]:
    """Return the edges with one face, as that face runs along them."""
    edges = np.asarray(mesh.faces)[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    _, first, number = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    return edges[first[number == 1]]


def _measure_hidden(mesh: trimesh.Trimesh, elevation: Elevation) -> float:
    """Return the share of the area that has something else above it; walls do not count."""
    areas, centers = mesh.area_faces, mesh.triangles_center
    above = elevation.height(centers[:, 0], centers[:, 1]) - centers[:, 2]
    is_ground = np.abs(mesh.face_normals[:, 2]) > _WALL_RISE
    is_hidden = is_ground & (above > _HIDDEN_DEPTH * float(mesh.extents.max()))
    return float(areas[is_hidden].sum() / areas.sum())


def _is_block(mesh: trimesh.Trimesh, elevation: Elevation) -> bool:
    """Return whether all between the top, seen from above, and the lowest level is filled."""
    low, high = mesh.bounds
    step = float(np.prod((high - low)[:2] / (_BLOCK_POINTS - 1)))
    points = sample_grid(np.asarray(mesh.bounds), _BLOCK_POINTS, margin=0.0)
    heights = elevation.height(*points.T)
    filled = float(np.nansum(heights - low[2])) * step
    return filled > 0 and bool(abs(mesh.volume / filled - 1.0) < _BLOCK_ERROR)


def _find_underside(mesh: trimesh.Trimesh) -> Bool[np.ndarray, " F"]:
    """Return which faces lie at the lowest level, or are vertical and reach down to it."""
    level = mesh.bounds[0, 2] + _UNDERSIDE * np.ptp(mesh.bounds[:, 2])
    is_low = mesh.triangles[:, :, 2] < level
    is_side = np.abs(mesh.face_normals[:, 2]) < _SIDE_RISE
    return is_low.all(axis=1) | (is_low.any(axis=1) & is_side)


_SHARE = 0.6
"""The error of simplification is this share of what patches aim at; joining triangles takes the rest."""
_FEWEST = 12  # Number of triangles that is tried first
GROWTH = 1.12  # Factor between the numbers that are tried
_WORST = 3.0
"""Of a drawn surface no place is farther off than this many times what patches aim at: it has no noise, and one
edge too few takes a tread away, which no mean shows. A scan has spikes of noise, which cost pieces."""
_DRAWN = 0.5
"""A surface is drawn where at least this share of its area lies in faces that are flat with a neighbor."""
_FLAT = 1e-3  # ... to within this angle [rad]: noise never leaves two triangles as flat.
_MAX_MOVE = 3.0  # A vertex moves by no more than this many tolerances: what lies farther off is no noise
_ANCHOR = 1e-3
"""Weight of the place where a vertex was, against that of a plane: it fixes what planes leave open."""
_MOST_ROUNDS = 60  # Halving edges so often would make any of them vanish: the loop ends long before
_MAX_EDGE = 1.0 / 25.0  # Longest edge, relative to the extent, of a mesh cut finer
_COARSE_EDGE = 1.0 / 20.0  # A face with an edge longer than this, relative to the extent, is coarse
_COARSE_SHARE = 0.2  # Meshes with less of their area in coarse faces stay as they are
_MAX_FACES = 8000  # Halving ends beyond: a broken mesh can be large and all slivers


def is_drawn(surface: trimesh.Trimesh) -> bool:
    """Return whether a surface was drawn, not scanned: most of its faces are flat with a neighbor."""
    pairs = np.asarray(surface.face_adjacency).reshape(-1, 2)
    is_flat = np.zeros(len(surface.faces), dtype=bool)
    is_flat[pairs[np.asarray(surface.face_adjacency_angles) < _FLAT].ravel()] = True
    areas = np.asarray(surface.area_faces)
    return bool(areas[is_flat].sum() >= _DRAWN * areas.sum())


def list_counts(num_faces: int) -> list[int]:
    """Return the numbers of triangles that are tried, the fewest first; the last is all."""
    steps = int(np.ceil(np.log(max(num_faces / _FEWEST, 1.0)) / np.log(GROWTH)))
    return [*(int(_FEWEST * GROWTH**k) for k in range(steps)), num_faces]


def select_simple(
    surface: trimesh.Trimesh, distance: SurfaceDistance, accuracy: float, is_exact: bool
) -> int:
    """Return the index in `list_counts` of the fewest triangles that follow the samples closely enough."""
    worst = _WORST * accuracy if is_exact else float("inf")
    counts = list_counts(len(surface.faces))
    low, high = 0, len(counts) - 1
    while low < high:
        middle = (low + high) // 2
        gaps = distance.measure_mesh(simplify_surface(surface, counts[middle]))
        is_close = (
            gaps.max() <= worst
            and gaps.mean() <= _SHARE * accuracy
            and np.percentile(gaps, 95) <= _SHARE * ACCEPTANCE_P95 * accuracy
            and (gaps > UNCOVERED_BEYOND).mean() <= _SHARE * UNCOVERED
        )
        low, high = (low, middle) if is_close else (middle + 1, high)
    return low


def simplify_surface(surface: trimesh.Trimesh, count: int) -> trimesh.Trimesh:
    """Return a surface of about `count` triangles; its boundary stays where it is.

    References:
        Garland, Heckbert (1997), Surface simplification using quadric error metrics; by libigl, which keeps
        boundaries (fast-simplification moves them by meters).
    """
    import igl

    if count >= len(surface.faces):
        return surface
    found = igl.qslim(
        np.asarray(surface.vertices, dtype=np.float64, order="F"),
        np.asarray(surface.faces, dtype=np.int32, order="F"),
        count,
    )
    vertices, faces = (np.ascontiguousarray(array) for array in found[:2])
    simple = trimesh.Trimesh(vertices, faces, process=False)
    is_sound = len(faces) > 0 and bool(np.isfinite(vertices).all())
    return simple if is_sound else surface


def snap_to_planes(mesh: trimesh.Trimesh, planes: Planes, tolerance: float) -> trimesh.Trimesh:
    """Return a mesh whose vertices lie on the planes of their faces: on one plane, its line with another, or
    a corner."""
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    has_plane = np.repeat(planes.labels, 3) >= 0
    pairs = np.stack([np.asarray(mesh.faces).ravel(), np.repeat(planes.labels, 3)], axis=1)[has_plane]
    vertex, label = np.unique(pairs, axis=0).T  # every vertex with each plane of its faces, once
    if not len(vertex):
        return mesh
    normals, offsets = planes.normals[label], planes.offsets[label]
    distance = np.abs(np.einsum("pi,pi->p", normals, vertices[vertex]) - offsets)
    is_near = distance <= _MAX_MOVE * tolerance
    vertex, normals, offsets = vertex[is_near], normals[is_near], offsets[is_near]
    # Least squares over the planes of a vertex and its old place: (sum n nT + a I) x = sum n d + a p.
    left = np.broadcast_to(_ANCHOR * np.eye(3), (len(vertices), 3, 3)).copy()
    right = _ANCHOR * vertices
    np.add.at(left, vertex, normals[:, :, None] * normals[:, None, :])
    np.add.at(right, vertex, normals * offsets[:, None])
    moved = np.linalg.solve(left, right[..., None])[..., 0]
    step = np.linalg.norm(moved - vertices, axis=1)
    is_far = step > _MAX_MOVE * tolerance
    moved[is_far] = vertices[is_far]
    return trimesh.Trimesh(moved, mesh.faces, process=False)


def split_long_edges(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return the same surface without long edges, if coarse faces make up much of it; else the mesh itself.

    The longest edges of faces are halved until there are none, or too many faces. Their neighbors are cut to suit.
    """
    extent = float(mesh.extents.max())
    lengths = np.linalg.norm(mesh.triangles - np.roll(mesh.triangles, -1, axis=1), axis=2)
    is_coarse = lengths.max(axis=1) > _COARSE_EDGE * extent
    if mesh.area_faces[is_coarse].sum() < _COARSE_SHARE * mesh.area:
        return mesh
    vertices, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces)
    for _ in range(_MOST_ROUNDS):
        edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        edges, number = np.unique(edges, axis=0, return_inverse=True)
        length = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
        number = number.reshape(-1, 3)
        is_longest = np.zeros(len(edges), dtype=bool)
        is_longest[number[np.arange(len(faces)), np.argmax(length[number], axis=1)]] = True
        is_long = is_longest & (length > _MAX_EDGE * extent)
        if not is_long.any() or len(faces) > _MAX_FACES:
            break
        middle = np.full(len(edges), -1)
        middle[is_long] = len(vertices) + np.arange(is_long.sum())
        vertices = np.concatenate([vertices, vertices[edges[is_long]].mean(axis=1)])
        faces = _cut_faces(faces, middle[number])
    return trimesh.Trimesh(vertices, faces, process=False)


def _cut_faces(faces: Int[np.ndarray, "F 3"], middles: Int[np.ndarray, "F 3"]) -> Int[np.ndarray, "G 3"]:
    """Cut faces at the middles of their edges."""
    count = (middles >= 0).sum(axis=1)
    # The whole edge of two, or the cut edge of one, goes to a known place.
    first = np.where(count == 1, np.argmax(middles >= 0, axis=1), np.argmin(middles >= 0, axis=1))
    turned = (first[:, None] + np.arange(3)) % 3
    faces, middles = np.take_along_axis(faces, turned, 1), np.take_along_axis(middles, turned, 1)
    a, b, c = faces.T
    ab, bc, ca = middles.T
    templates = {
        0: [(a, b, c)],
        1: [(a, ab, c), (ab, b, c)],
        2: [(bc, c, ca), (a, b, bc), (a, bc, ca)],
        3: [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)],
    }
    parts = [
        np.stack(corners, axis=1)[count == number] for number, cut in templates.items() for corners in cut
    ]
    return np.concatenate(parts)
