"""What contact geometry is wanted, and everything that tunes how it is made."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float
from scipy.spatial import cKDTree

from reconstruction._src.geometry.mesh_repair import RepairConfig
from reconstruction._src.geometry.sampling import sample_area
from symbrion_gym._src.contact.distances import find_nearest
from symbrion_gym._src.contact.kinds import CONTACT_CHOICES
from symbrion_gym._src.contact.solid import ThicknessConfig
from symbrion_gym._src.errors import ArenaError

_FINEST = 0.003  # Contact need not be closer [m]: a Scout's tracks do not feel 3 mm
_EXTENT = 1.0 / 500.0  # ... or this share of the extent of the surface, for small things.
_NOISE = 1.0  # In standard deviations of the readings from the surface
_SPACING = 0.1  # In median distances of neighboring readings over the surface
_MESH = 0.05  # Without readings, in median lengths of the edges of the surface
_COARSEST = 2.0  # ... but no more than this many times the finest: a drawn mesh with long edges is exact.
_NUM_POINTS = 5000  # Readings that are looked at


_DEVIATION = 1.4826  # Standard deviation of a normal distribution over the median of its absolute values


def find_accuracy(
    surface: trimesh.Trimesh,
    points: Float[np.ndarray, "N 3"] | None = None,
) -> float:
    """Return the accuracy that contact geometry of a scanned surface should have [m].

    The median distance of readings from the surface gives their noise; spacing is that of the surface's area, so
    that dense readings near the scanner do not stand for those far from it.
    """
    finest = min(_FINEST, _EXTENT * float(surface.extents.max()))
    if points is None or len(points) < 2:
        edges = _MESH * float(np.median(surface.edges_unique_length))
        return min(max(finest, edges), _COARSEST * finest)
    rng = np.random.default_rng(0)
    chosen = np.sort(rng.permutation(len(points))[:_NUM_POINTS])
    vertices, faces = np.asarray(surface.vertices), np.asarray(surface.faces)
    residual, _, _ = find_nearest(points[chosen], vertices, faces)
    noise = _DEVIATION * float(np.median(residual))
    samples = sample_area(vertices, faces, _NUM_POINTS)
    tree = cKDTree(points)
    _, nearest = tree.query(samples)
    distance, _ = tree.query(points[nearest], k=2)
    spacing = float(np.median(distance[:, 1]))
    return max(finest, _NOISE * noise, _SPACING * spacing)


THRESHOLDS = (0.05, 0.02)  # Concavities left, relative to half the longest extent, tried from coarse to fine
ITERATIONS = 60  # Number of iterations of its tree search
DEPTH = 2  # Depth of that tree
NODES = 10  # Children of a node
RESOLUTION = 1000  # Points on which a cut is rated
MAX_FACES = 1000  # Larger solids are simplified first: its time grows faster than the number of faces


REPAIR = RepairConfig(drops_slivers=True)  # What of a mesh is kept
JOINING = 0.8  # Triangles are joined within this share of what patches aim at
CONTACT_AIM = 0.4
"""Patches aim at this share of the accuracy while they are few enough: beams that graze a wall feel a few
millimeters."""
THICKNESS = ThicknessConfig()  # How thick the solid behind a patch is


@dataclass(frozen=True)
class ContactOptions:
    """What contact geometry is wanted.

    Raises:
        ArenaError: an option is out of range.
    """

    # mean distance between contact and surface that is good enough [m]; None: as fine as the scan
    accuracy: float | None = None
    max_pieces: int = 2200  # no more convex pieces than these
    kind: str = "auto"  # one of `CONTACT_CHOICES`
    thickness: float = 0.2  # how far slabs reach below the lowest ground [m]
    seed: int = 0  # seed of coacd's search
    time_limit: float = 300.0  # emergency stop: building ends then with the best so far [s]

    def __post_init__(self) -> None:
        if self.kind not in CONTACT_CHOICES:
            raise ArenaError(
                f"unknown kind of contact {self.kind!r}; there are: {', '.join(CONTACT_CHOICES)}"
            )
        for name in ("accuracy", "thickness", "time_limit"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < float("inf"):
                raise ArenaError(f"{name} must be above 0, got {value}")
        if self.max_pieces < 1:
            raise ArenaError(f"max_pieces must be 1 or more, got {self.max_pieces}")

    def as_dict(self) -> dict[str, Any]:
        """Return the fields, for JSON."""
        return asdict(self)
