"""A course that has changed since it was scanned: the truth before and now, surface and contact."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float

import symbrion_gym as sg
from evolution._src.errors import RunError
from symbrion_gym._src.arenas.friction_map import FrictionMap, FrictionPatch
from symbrion_gym._src.contact.quality import ArenaQuality

_SAME = 1e-9
"""Coordinates closer than this are one [m]."""
_DEPTH = 0.1
"""How far a box reaches into the ground [m]: its contact has no seam with that of the floor."""


@dataclass(frozen=True)
class Box:
    """A box that stands on the level floor.

    Attributes:
        x: from, to [m].
        y: from, to [m].
        height: [m].

    Raises:
        RunError: it has no volume.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    height: float

    def __post_init__(self) -> None:
        if not (self.x[0] < self.x[1] and self.y[0] < self.y[1] and self.height > 0):
            raise RunError(
                f"a box from x {self.x}, y {self.y}, height {self.height} m has no volume; give from < to"
            )


@dataclass(frozen=True)
class Ice:
    """Slippery ground on the level floor.

    Attributes:
        x: from, to [m].
        y: from, to [m].
        friction: sliding friction on it.

    Raises:
        RunError: it has no area.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    friction: float

    def __post_init__(self) -> None:
        if not (self.x[0] < self.x[1] and self.y[0] < self.y[1]):
            raise RunError(f"ice from x {self.x}, y {self.y} m has no area; give from < to")


DEFAULT_ICE = Ice((-2.5, -1.8), (-0.4, 0.15), 0.2)
"""Where the champion starts; beyond it are the new box and the ramp."""


@dataclass(frozen=True)
class SceneConfig:
    """A course with boxes on its first floor, before and now.

    Attributes:
        pit: width of the pit before [m].
        widening: by how much the far wall of the pit has moved away since [m].
        old_box: stood there, and is gone; None for none.
        new_box: stands there now; None for none.
        ice: patch of the first floor that is slippery now; None for none.

    Raises:
        RunError: the widening leaves nothing of the plateau, or a box or the ice is not on the first floor.
    """

    pit: float = 0.40
    widening: float = 0.10
    old_box: Box | None = Box((-2.95, -2.7), (-0.7, -0.4), 0.15)
    new_box: Box | None = Box((-2.05, -1.8), (0.3, 0.55), 0.1)
    ice: Ice | None = DEFAULT_ICE

    def __post_init__(self) -> None:
        course = self.course
        if not 0.0 <= self.widening < course.plateau:
            raise RunError(
                f"the wall moves by {self.widening} m; give 0 or more, less than the plateau's {course.plateau} m"
            )
        for part in (self.old_box, self.new_box, self.ice):
            if part is None:
                continue
            inside = -course.length / 2 < part.x[0] and part.x[1] < course.ramp_feet[0]
            if not inside or max(-part.y[0], part.y[1]) >= course.width / 2:
                raise RunError(
                    f"{part} is not on the first floor, x {-course.length / 2:g} to {course.ramp_feet[0]:g} m"
                )

    @property
    def course(self) -> sg.Course:
        """The course without boxes, before."""
        return sg.Course(pit=self.pit)


@dataclass(frozen=True)
class Region:
    """A part of the true surface where something has changed.

    Attributes:
        name: what has changed.
        low: lowest corner [m].
        high: highest corner [m].
    """

    name: str
    low: tuple[float, float, float]
    high: tuple[float, float, float]

    def contains(self, places: Float[np.ndarray, "N 3"]) -> np.ndarray:
        """Return which places lie in it."""
        return np.asarray(((places >= np.array(self.low)) & (places <= np.array(self.high))).all(axis=1))


def make_truth(config: SceneConfig, *, is_changed: bool) -> sg.Arena:
    """Return the true arena, before or after the changes.

    Args:
        config: the scene.
        is_changed: whether as it is now.
    """
    box = config.new_box if is_changed else config.old_box
    widening = config.widening if is_changed else 0.0
    course = config.course
    surface = _move_wall(course.surface(), course, widening)
    pieces = [_move_wall(piece, course, widening) for piece in course.pieces()]
    if box is not None:
        surface = _put_on_floor(surface, course, box)
        size = (box.x[1] - box.x[0], box.y[1] - box.y[0], box.height + _DEPTH)
        solid = trimesh.creation.box(size)
        solid.apply_translation([sum(box.x) / 2, sum(box.y) / 2, (box.height - _DEPTH) / 2])
        pieces = [*pieces, solid]
    about: dict[str, Any] = {"source": "truth, changed" if is_changed else "truth"}
    quality = ArenaQuality(mean=0.0, p95=0.0, max=0.0, num_pieces=len(pieces))
    plain = sg.Arena.from_course(course, name="truth_now" if is_changed else "truth_before")
    ice = None
    if is_changed and config.ice is not None:
        low, high = zip(config.ice.x, config.ice.y, strict=True)
        ice = FrictionMap((FrictionPatch.of_rectangle(low, high, config.ice.friction),))
    # The course does not describe boxes and moved walls: start, edges and finish are found on the surface.
    return replace(
        plain,
        pieces=pieces,
        surface=surface,
        quality=quality,
        course=None,
        provenance=about,
        friction_map=ice,
    )


def find_regions(config: SceneConfig, margin: float = 0.05) -> list[Region]:
    """Return where the truth has changed, with a margin around [m]."""
    course, found = config.course, []
    if config.new_box is not None:
        found.append(_surround("box added", config.new_box, margin))
    if config.old_box is not None:
        found.append(_surround("box gone", config.old_box, margin))
    if config.widening:
        edge, half = course.pit_edges[1], course.width / 2
        low, high = (
            (edge - margin, -half, -margin),
            (edge + config.widening + margin, half, course.height + margin),
        )
        found.append(Region("wall moved", low, high))
    return found


def _surround(name: str, box: Box, margin: float) -> Region:
    low = (box.x[0] - margin, box.y[0] - margin, -margin)
    return Region(name, low, (box.x[1] + margin, box.y[1] + margin, box.height + margin))


def _move_wall(mesh: trimesh.Trimesh, course: sg.Course, widening: float) -> trimesh.Trimesh:
    """Return a mesh with the vertices of the pit's far wall moved on; the ground piece has none there."""
    vertices = np.array(mesh.vertices, dtype=np.float64)
    vertices[np.abs(vertices[:, 0] - course.pit_edges[1]) < _SAME, 0] += widening
    return trimesh.Trimesh(vertices, mesh.faces, process=False)


def _put_on_floor(surface: trimesh.Trimesh, course: sg.Course, box: Box) -> trimesh.Trimesh:
    """Return the surface with the first floor cut around a box, and the box's sides and top."""
    centers = surface.triangles_center
    is_floor = (centers[:, 0] < course.ramp_feet[0]) & (np.abs(centers[:, 2]) < _SAME)
    rest = surface.triangles[~is_floor].reshape(-1, 3)
    xs = (-course.length / 2, *box.x, course.ramp_feet[0])
    ys = (-course.width / 2, *box.y, course.width / 2)
    quads = []
    for i in range(3):
        for j in range(3):
            z = box.height if (i, j) == (1, 1) else 0.0
            (a, b), (c, d) = xs[i : i + 2], ys[j : j + 2]
            quads.append([(a, c, z), (b, c, z), (b, d, z), (a, d, z)])
    ring = [(box.x[0], box.y[0]), (box.x[1], box.y[0]), (box.x[1], box.y[1]), (box.x[0], box.y[1])]
    for (a, b), (c, d) in zip(ring, [*ring[1:], ring[0]], strict=True):
        quads.append([(a, b, 0.0), (c, d, 0.0), (c, d, box.height), (a, b, box.height)])
    corners = np.array(quads)
    triangles = np.concatenate([rest.reshape(-1, 3, 3), corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    vertices, faces = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    return trimesh.Trimesh(vertices, faces.reshape(-1, 3), process=False)
