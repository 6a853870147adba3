"""Courses known exactly: two ramps and a pit, and a staircase, as profiles drawn along x.

`Course()` is the truth that everything else is compared with. A course makes its exact surface (for rays and
pictures) and its exact convex pieces (for contact).
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction._src.base.range_checks import check_choice
from reconstruction._src.base.typed_json import JsonError, as_type
from reconstruction._src.geometry.rows import make_hull
from symbrion_gym._src.arenas.friction_map import FrictionMap, FrictionPatch
from symbrion_gym._src.errors import ArenaError

_THICKNESS = 0.2  # How far the ground reaches below the lowest floor [m]
_LONGEST = 1e4  # Largest size [m], and number of steps


@dataclass(frozen=True)
class Course:
    """Floor, ramp, plateau, pit, plateau, ramp, floor; the origin is the middle of the pit, x along, z up.

    Attributes:
        pit: width of the pit [m]; 0 leaves it out. The default is one that 8 modules do not cross without control,
            as they do 0.40 m.
        height: height of the plateaus above the floor, and depth of the pit [m].
        floor: length of the level floor on either end [m].
        ramp: length of each ramp along x [m].
        plateau: length of the plateau on either side of the pit [m].
        width: extent along y [m].
        friction: sliding friction of the ground.
        color_pattern: its colors, one of `PATTERNS`; None for none. Only a camera sees them.
        friction_patches: rectangles with another friction, (lowest x, highest x, friction) across the whole width, or
            (lowest x, highest x, lowest y, highest y, friction) [m]; where they overlap, the first holds.

    Raises:
        ArenaError: a size is not above 0, or too large, or a patch is no rectangle.
    """

    pit: float = 0.45
    height: float = 0.25
    floor: float = 1.6
    ramp: float = 1.0
    plateau: float = 0.5
    width: float = 2.0
    friction: float = 0.7
    color_pattern: str | None = None
    friction_patches: tuple[tuple[float, ...], ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "friction_patches", _read_patches(self.friction_patches))
        _check_sizes(self, ("height", "floor", "ramp", "plateau", "width", "friction"))
        if not 0.0 <= self.pit <= _LONGEST:
            raise ArenaError(f"Course: pit must be a width of 0 to {_LONGEST:g} m, got {self.pit}")
        _ = self.friction_map  # refuses what is no rectangle

    @property
    def friction_map(self) -> FrictionMap | None:
        """The patches with another friction, exact; None without."""
        if not self.friction_patches:
            return None
        return FrictionMap(tuple(_make_patch(values, self.width) for values in self.friction_patches))

    @property
    def pit_edges(self) -> tuple[float, float]:
        """x of the near and of the far edge of the pit [m]."""
        return -self.pit / 2, self.pit / 2

    @property
    def ramp_feet(self) -> tuple[float, float]:
        """x where the first ramp begins and where the last one ends [m]."""
        reach = self.pit / 2 + self.plateau + self.ramp
        return -reach, reach

    @property
    def length(self) -> float:
        """Extent along x [m]."""
        return 2 * (self.ramp_feet[1] + self.floor)

    @property
    def start(self) -> tuple[float, float]:
        """(x, y) where the head of a body starts [m]: on the floor, at the foot of the first ramp."""
        return self.ramp_feet[0], 0.0

    @property
    def goal(self) -> tuple[float, float]:
        """(x, y) to be reached [m]: the foot of the last ramp."""
        return self.ramp_feet[1], 0.0

    def profile(self) -> Float[np.ndarray, "P 2"]:
        """Return the line (x, z) drawn along y [m]; a vertical wall has the same x twice."""
        edge = self.pit / 2
        crest, foot, end = edge + self.plateau, self.ramp_feet[1], self.length / 2
        right = [(edge, self.height), (crest, self.height), (foot, 0.0), (end, 0.0)]
        left = [(-x, z) for x, z in reversed(right)]
        if self.pit == 0.0:
            return np.array(left + right[1:])
        return np.array([*left, (-edge, 0.0), (edge, 0.0), *right])

    def pieces(self) -> list[trimesh.Trimesh]:
        """Return exact convex solids whose union is the course: boxes, the ramps' tilted."""
        edge, crest = self.pit / 2, self.pit / 2 + self.plateau
        foot, end = self.ramp_feet[1], self.length / 2
        slope = np.array([crest - foot, self.height]) / np.hypot(foot - crest, self.height)
        into = min(_THICKNESS, self.plateau / 2) * np.array([-slope[1], slope[0]])
        top = np.array([(foot, 0.0), (crest, self.height)])
        right_ramp = np.concatenate([top, top[::-1] + into])
        ground = [(-end, -_THICKNESS), (end, -_THICKNESS), (end, 0.0), (-end, 0.0)]
        block = [(edge, -_THICKNESS), (crest, -_THICKNESS), (crest, self.height), (edge, self.height)]
        outlines = [np.array(ground), np.array(block), right_ramp]
        outlines += [outline * (-1.0, 1.0) for outline in outlines[1:]]
        return [_extrude_convex(outline, self.width) for outline in outlines]

    def surface(self) -> trimesh.Trimesh:
        """Return the exact open surface, normals up, walls vertical."""
        return _extrude_line(self.profile(), self.width)

    def as_dict(self) -> dict[str, Any]:
        """Return the fields with the kind of course, for JSON."""
        return {"kind": "pit", **_list_fields(self)}


@dataclass(frozen=True)
class StairsCourse:
    """Floor, steps up, plateau; the origin is the foot of the first step, x along, z up.

    Attributes:
        steps: number of steps.
        rise: height of one step [m].
        run: depth of one step [m].
        floor: length of the level floor before the steps [m].
        plateau: length of the level beyond the last step [m].
        width: extent along y [m].
        friction: sliding friction of the ground.
        color_pattern: its colors, one of `PATTERNS`; None for none. Only a camera sees them.

    Raises:
        ArenaError: a size, or the number of steps, is not above 0, or too large.
    """

    steps: int = 5
    rise: float = 0.05
    run: float = 0.30
    floor: float = 1.6
    plateau: float = 1.6
    width: float = 2.0
    friction: float = 0.7
    color_pattern: str | None = None
    friction_map: ClassVar[None] = None  # one friction for all

    def __post_init__(self) -> None:
        _check_sizes(self, ("steps", "rise", "run", "floor", "plateau", "width", "friction"))

    @property
    def length(self) -> float:
        """Extent along x [m]."""
        return self.floor + (self.steps - 1) * self.run + self.plateau

    @property
    def start(self) -> tuple[float, float]:
        """(x, y) where the head of a body starts [m]: before the first step."""
        return -0.1, 0.0

    @property
    def goal(self) -> tuple[float, float]:
        """(x, y) to be reached [m]: the middle of the upper level."""
        return (self.steps - 1) * self.run + self.plateau / 2, 0.0

    def profile(self) -> Float[np.ndarray, "P 2"]:
        """Return the line (x, z) drawn along y [m]; a vertical wall has the same x twice."""
        line = [(-self.floor, 0.0)]
        for step in range(self.steps):
            line += [(step * self.run, step * self.rise), (step * self.run, (step + 1) * self.rise)]
        return np.array([*line, ((self.steps - 1) * self.run + self.plateau, self.steps * self.rise)])

    def pieces(self) -> list[trimesh.Trimesh]:
        """Return exact convex solids whose union is the course: one box a level, each reaching to the end."""
        end = (self.steps - 1) * self.run + self.plateau
        corners = [(-self.floor, 0.0)]
        corners += [(step * self.run, (step + 1) * self.rise) for step in range(self.steps)]
        outlines = [np.array([(x, -_THICKNESS), (end, -_THICKNESS), (end, z), (x, z)]) for x, z in corners]
        return [_extrude_convex(outline, self.width) for outline in outlines]

    def surface(self) -> trimesh.Trimesh:
        """Return the exact open surface, normals up, walls vertical."""
        return _extrude_line(self.profile(), self.width)

    def as_dict(self) -> dict[str, Any]:
        """Return the fields with the kind of course, for JSON."""
        return {"kind": "stairs", **_list_fields(self)}


def _list_fields(course: Course | StairsCourse) -> dict[str, Any]:
    """Return the fields, without colors and patches that there are not."""
    optional = ("color_pattern", "friction_patches")
    return {name: value for name, value in asdict(course).items() if value or name not in optional}


COURSES = {"pit": Course, "stairs": StairsCourse}


def make_course(fields: dict[str, Any]) -> Course | StairsCourse:
    """Make a course of what `as_dict` returned."""
    values = dict(fields)
    kind = values.pop("kind", None)
    check_choice("course.kind", kind, tuple(COURSES), ArenaError)
    try:
        return as_type(values, COURSES[kind], "course")
    except JsonError as error:
        raise ArenaError(str(error)) from error


def make_simple_surface(course: Course | StairsCourse) -> trimesh.Trimesh:
    """Return the hand-made model (paper, Fig. 6): the surface with its two sides, 38 triangles for a pit.

    Every triangle is as large as the shape allows: what a person draws who measures the course with a ruler.
    """
    from manifold3d import triangulate

    outline = course.profile()
    bottom = outline[:, 1].min() - _THICKNESS
    polygon = np.concatenate([[(outline[0, 0], bottom), (outline[-1, 0], bottom)], outline[::-1]])
    triangles = np.asarray(triangulate([polygon]))
    sides = [
        trimesh.Trimesh(_place(polygon, y), triangles[:, ::order], process=False)
        for y, order in ((-course.width / 2, 1), (course.width / 2, -1))
    ]
    surface = course.surface()
    for side in sides:
        surface += side
    return surface


def _check_sizes(course: Course | StairsCourse, names: tuple[str, ...]) -> None:
    if course.color_pattern is not None:
        check_choice("color_pattern", course.color_pattern, tuple(PATTERNS), ArenaError)
    for name in names:
        value = getattr(course, name)
        if not 0.0 < value <= _LONGEST:
            kind = type(course).__name__
            raise ArenaError(f"{kind}: {name} must be above 0, up to {_LONGEST:g}, got {value}")


_PATCH = "(lowest x, highest x, friction) or (lowest x, highest x, lowest y, highest y, friction)"


def _read_patches(patches: Any) -> tuple[tuple[float, ...], ...]:
    try:
        return tuple(tuple(map(float, patch)) for patch in patches)
    except (TypeError, ValueError) as error:
        raise ArenaError(
            f"friction_patches is {patches!r}; a list of rectangles is needed, each {_PATCH}"
        ) from error


def _make_patch(values: tuple[float, ...], width: float) -> FrictionPatch:
    if len(values) not in (3, 5):
        raise ArenaError(f"friction patch {values}: {_PATCH} is needed")
    x0, x1, *across, friction = values
    y0, y1 = across or (-width / 2, width / 2)
    if not (x0 < x1 and y0 < y1):
        raise ArenaError(f"friction patch {values}: the lowest x and y must be below the highest")
    return FrictionPatch.of_rectangle((x0, y0), (x1, y1), friction)


def _place(line: Float[np.ndarray, "P 2"], y: float) -> Float[np.ndarray, "P 3"]:
    """Return the line (x, z) at one y."""
    return np.stack([line[:, 0], np.full(len(line), y), line[:, 1]], axis=1)


def _extrude_line(line: Float[np.ndarray, "P 2"], width: float) -> trimesh.Trimesh:
    """Draw the line (x, z) from y = -width/2 to width/2: two triangles a segment, normals to its left."""
    count = len(line)
    vertices = np.concatenate([_place(line, -width / 2), _place(line, width / 2)])
    i = np.arange(count - 1)
    near = np.stack([i, i + 1, i + 1 + count], axis=1)
    far = np.stack([i, i + 1 + count, i + count], axis=1)
    return trimesh.Trimesh(vertices, np.stack([near, far], axis=1).reshape(-1, 3), process=False)


def _extrude_convex(outline: Float[np.ndarray, "P 2"], width: float) -> trimesh.Trimesh:
    """Draw a convex outline (x, z) over the width, as a closed solid."""
    solid = make_hull(np.concatenate([_place(outline, -width / 2), _place(outline, width / 2)]))
    if solid is None:
        raise ArenaError(f"the course has a piece without a volume; check its sizes: {outline.tolist()}")
    return solid


_EDGE = 0.3  # Of a cube of the checker [m]
_SHIFT = np.array([0.15, 0.0, 0.125])
"""Of the cubes: no floor, plateau or wall of the courses lies on a side of one [m]."""
_CHECKER = np.array([[0.84, 0.74, 0.58], [0.55, 0.64, 0.70]])  # Sand and slate
_WAVES = np.array([[0.9, 0.4, 0.5], [-0.6, 1.1, 0.7], [0.5, -0.8, 1.3]])
"""Wave vectors of red, green and blue in the gradient [rad/m]."""
_MIDDLE, _SWING = 0.5, 0.35  # Of a channel of the gradient


def _paint_checker(places: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
    cube = np.floor((places - _SHIFT) / _EDGE).astype(np.int64)
    return _CHECKER[cube.sum(axis=1) % len(_CHECKER)]


def _paint_gradient(places: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
    return _MIDDLE + _SWING * np.sin(places @ _WAVES.T)


PATTERNS: dict[str, Callable[[Float[np.ndarray, "N 3"]], Float[np.ndarray, "N 3"]]] = {
    "checker": _paint_checker,
    "gradient": _paint_gradient,
}
"""Name -> the function that returns red, green and blue (0 to 1) of positions [m]."""
