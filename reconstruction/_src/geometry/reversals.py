"""Parts of a surface that look away from where they were seen: cut off along their rim, and turned.

A network may join an object to the wall behind it the wrong way round. The parts are found as a minimum cut: each
face gains by looking to where it was seen from, each edge of the rim costs.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, maximum_flow

from reconstruction._src.geometry.manifold import find_ends, find_hinges, group_sides
from reconstruction._src.geometry.rows import find_areas, find_lengths

CUT_COST = 1.0
"""Cost of an edge of the rim, in its squared lengths, against the areas of the faces turned: a part is cut off from
about 30 faces on. Lower, and single faces with noisy votes come loose; higher, and objects stay inside out."""
_LARGEST = 2.0**30
"""Flows are 32-bit integers; the sum of the capacities at a face stays below."""


class TurnedMesh(NamedTuple):
    """A mesh of which parts were turned.

    Attributes:
        vertices: `[W, 3]` those of the mesh, and behind them copies along the cuts [m].
        faces: `[F, 3]` in their old order.
    """

    vertices: Float[np.ndarray, "W 3"]
    faces: Int[np.ndarray, "F 3"]


def turn_reversed_parts(
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    shares: Float[np.ndarray, " F"],
    cut_cost: float = CUT_COST,
) -> TurnedMesh:
    """Return a mesh whose parts with votes for their backs are turned and cut off; the rest is as it was."""
    if not (shares < 0).any():
        return TurnedMesh(vertices, faces)
    is_reversed = _find_reversed(vertices, faces, shares, cut_cost)
    if not is_reversed.any():
        return TurnedMesh(vertices, faces)
    return split_fans(vertices, np.where(is_reversed[:, None], faces[:, ::-1], faces))


def _find_reversed(
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    shares: Float[np.ndarray, " F"],
    cut_cost: float,
) -> Bool[np.ndarray, " F"]:
    """Return the faces on the side of those that look away, of the cheapest cut between these and the others."""
    hinges = find_hinges(faces, group_sides(faces, len(vertices)))
    left, right = hinges.faces.T
    tails, heads = find_ends(faces, 3 * left + hinges.sides[:, 0])
    cost = cut_cost * find_lengths(vertices[heads] - vertices[tails]) ** 2
    gain = shares * find_areas(vertices, faces)
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


def split_fans(vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]) -> TurnedMesh:
    """Give every fan of faces vertices of its own; where the winding changes across an edge, a fan ends."""
    hinges = find_hinges(faces, group_sides(faces, len(vertices)))
    linked, sides = hinges.faces[hinges.is_consistent], hinges.sides[hinges.is_consistent]
    starts, ends = 3 * linked + sides, 3 * linked + (sides + 1) % 3
    rows, columns = np.append(starts[:, 0], ends[:, 0]), np.append(ends[:, 1], starts[:, 1])
    corners = coo_array((np.ones(len(rows)), (rows, columns)), shape=(faces.size,) * 2)
    fan = connected_components(corners, directed=False)[1]
    _, member = np.unique(fan, return_index=True)
    owner = faces.ravel()[member]
    _, first = np.unique(owner, return_index=True)
    is_first = np.zeros(len(owner), dtype=bool)
    is_first[first] = True
    name = np.where(is_first, owner, len(vertices) + np.cumsum(~is_first) - 1)
    return TurnedMesh(np.concatenate([vertices, vertices[owner[~is_first]]]), name[fan].reshape(faces.shape))
