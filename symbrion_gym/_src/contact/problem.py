"""What contact geometry is to be made of, how good it has to be, and what every pass needs to know of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Bool, Float

from reconstruction._src.base.progress import Progress
from reconstruction._src.geometry.elevation import Elevation
from symbrion_gym._src.contact.deadline import Deadline
from symbrion_gym._src.contact.distances import SurfaceDistance, find_nearest
from symbrion_gym._src.contact.kinds import Contact
from symbrion_gym._src.contact.options import CONTACT_AIM, ContactOptions
from symbrion_gym._src.contact.planes import Planes, find_planes
from symbrion_gym._src.contact.simplification import split_long_edges
from symbrion_gym._src.contact.solid import Shape, close_holes, find_shape, take_top
from symbrion_gym._src.contact.terrain_planes import select_few_planes


@dataclass(frozen=True)
class ContactProblem:
    """One surface that contact geometry is made of."""

    surface: trimesh.Trimesh  # repaired, wound so that its faces look at free space
    options: ContactOptions  # what is wanted
    accuracy: float  # wanted distance between contact and surface [m]
    deadline: Deadline  # emergency stop
    progress: Progress  # called with what is being done and the share done
    is_two_sided: Bool[np.ndarray, " F"] | None = None  # which faces were seen from behind, too; None: none
    # kind of the surface that this is a part of; None: found on the surface itself
    known_shape: Shape | None = None

    @property
    def aim(self) -> float:
        """Distance that patches aim at [m]."""
        return CONTACT_AIM * self.accuracy

    @cached_property
    def distance(self) -> SurfaceDistance:
        """Distances of pieces from the surface."""
        return SurfaceDistance(self.surface)

    @cached_property
    def ground(self) -> Elevation:
        """Heights of the surface, seen from above."""
        return Elevation(self.surface)

    @cached_property
    def shape(self) -> Shape:
        """Kind of the surface."""
        return self.known_shape or find_shape(self.surface, self.ground)

    @cached_property
    def solid(self) -> trimesh.Trimesh | None:
        """The closed solid that the surface bounds, small holes closed; None where it is open."""
        if self.shape == "terrain":
            return None
        closed = close_holes(self.surface)
        return closed if closed.is_watertight and closed.volume > 0 else None

    @cached_property
    def top(self) -> trimesh.Trimesh:
        """What of a terrain is ground or wall, cut finer where its faces are large."""
        return split_long_edges(take_top(self.surface))

    @cached_property
    def top_ground(self) -> Elevation:
        """Heights of the top of a terrain."""
        return Elevation(self.top)

    @cached_property
    def planes(self) -> Planes:
        """Planes of the whole surface."""
        return find_planes(self.surface, self.aim, is_exceeded=self.deadline.is_over)

    @cached_property
    def terrain_planes(self) -> tuple[Planes, float]:
        """Planes of the top of a terrain, few if it has few, and the tolerance that they were found with [m]."""
        return select_few_planes(self.top, self.accuracy, self.deadline.is_over)

    def is_seen_from_behind(self, places: Float[np.ndarray, "N 3"]) -> Bool[np.ndarray, " N"]:
        """Return which places on the surface were seen from behind, too."""
        if self.is_two_sided is None or not self.is_two_sided.any():
            return np.zeros(len(places), dtype=bool)
        vertices, faces = np.asarray(self.surface.vertices), np.asarray(self.surface.faces)
        return self.is_two_sided[find_nearest(places, vertices, faces)[1]]

    def measure(self, pieces: list[trimesh.Trimesh], notes: dict[str, Any]) -> Contact:
        """Return pieces with their distances from the surface."""
        return Contact(pieces, self.distance.measure(pieces, self.deadline.elapsed), None, notes)
