"""Which side of a surface is outside: faces wound so that their normals point there."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, Num
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow
from scipy.spatial import cKDTree

from reconstruction._src.geometry.manifold import find_ends, find_hinges, group_sides, label_parts
from reconstruction._src.geometry.rows import (
    Faces,
    Points,
    Vertices,
    compute_area_vectors,
    compute_areas,
    compute_lengths,
    sum_by_owner,
    sum_rows,
)
from reconstruction._src.geometry.sampling import count_votes, find_low, sample_area

_CUT_COST = 1.0
"""Cost of an edge of the rim, in its squared lengths, against the areas of the faces turned: a part is cut off from
about 30 faces on. Lower, and single faces with noisy votes come loose; higher, and objects stay inside out."""
OPEN_SHARE = 0.2
"""A component whose normals sum to less than this share of its area counts as closed: those of a closed one cancel,
those of a half sphere sum to half of it."""
_INSIDE = 0.5
"""A closed component winds once around what is in it; one with a door or without a ceiling more than this."""
_LEVEL = 0.9
"""A face is level where the upward part of its normal, of length 1, is beyond this, or below its opposite."""
_SQUARE = np.deg2rad(6.0)  # What is square to an axis is so to this angle [rad]
_LEAD, _LEAST_FLOOR, _LEAST_LEVEL = 4.0, 0.1, 0.25
"""Where z is in doubt, another axis points up if so many times more is square to it than to any other, and so much of
all, as floors are at any angle of a room about the vertical; or if so much is level along it, as rough ground is."""
_BEATEN, _LEAST_SQUARE = 1.5, 0.06
"""z is in doubt where another axis has so many times more of what floors and walls tell, z nowhere so much more, and
floors square to it less than this share of the surface."""
_UPRIGHT = 0.5  # A face stands upright where the upward part of its normal, of length 1, is below this
_ON_FLOOR = 0.2  # What is so far from a floor is none of it [m]
_LEAST_WALLS, _STANDING = 0.1, 3.0
"""Walls of at least this share of the surface, so many times more of them below its floor than on it, hang."""
_LOWEST = 0.15  # The bottom of a surface is this share of its height
_NUM_SAMPLES = 1000  # Places that stand for an area
_LARGEST = 2.0**30  # Flows are 32-bit integers; the sum of the capacities at a face stays below


class TurnedMesh(NamedTuple):
    """A mesh of which parts were turned."""

    vertices: Float[np.ndarray, "W 3"]  # those of the mesh, and behind them copies along the cuts [m]
    faces: Faces  # in their old order


def turn_reversed_parts(vertices: Vertices, faces: Faces, shares: Float[np.ndarray, " F"]) -> TurnedMesh:
    """Return a mesh whose parts with votes for their backs are turned and cut off; the rest is as it was."""
    if not (shares < 0).any():
        return TurnedMesh(vertices, faces)
    is_reversed = _find_reversed(vertices, faces, shares)
    if not is_reversed.any():
        return TurnedMesh(vertices, faces)
    return split_fans(vertices, np.where(is_reversed[:, None], faces[:, ::-1], faces))


def _find_reversed(
    vertices: Vertices, faces: Faces, shares: Float[np.ndarray, " F"]
) -> Bool[np.ndarray, " F"]:
    """Return the faces on the side of those that look away, of the cheapest cut between these and the others."""
    hinges = find_hinges(faces, group_sides(faces, len(vertices)))
    left, right = hinges.faces.T
    tails, heads = find_ends(faces, 3 * left + hinges.sides[:, 0])
    cost = _CUT_COST * compute_lengths(vertices[heads] - vertices[tails]) ** 2
    gain = shares * compute_areas(vertices, faces)
    source, sink = len(faces), len(faces) + 1
    front, back = np.flatnonzero(gain > 0), np.flatnonzero(gain < 0)
    rows = np.concatenate([left, right, np.full(len(front), source), back])
    columns = np.concatenate([right, left, front, np.full(len(back), sink)])
    capacity = np.concatenate([cost, cost, gain[front], -gain[back]])
    scale = _LARGEST / max(gain[front].sum(), -gain[back].sum(), 4 * cost.max(initial=0.0))
    whole = np.round(scale * capacity).astype(np.int32)
    graph = csr_array(coo_array((whole, (rows, columns)), shape=(len(faces) + 2,) * 2))
    flow = maximum_flow(graph, source, sink).flow
    residual = csr_array(graph - flow)
    residual.data = np.maximum(residual.data, 0)
    residual.eliminate_zeros()
    reaches_sink = breadth_first_order(csr_array(residual.T), sink, return_predecessors=False)
    is_reversed = np.zeros(len(faces) + 2, dtype=bool)
    is_reversed[reaches_sink] = True
    return is_reversed[: len(faces)]


def split_fans(vertices: Vertices, faces: Faces) -> TurnedMesh:
    """Give every fan of faces vertices of its own; where the winding changes across an edge, a fan ends."""
    hinges = find_hinges(faces, group_sides(faces, len(vertices)))
    linked, sides = hinges.faces[hinges.is_consistent], hinges.sides[hinges.is_consistent]
    starts, ends = 3 * linked + sides, 3 * linked + (sides + 1) % 3
    pairs = np.concatenate([np.c_[starts[:, 0], ends[:, 1]], np.c_[ends[:, 0], starts[:, 1]]])
    fan = label_parts(pairs, faces.size)
    _, member = np.unique(fan, return_index=True)
    owner = faces.ravel()[member]
    _, first = np.unique(owner, return_index=True)
    is_first = np.zeros(len(owner), dtype=bool)
    is_first[first] = True
    name = np.where(is_first, owner, len(vertices) + np.cumsum(~is_first) - 1)
    return TurnedMesh(np.concatenate([vertices, vertices[owner[~is_first]]]), name[fan].reshape(faces.shape))


def orient_outwards(
    vertices: Vertices, faces: Faces, viewpoint: Num[np.ndarray, "*K 3"] | None = None
) -> Faces:
    """Return the faces, each component turned to the outside; within a component they must be wound alike.

    Closed components (and nearly closed ones) look outwards, but inwards where the scanner stood in them, or where most
    of the rest is in them, as in a room. Sheets look towards the scanner where its position is known, else upwards
    (along z).
    """
    if len(faces) == 0:
        return faces
    cross, middle = compute_area_vectors(vertices, faces), vertices[faces].mean(axis=1)
    part = compute_components(faces, len(vertices))
    count = part.max() + 1
    area = np.bincount(part, compute_lengths(cross), count)
    total = sum_by_owner(part, cross, count)
    center = sum_by_owner(part, middle, count) / np.bincount(part)[:, None]
    outwards = np.bincount(part, sum_rows((middle - center[part]) * cross), count)
    is_sheet = compute_lengths(total) > OPEN_SHARE * area
    if viewpoint is None:
        forth = np.where(is_sheet, total[:, 2], outwards)
        largest = int(area.argmax())
        if not is_sheet[largest] and _holds_the_rest(vertices, faces, part == largest):
            forth[largest] *= -1
    else:
        seen_from = np.atleast_2d(np.asarray(viewpoint, dtype=np.float64))
        nearest = seen_from[cKDTree(seen_from).query(middle)[1]]
        forth = np.bincount(part, sum_rows((nearest - middle) * cross), count)
        for closed in np.flatnonzero(~is_sheet):
            turns = _count_turns(vertices, faces[part == closed], seen_from)
            forth[closed] = -turns if abs(turns) > _INSIDE else outwards[closed]
    return np.where((forth[part] < 0)[:, None], faces[:, ::-1], faces)


def _holds_the_rest(vertices: Vertices, faces: Faces, is_shell: Bool[np.ndarray, " F"]) -> bool:
    """Return whether a component winds around more than half of the area of the others."""
    rest = faces[~is_shell]
    if not len(rest):
        return False
    turns = _wind(vertices, faces[is_shell], sample_area(vertices, rest, _NUM_SAMPLES))
    return bool((np.abs(turns) > _INSIDE).mean() > 0.5)


def looks_down_below(vertices: Vertices, faces: Faces) -> bool:
    """Return whether level faces look down at the bottom, and up above it, as those of a closed room from outside.

    At the bottom less than half of the level area looks up, and above it more than half; without level faces in both,
    it is not so.
    """
    cross, height = compute_area_vectors(vertices, faces), vertices[faces][:, :, 2].mean(axis=1)
    area = compute_lengths(cross)
    is_level = np.abs(cross[:, 2]) > _LEVEL * area
    if not is_level.any():
        return False
    low, high = height[is_level].min(), height[is_level].max()
    is_low = height < low + _LOWEST * (high - low)
    below, above = (float(cross[is_level & chosen, 2].sum()) for chosen in (is_low, ~is_low))
    return below < 0.0 < above


def _measure_axes(areas: Float[np.ndarray, "F 3"]) -> Float[np.ndarray, "3 3"]:
    """Return shares of the surface for x, y and z: what lies across it to 25 degrees; to 6; across or along it to 6."""
    size = compute_lengths(areas)
    cosines = np.abs(areas) / np.maximum(size, np.finfo(float).tiny)[:, None]
    level, floors = size @ (cosines > _LEVEL), size @ (cosines > np.cos(_SQUARE))
    square = floors + size @ (cosines < np.sin(_SQUARE))
    return np.stack([level, floors, square]) / max(float(size.sum()), np.finfo(float).tiny)


def find_up_axis(areas: Float[np.ndarray, "F 3"], middles: Float[np.ndarray, "F 3"]) -> str | None:
    """Return the axis that points up where z does not beyond doubt; None where it does, or where no other is sure.

    Of its two directions the positive one, as most formats have it, but the other where far more of the level area lies
    in the upper half, as the floor does then; not of a room, whose floor and ceiling look at each other.

    Args:
        areas: normals of parts of the surface, each as long as its area; of points of either sign.
        middles: where the parts lie.
    """
    shares, size = _measure_axes(areas), compute_lengths(areas)
    if not _is_beaten(shares):
        return None
    for share, least in ((shares[1], _LEAST_FLOOR), (shares[0], _LEAST_LEVEL)):
        axis = int(share.argmax())
        if share[axis] >= max(least, _LEAD * float(np.delete(share, axis).max())):
            break
    else:
        return None
    height, rise = middles[:, axis], areas[:, axis]
    level = np.where(np.abs(rise) > _LEVEL * size, np.abs(rise), 0.0)
    is_low = height < (height.min() + height.max()) / 2
    is_below = level[~is_low].sum() <= _LEAD * level[is_low].sum()
    sign = "" if is_below or is_room(rise, size, height) else "-"
    return f"{sign}{'xyz'[axis]}"


def is_room(
    rise: Float[np.ndarray, " F"], size: Float[np.ndarray, " F"], height: Float[np.ndarray, " F"]
) -> bool:
    """Return whether level faces look up in the lower half of a surface, and down in the upper one.

    Args:
        rise: part of the area vectors along the axis that points up.
        size: areas of the faces.
        height: of their middles.
    """
    level = np.where(np.abs(rise) > _LEVEL * size, rise, 0.0)
    is_low = height < (height.min() + height.max()) / 2
    low, high = level[is_low], level[~is_low]
    return bool(low.sum() > np.abs(low).sum() / 2 and high.sum() < -np.abs(high).sum() / 2)


def is_y_likely(areas: Float[np.ndarray, "F 3"], vertices: Vertices) -> bool:
    """Return whether y may point up: over half as much is level along it as along z, and along y it is lower, as sites
    are."""
    level, extents = _measure_axes(areas)[0], np.ptp(vertices, axis=0)
    return bool(level[1] > level[2] / 2 and extents[1] < extents[2])


def _is_beaten(shares: Float[np.ndarray, "3 3"]) -> bool:
    """Return whether another axis tells more of floors and walls than z, and z hardly more in anything."""
    others = shares[:, :2].max(axis=1)
    is_other = (others > _BEATEN * shares[:, 2]).any() and (shares[:, 2] <= _BEATEN * others).all()
    return bool(is_other and shares[1, 2] < _LEAST_SQUARE)


class DoubtfulAxis(NamedTuple):
    """An axis that may point up in place of z."""

    name: str  # "x" or "y"
    doubt: str  # why, in words


def find_doubtful_axis(areas: Float[np.ndarray, "F 3"]) -> DoubtfulAxis | None:
    """Return the axis that may point up in place of z, of area vectors; None where it is z."""
    shares = _measure_axes(areas)
    if not _is_beaten(shares):
        return None
    axis = int(shares[0, :2].argmax())
    along, upright, name = 100 * shares[0, axis], 100 * shares[0, 2], "xy"[axis]
    text = f"z may not point up: {along:.0f} % of the surface is level along {name}, {upright:.0f} % along z"
    return DoubtfulAxis(name, text)


def hangs_from_floor(vertices: Vertices, faces: Faces) -> bool:
    """Return whether walls hang below a floor and hardly any stand on it: it is seen from the wrong side.

    A roof far above ground is no floor.
    """
    areas, middles = compute_area_vectors(vertices, faces), vertices[faces].mean(axis=1)
    size = compute_lengths(areas)
    upward = faces[areas[:, 2] > _LEVEL * size]
    if not len(upward):
        return False
    level = sample_area(vertices, upward, _NUM_SAMPLES)
    rise = middles[:, 2] - np.median(level[find_low(level), 2])
    walls = np.where(np.abs(areas[:, 2]) < _UPRIGHT * size, size, 0.0)
    hung, stood = float(walls[rise < -_ON_FLOOR].sum()), float(walls[rise > _ON_FLOOR].sum())
    return hung >= max(_LEAST_WALLS * size.sum(), _STANDING * stood)


def _count_turns(vertices: Vertices, faces: Faces, viewpoints: Float[np.ndarray, "K 3"]) -> float:
    """Return how often a component winds around the viewpoint that is deepest in it.

    1 in one that looks outwards, -1 in one that looks inwards, 0 where all viewpoints are outside.
    """
    corners = vertices[np.unique(faces)]
    is_near = ((viewpoints >= corners.min(axis=0)) & (viewpoints <= corners.max(axis=0))).all(axis=1)
    if not is_near.any():
        return 0.0
    turns = _wind(vertices, faces, viewpoints[is_near])
    return float(turns[np.abs(turns).argmax()])


def _wind(vertices: Vertices, faces: Faces, places: Float[np.ndarray, "K 3"]) -> Float[np.ndarray, " K"]:
    """Return how often faces wind around places."""
    import igl

    vertices, faces = np.ascontiguousarray(vertices, np.float64), np.asarray(faces, np.int64)
    return np.atleast_1d(igl.winding_number(vertices, faces, np.ascontiguousarray(places)))


def orient_to_viewpoints(
    vertices: Vertices,
    faces: Faces,
    points: Points,
    viewpoints: Float[np.ndarray, "K 3"],
    seen_from: Int[np.ndarray, " N"] | None = None,
) -> tuple[TurnedMesh, float]:
    """Return the mesh, each component turned to the side that it was seen from, and how far that holds.

    The points vote (`count_votes`), each face counts with its area: far walls have few readings. Large parts of a
    component that look away from where they were seen are cut off and turned (`turn_reversed_parts`). Components
    without a vote are turned as by `orient_outwards`.
    """
    if len(faces) == 0:
        return TurnedMesh(vertices, faces), 1.0
    turned = orient_outwards(vertices, faces, viewpoints)
    votes, weights = count_votes(vertices, turned, points, viewpoints, seen_from)
    shares = votes / np.where(weights > 0, weights, 1.0)
    area = np.where(weights > 0, compute_areas(vertices, turned), 0.0)
    part = compute_components(turned, len(vertices))
    is_turned = (np.bincount(part, area * shares) < 0)[part]
    turned = np.where(is_turned[:, None], turned[:, ::-1], turned)
    shares = np.where(is_turned, -shares, shares)
    mesh = turn_reversed_parts(vertices, turned, shares)
    was_reversed = (mesh.vertices[mesh.faces[:, 0]] != vertices[turned[:, 0]]).any(axis=1)
    agrees = np.where(was_reversed, shares < 0, shares > 0)
    return mesh, float(area[agrees].sum() / area.sum()) if area.any() else 1.0


def compute_components(faces: Faces, num_vertices: int) -> Int[np.ndarray, " F"]:
    """Return the component of every face, numbered from 0 in the order of their first faces.

    libigl's `facet_components` returns the same in five times the time.
    """
    pairs = np.concatenate([faces[:, :2], faces[:, 1:]])
    label = label_parts(pairs, num_vertices)[faces[:, 0]]
    _, first, part = np.unique(label, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return rank[part]
