"""Patches: convex parts of the surface itself, thickened away from free space. They follow any shape."""

from __future__ import annotations

import math

import numpy as np
import trimesh
from jaxtyping import Float
from scipy.ndimage import distance_transform_edt

from reconstruction._src.geometry.rows import make_hull
from symbrion_gym._src.contact.acceptance import ACCEPTANCE_P95, compute_miss
from symbrion_gym._src.contact.decomposition import is_solid
from symbrion_gym._src.contact.kinds import (
    COARSEST,
    FINEST,
    KNOWN,
    LEAST_DENSITY,
    SHARE,
    SHRINK,
    Contact,
    HeightField,
    make_height_field,
)
from symbrion_gym._src.contact.options import JOINING, THICKNESS
from symbrion_gym._src.contact.passes.coacd import NoCandidate
from symbrion_gym._src.contact.patches import join_faces
from symbrion_gym._src.contact.problem import ContactProblem
from symbrion_gym._src.contact.simplification import (
    GROWTH,
    is_drawn,
    list_counts,
    select_simple,
    simplify_surface,
    snap_to_planes,
)
from symbrion_gym._src.contact.solid import compute_thickness, find_inner_points

_THICK = 1e-8  # A solid with an area times depth of more has a volume in single precision, too [m³]


def fit_flat_patches(problem: ContactProblem, best: Contact | None) -> Contact | None:
    """Return patches of the surface whose flat parts are moved onto planes; None where what is wanted is reached."""
    if best is not None and _is_reached(problem, best):
        return None
    flat = snap_to_planes(problem.surface, problem.planes, problem.aim)
    notes = {"way": "patches of planes and triangles", "planes": len(problem.planes.normals)}
    return _fit(problem, flat, notes)


def fit_patches(problem: ContactProblem, best: Contact | None) -> Contact | None:
    """Return patches of the surface as it is; None where what is wanted is reached."""
    if best is not None and _is_reached(problem, best):
        return None
    return _fit(problem, problem.surface, {"way": "patches of triangles"})


def make_prisms(problem: ContactProblem, best: Contact | None) -> Contact | None:
    """Return one solid a triangle: exact, with all the noise, for comparison."""
    pieces = thicken_patches(problem, problem.surface, 0.0)
    return problem.measure(pieces, {"way": "prisms"}) if pieces else None


def _fit(problem: ContactProblem, surface: trimesh.Trimesh, notes: dict) -> Contact | None:
    """Return patches of the coarsest triangles that reach what is wanted with no more pieces than allowed.

    Coarser triangles are taken while there are too many pieces, finer ones while the distance is too large.
    """
    options = problem.options
    counts = list_counts(len(surface.faces))
    start = select_simple(
        surface,
        problem.distance,
        problem.aim,
        is_drawn(problem.surface),
    )
    best: Contact | None = None
    index, step = start, 0
    while index < len(counts) and not (best is not None and problem.deadline.is_over()):
        simple = simplify_surface(surface, counts[index])
        pieces = thicken_patches(problem, simple, JOINING * problem.aim)
        is_few = len(pieces) <= options.max_pieces
        if not is_few and index == 0:  # many parts: the largest are kept
            pieces = sorted(pieces, key=lambda piece: -piece.area)[: options.max_pieces]
        if is_few or index == 0:
            made = problem.measure(pieces, {**notes, "triangles": len(simple.faces)})
            if best is None or _find_miss(problem, made) < _find_miss(problem, best):
                best = made
            if _is_reached(problem, made):
                break
        wanted = 1 if is_few else -1
        if step and wanted != step:
            break
        step = wanted
        if index == 0 and not is_few:
            break
        change = 1 if is_few else -_count_steps(len(pieces) / options.max_pieces)
        index = max(index + change, 0)
    return best if best is not None and best.pieces else None


def _count_steps(ratio: float) -> int:
    """Return how many steps of `list_counts` divide the number of triangles by a ratio above 1."""
    return max(math.ceil(math.log(ratio) / math.log(GROWTH)), 1)


def thicken_patches(
    problem: ContactProblem, mesh: trimesh.Trimesh, tolerance: float
) -> list[trimesh.Trimesh]:
    """Return a convex solid behind each convex patch of a mesh."""
    thickness = THICKNESS.scale_to(float(problem.surface.extents.max()))

    def find_limits(places: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, " N"]:
        return np.where(problem.is_seen_from_behind(places), thickness.two_sided, np.inf)

    depths = compute_thickness(mesh, find_limits, thickness)
    vertices, corners = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    single = list(np.arange(len(mesh.faces))[:, None])
    patches = join_faces(mesh, depths, tolerance) if tolerance > 0 else single
    solids = []
    for faces in patches:
        inner = find_inner_points(mesh, faces, depths, thickness)
        outer = vertices[np.unique(corners[faces])]
        hull = make_hull(np.concatenate([outer, inner]))
        if hull is None:
            continue
        is_thick = float(mesh.area_faces[faces].sum() * depths[corners[faces]].min()) > _THICK
        if is_thick or is_solid(hull):
            solids.append(hull)
    return solids


def _is_reached(problem: ContactProblem, contact: Contact) -> bool:
    return _find_miss(problem, contact) <= 1.0


def _find_miss(problem: ContactProblem, contact: Contact) -> float:
    return compute_miss(contact, problem.accuracy, problem.options.max_pieces)


def fit_height_field(problem: ContactProblem, best: Contact | None) -> Contact | None:
    """Return a height field of open ground that has many patches; None where it has few, or is no terrain."""
    if best is None or problem.shape != "terrain" or problem.surface.is_watertight:
        return None
    extents = problem.surface.extents
    is_sparse = len(best.pieces) < LEAST_DENSITY * float(extents[0] * extents[1])
    if is_sparse or best.notes["way"].endswith("slabs"):
        return None
    field = _find_coarsest_field(problem)
    if field is None:
        raise NoCandidate("no grid follows the ground closely enough, or too much of it is not known")
    return field


def measure_heights(problem: ContactProblem, heights: HeightField, notes: dict) -> Contact:
    """Return a height field with its distances from the surface."""
    gaps = problem.distance.compute_gaps_of_sheet(heights.as_mesh())
    quality = problem.distance.summarize(gaps, 0, problem.deadline.elapsed)
    return Contact([], quality, heights, notes)


def _find_coarsest_field(problem: ContactProblem) -> Contact | None:
    """Return the coarsest height field that follows the ground closely enough; None where none does."""
    spacing = COARSEST
    while spacing >= FINEST and not problem.deadline.is_over():
        heights = _sample_heights(problem, spacing)
        if heights is None:
            return None
        made = measure_heights(problem, heights, {"way": "height field", "spacing": spacing})
        mean, p95 = made.quality.mean / problem.accuracy, made.quality.p95 / problem.accuracy
        if mean <= SHARE and p95 <= SHARE * ACCEPTANCE_P95:
            return made
        spacing *= SHRINK
    return None


def _sample_heights(problem: ContactProblem, spacing: float) -> HeightField | None:
    """Return the heights on a grid, those off the ground as at the nearest place on it; None where many are off it.

    The outer rows do not count: the rim of a scan is ragged.
    """
    heights = make_height_field(problem.surface, problem.ground, spacing)
    rows, columns = heights.heights.shape
    x, y = np.meshgrid(
        *(np.linspace(heights.low[i], heights.high[i], n) for i, n in ((0, columns), (1, rows)))
    )
    is_known = np.isfinite(problem.ground.height(x, y))
    if min(rows, columns) < 3 or is_known[1:-1, 1:-1].mean() < KNOWN:
        return None
    nearest = np.asarray(distance_transform_edt(~is_known, return_distances=False, return_indices=True))
    return heights._replace(heights=heights.heights[tuple(nearest)])
