"""Quality in terms of the scan: do the scanner's beams end where they ended, and is what it saw to be free still free.

A distance between two surfaces does not tell on which side of a wall the solid is. The beams do: on contact geometry
that grew towards the scanner they end too early, and the free space that they passed lies inside a piece.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.geometry.elevation import Elevation
from symbrion_gym._src.contact.distances import compute_depths
from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.contact.quality import RayMesh

_GOLDEN_RATIO = 0.61803398875
"""Its fractional part: offsets of successive beams this far apart fill the interval evenly."""


_REACH = 0.05
"""A beam that ends no farther from its reading ends there [m]; 5 cm is a step that a Scout feels."""
_MAX_BEAMS = 20_000
"""Readings that are checked at most, drawn at random; 20,000 give a share to 0.4 percentage points."""
_SAMPLES = 16  # Points per beam at which free space is checked; with 16, one every 50 cm of a beam of 8 m
_END_SHARE = 0.95
"""The checked part of a beam ends at this share of its range, because a beam that grazes the ground is within
the noise of it long before its reading."""
_END_MARGIN = 0.10  # ... and at least this far before it [m], because readings and contact have errors.
_LEAST_RANGE = 0.05  # Shorter beams are left out [m]: the scanner hit its own carrier
_CANDIDATES = 8  # Nearest viewpoints that are tried for a reading whose own is unknown, until one sees it


class Beams(NamedTuple):
    """Readings with the places that they were seen from."""

    origins: Float[np.ndarray, "R 3"]  # viewpoint of each reading [m]
    directions: Float[np.ndarray, "R 3"]  # unit vectors to the readings
    ranges: Float[np.ndarray, " R"]  # distances of the readings [m]


class Visibility(NamedTuple):
    """Shares that compare an arena with the beams of its scan; see the fields of `ArenaQuality`."""

    # share of beams that end on contact geometry within reach of their reading; a beam whose viewpoint is
    # inside a piece does not
    beams_contact: float
    beams_surface: float  # the same on the surface
    # share of the points along the beams, before the reading, that are inside contact geometry
    free_space: float


def measure_visibility(
    points: Float[np.ndarray, "N 3"],
    viewpoints: Float[np.ndarray, "*K 3"],
    seen_from: Int[np.ndarray, " M"] | None,
    contact: Sequence[trimesh.Trimesh] | HeightField,
    surface: trimesh.Trimesh,
) -> Visibility | None:
    """Compare an arena with the beams of its scan; equal arguments give equal shares."""
    on_surface = RayMesh([surface])
    beams = find_beams(points, viewpoints, seen_from, on_surface)
    if not len(beams.ranges):
        return None
    is_field = isinstance(contact, HeightField)
    on_contact = RayMesh([contact.as_mesh()] if is_field else contact)
    ends = on_contact.cast(beams.origins, beams.directions)
    starts, group = np.unique(beams.origins, axis=0, return_inverse=True)
    is_solid = _is_solid(np.concatenate([starts, _sample_free_space(beams)]), contact)
    ends[is_solid[: len(starts)][group.ravel()]] = 0.0
    return Visibility(
        beams_contact=_find_share(np.abs(ends - beams.ranges) <= _REACH),
        beams_surface=_find_share(
            np.abs(on_surface.cast(beams.origins, beams.directions) - beams.ranges) <= _REACH
        ),
        free_space=_find_share(is_solid[len(starts) :]),
    )


def find_beams(
    points: Float[np.ndarray, "N 3"],
    viewpoints: Float[np.ndarray, "*K 3"],
    seen_from: Int[np.ndarray, " M"] | None,
    surface: RayMesh,
) -> Beams:
    """Return the beams of at most `_MAX_BEAMS` readings."""
    viewpoints = np.asarray(viewpoints, dtype=np.float64).reshape(-1, 3)
    if not len(viewpoints):
        points = points[:0]
    if len(points) > _MAX_BEAMS:
        chosen = np.sort(np.random.default_rng(0).choice(len(points), _MAX_BEAMS, replace=False))
        points, seen_from = points[chosen], None if seen_from is None else seen_from[chosen]
    points = np.asarray(points, dtype=np.float64)
    if seen_from is None:
        seen_from = _find_viewpoints(points, viewpoints, surface)
    origins = viewpoints[seen_from]
    ranges = np.linalg.norm(points - origins, axis=1)
    is_beam = ranges >= _LEAST_RANGE
    origins, ranges = origins[is_beam], ranges[is_beam]
    return Beams(origins, (points[is_beam] - origins) / ranges[:, None], ranges)


def _find_viewpoints(
    points: Float[np.ndarray, "N 3"], viewpoints: Float[np.ndarray, "K 3"], surface: RayMesh
) -> Int[np.ndarray, " N"]:
    """Return the nearest viewpoint from which the surface hides a point by no more than the reach; else the nearest."""
    if len(viewpoints) <= 1 or not len(points):
        return np.zeros(len(points), dtype=np.int64)
    count = min(_CANDIDATES, len(viewpoints))
    nearest = cKDTree(viewpoints).query(points, k=list(range(1, count + 1)))[1]
    found = nearest[:, 0].astype(np.int64)
    hidden = np.arange(len(points))
    for rank in range(count):
        tried = nearest[hidden, rank]
        ways = points[hidden] - viewpoints[tried]
        ranges = np.maximum(np.linalg.norm(ways, axis=1), _LEAST_RANGE)
        is_seen = surface.cast(viewpoints[tried], ways / ranges[:, None]) >= ranges - _REACH
        found[hidden[is_seen]] = tried[is_seen]
        hidden = hidden[~is_seen]
    return found


def _sample_free_space(beams: Beams) -> Float[np.ndarray, "S 3"]:
    """Return points at even distances along the beams, up to some way before the readings."""
    ends = np.minimum(_END_SHARE * beams.ranges, beams.ranges - _END_MARGIN)
    is_long = ends > 0
    offsets = np.arange(len(ends)) * _GOLDEN_RATIO % 1.0
    shares = (np.arange(_SAMPLES) + offsets[:, None]) / _SAMPLES
    ways = (ends[:, None] * shares)[is_long]
    points = beams.origins[is_long, None] + ways[..., None] * beams.directions[is_long, None]
    return points.reshape(-1, 3)


def _is_solid(
    points: Float[np.ndarray, "N 3"], contact: Sequence[trimesh.Trimesh] | HeightField
) -> np.ndarray:
    """Return whether points are inside a piece, or below a height field."""
    if isinstance(contact, HeightField):
        return points[:, 2] < Elevation(contact.as_mesh()).height(points[:, 0], points[:, 1])
    return compute_depths(points, contact) > 0


def _find_share(is_so: np.ndarray) -> float:
    return float(is_so.mean()) if len(is_so) else 0.0
