"""What an arena is: convex pieces for contact, an exact surface for rays, and what is known about both.

And arenas made of arenas: with colors, with objects, a little longer.
"""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import trimesh
from jaxtyping import Bool, Float
from numpy.typing import ArrayLike

from reconstruction._src.base.range_checks import check_choice, format_distance
from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.halfspaces import find_box
from reconstruction._src.geometry.mesh_repair import simplify
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.surfaces.color import copy_vertex_colors, paint_mesh
from reconstruction._src.surfaces.primitives.find import Primitives
from symbrion_gym._src.arenas.checks import check_friction, check_names
from symbrion_gym._src.arenas.course import Course, StairsCourse
from symbrion_gym._src.arenas.friction_map import FrictionMap, split_pieces
from symbrion_gym._src.arenas.placed_objects import PlacedObject, check_objects
from symbrion_gym._src.arenas.primitives import primitives_to_dict
from symbrion_gym._src.arenas.saving import load_arena_folder, save_arena
from symbrion_gym._src.arenas.spec import ArenaGeometry, make_arena_spec
from symbrion_gym._src.arenas.texture import (
    SurfaceTexture,
    check_texture,
    find_surface_colors,
    make_texture,
    paint_course,
)
from symbrion_gym._src.arenas.verdict import Verdict, find_verdict
from symbrion_gym._src.contact.kinds import CONTACT_KINDS, HeightField
from symbrion_gym._src.contact.quality import ArenaQuality, RayMesh
from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.traversability.drivable import TraversabilityMap, find_traversability
from symbrion_gym._src.traversability.footprint import Footprint
from symbrion_gym._src.traversability.routes import DrivingRoute, Place, find_driving_route

_ABOVE = 0.05
"""Height above a place of what must be seen [m]: the surface is as far off its readings, and a robot is higher."""


@dataclass(frozen=True, repr=False)
class Arena:
    """A world without a robot.

    Attributes:
        name: what it is called in files and messages.
        pieces: convex solids, for contact.
        surface: the exact surface, for rays and pictures.
        quality: distances of the pieces from the surface.
        friction: sliding friction of the ground.
        course: the exact course that the arena is, as the truth is made of one; None for everything that was scanned:
            start, edges and finish are then found on the surface (`symbrion_gym._src.tasks.features`).
        kind: the kind of contact geometry.
        height_field: in place of pieces, for the kind "hfield".
        provenance: what it was made of, with which options and versions.
        offset: what was subtracted from the coordinates of the scan [m].
        texture: colors of the surface as a picture, as MuJoCo draws them; None where they are unknown.
            `surface.visual.vertex_colors` are then those of its vertices.
        friction_source: "exact", "given" by the user, "estimated" by robots from their slip, or "assumed": a scan does
            not show it, so randomize it.
        friction_map: patches with another friction; None where there is one friction for all. Pieces are cut where it
            changes.
        primitives: boxes, spheres, cylinders and rectangles in place of triangles, for the kind "mixed"; rays see them
            and the rest of the surface, and the solid ones are the last of the pieces.
        objects: known objects in it; `symbrion_gym.place_objects` adds those that were found.
        unseen: numbers of the faces of the surface that no reading confirms: nobody can drive there.

    Raises:
        ArenaError: name, friction or kind is out of range, the kind does not go with the height field, or the height
            field with a friction map.
    """

    name: str
    pieces: list[trimesh.Trimesh]
    surface: trimesh.Trimesh
    quality: ArenaQuality
    friction: float = 0.7
    course: Course | StairsCourse | None = None
    kind: str = "convex"
    height_field: HeightField | None = None
    provenance: dict[str, Any] = field(default_factory=dict)
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    friction_source: str = "given"
    texture: SurfaceTexture | None = None
    friction_map: FrictionMap | None = None
    primitives: Primitives | None = None
    objects: tuple[PlacedObject, ...] = ()
    unseen: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        check_names(self.name, self.friction_source)
        check_friction(self.friction)
        object.__setattr__(self, "objects", check_objects(self.objects))
        check_choice("kind", self.kind, CONTACT_KINDS, ArenaError)
        if (self.kind == "mixed") != (self.primitives is not None):
            raise ArenaError(f"kind is {self.kind!r}; 'mixed' has primitives, and no other kind has some")
        if (self.kind == "hfield") != (self.height_field is not None):
            raise ArenaError(f"kind is {self.kind!r}; 'hfield' has a height field, and no other kind has one")
        if self.texture is not None:
            check_texture(self.texture, self.surface, self.name)
        if self.friction_map is not None:
            if self.kind in ("hfield", "mixed") and self.friction_map.patches:
                raise ArenaError(
                    f"the kind {self.kind!r} has one friction for all; make the arena of the kind 'convex' for patches"
                )
            object.__setattr__(self, "pieces", split_pieces(self.pieces, self.friction_map))

    def __repr__(self) -> str:
        """Return name, contact, size and quality in one line."""
        sides = self.surface.extents if len(self.surface.faces) else ()
        size = " x ".join(f"{side:.3g}" for side in sides) or "empty"
        contact = "a height field" if self.height_field else f"{len(self.pieces)} {self.kind} pieces"
        off = f"{format_distance(self.quality.mean)} off in the mean"
        return f"Arena({self.name!r}: {contact}, {len(self.surface.faces)} faces, {size} m, {off})"

    @classmethod
    def from_course(cls, course: Course | StairsCourse, name: str = "truth") -> "Arena":
        """Make the exact arena of a course: contact and surface agree to the last digit."""
        pieces, surface = course.pieces(), course.surface()
        return cls(
            name=name,
            pieces=pieces,
            surface=surface,
            quality=ArenaQuality(mean=0.0, p95=0.0, max=0.0, num_pieces=len(pieces)),
            friction=course.friction,
            course=course,
            provenance={"course": course.as_dict()},
            friction_source="exact",
            texture=paint_course(surface, course.color_pattern) if course.color_pattern else None,
            friction_map=course.friction_map,
        )

    @cached_property
    def elevation(self) -> Elevation:
        """Heights of the exact surface."""
        return Elevation(self.surface)

    def height(self, x: ArrayLike, y: ArrayLike) -> Float[np.ndarray, " ..."]:
        """Return the height of the exact surface at each (x, y) [m]; NaN outside of it."""
        return self.elevation.height(x, y)

    def find_colors(self, positions: ArrayLike) -> Float[np.ndarray, "N 3"]:
        """Return red, green and blue (0 to 1) of the surface at the places nearest to positions `[N, 3]` [m].

        Raises:
            ArenaError: the arena has no colors.
        """
        return find_surface_colors(
            self.surface, self.texture, self.course, np.asarray(positions, dtype=np.float64)
        )

    def find_friction(self, positions: Float[np.ndarray, "N D"]) -> Float[np.ndarray, " N"]:
        """Return the sliding friction of the ground at positions (x, y, ...) [m]."""
        if self.friction_map is None:
            return np.full(len(positions), self.friction)
        return self.friction_map.find_friction(positions, self.friction)

    @property
    def geometry(self) -> ArenaGeometry:
        """What models and files show."""
        return ArenaGeometry(*(getattr(self, name) for name in ArenaGeometry._fields))

    @cached_property
    def _maps(self) -> dict[Footprint, TraversabilityMap]:
        return {}

    def traversability(self, body: Organism | Footprint | None = None) -> TraversabilityMap:
        """Map where a body can drive: on contact geometry that was seen, under ceilings, never on top of them.

        The map is made once for each footprint.

        Args:
            body: an organism, or what a body of any kind needs; None for one Scout.

        Raises:
            ArenaError: the arena has no contact geometry.
            OptionError: the body is of another kind.
        """
        footprint = Footprint.of(body, self.friction)
        if footprint not in self._maps:
            self._maps[footprint] = find_traversability(
                self.seen_surface, self.pieces, self.height_field, footprint
            )
        return self._maps[footprint]

    @cached_property
    def seen_surface(self) -> trimesh.Trimesh:
        """The surface without the faces that no reading confirms."""
        if not self.unseen:
            return self.surface
        faces = np.delete(np.asarray(self.surface.faces), self.unseen, axis=0)
        return trimesh.Trimesh(self.surface.vertices, faces, process=False)

    @cached_property
    def verdict(self) -> Verdict:
        """Whether it is good for a Scout, and why not."""
        contact = self.pieces if self.height_field is None else self.height_field
        try:
            ground = self.traversability()
        except ArenaError:  # there is none
            ground = None
        up, remedy = self.provenance.get("up"), self.provenance.get("remedy", "")
        return find_verdict(self.surface, self.seen_surface, contact, self.quality, ground, up, remedy)

    def find_route(
        self,
        body: Organism | Footprint | None = None,
        start: Place | None = None,
        goal: Place | None = None,
        max_length: float | None = None,
    ) -> DrivingRoute:
        """Find a way over ground that a body can drive on; start and goal are chosen unless they are given.

        Ways go around slippery patches of the `friction_map` where that costs less. Where the
        positions of the scanner are known, they are chosen where it saw the ground.

        Args:
            body: an organism, or what a body of any kind needs; None for one Scout.
            start: (x, y) or (x, y, z) [m]; z selects one of several storeys.
            goal: likewise.
            max_length: a route whose start or goal is chosen is no longer [m]; None for 10 m.

        Raises:
            ArenaError: there is no drivable ground, a given place is not drivable, or there is no way from start to
                goal; the message names the nearest place that is possible.
            OptionError: the body is of another kind.
        """
        find_seen = self.find_seen if self.provenance.get("viewpoints") else None
        ground = self.traversability(body)
        friction = self.find_friction(ground.positions)
        return find_driving_route(ground, start, goal, self.name, max_length, find_seen, friction)

    def find_seen(self, places: Float[np.ndarray, "N 3"]) -> Bool[np.ndarray, " N"]:
        """Return whether a position of the scanner (`provenance["viewpoints"]`) sees a little above places [m]."""
        rays = RayMesh([self.surface])
        targets, is_seen = places + np.array([0.0, 0.0, _ABOVE]), np.zeros(len(places), dtype=bool)
        for viewpoint in np.array(self.provenance["viewpoints"], dtype=np.float64):
            left = np.flatnonzero(~is_seen)
            ways = targets[left] - viewpoint
            ranges = np.maximum(np.linalg.norm(ways, axis=1), _ABOVE)
            free = rays.cast(np.tile(viewpoint, (len(left), 1)), ways / ranges[:, None])
            is_seen[left] = free >= ranges
        return is_seen

    def spec(self) -> mujoco.MjSpec:
        """Return a new spec: contact pieces in group 3, the surface in group 2, lights; angles in radians.

        Known objects are sites and, in group 1, geoms that touch nothing, each named `object_<name>_<i>`.
        """
        return make_arena_spec(self.geometry)

    def save(self, folder: str | Path) -> None:
        """Write the arena as a folder that MuJoCo's viewer opens (`arena.xml`).

        Raises:
            ArenaError: the folder contains something else.
        """
        about = {
            "name": self.name,
            "kind": self.kind,
            "friction": self.friction,
            "friction_source": self.friction_source,
            "num_pieces": len(self.pieces),
            "quality": self.quality.as_dict(),
            "provenance": self.provenance,
            "offset": list(self.offset),
        }
        optional = {
            "has_texture": self.texture is not None,
            "course": self.course and self.course.as_dict(),
            "friction_map": self.friction_map and asdict(self.friction_map),
            "primitives": self.primitives and primitives_to_dict(self.primitives),
            "objects": [each.as_dict() for each in self.objects],
            "unseen": list(self.unseen),
        }
        about |= {name: value for name, value in optional.items() if value}
        about["verdict"] = asdict(self.verdict)
        save_arena(folder, self.geometry, about)

    def export(self, folder: str | Path, to: str, max_vertices: int | None = 64) -> dict[str, Any]:
        """Write the arena as a folder that other simulators load without this package.

        Args:
            folder: new, empty, or that of a former export, whose files are replaced.
            to: "mjcf", "urdf", "usd" (needs the extra `usd`) or "obj".
            max_vertices: the most vertices of a convex solid; pieces with more are cut. None for no limit.

        Returns:
            What was written, as in `export.json`.

        Raises:
            ArenaError: there is no such format, it cannot hold the arena, the limit is too low, or the folder
                contains something else.
            MissingExtraError: the format needs an extra that is not installed.
        """
        from symbrion_gym._src.arenas.export.export import export_arena

        about = {
            "offset": list(self.offset),
            "quality": self.quality.as_dict(),
            "provenance": self.provenance,
        }
        return export_arena(folder, self.geometry, to, max_vertices, about)

    @classmethod
    def load(cls, folder: str | Path) -> "Arena":
        """Read what `save` wrote.

        Raises:
            ArenaError: there is no arena in the folder, or a damaged one.
        """
        fields = load_arena_folder(folder)
        verdict, arena = fields.pop("verdict"), cls(**fields)
        if verdict is not None:
            arena.__dict__["verdict"] = verdict  # where `cached_property` keeps it
        return arena


def color_arena(arena: Arena, cloud: Cloud) -> Arena:
    """Return an arena whose surface has the colors of the points around it; its contact stays the same.

    Args:
        arena: stays as it is.
        cloud: colored points, in the frame of the arena: coordinates of the scan minus `arena.offset` [m].

    Raises:
        ArenaError: the points have no colors.
    """
    if cloud.colors is None or not cloud.num_points:
        raise ArenaError("the cloud has no colored points; give a Cloud with colors")
    surface = arena.surface.copy()
    paint_mesh(surface, cloud)
    return replace(arena, surface=surface, texture=make_texture(surface, cloud))


_MAX_FACES = 2000  # Meshes of objects with more faces are simplified to as many


def place_objects(arena: Arena, found: Iterable[Any], meshes: Mapping[str, trimesh.Trimesh]) -> Arena:
    """Return an arena with objects that were found in its scan, as `arena.objects`.

    Args:
        arena: stays as it is; its offset is subtracted from the positions. Of its objects those of other names are
            kept.
        found: what `reconstruction.find_objects` returned.
        meshes: the objects' meshes, by name.

    Raises:
        ArenaError: an object has no mesh, or cannot be placed.
    """
    placed = [each for each in arena.objects if each.name not in meshes]
    for each in found:
        if each.name not in meshes:
            raise ArenaError(f"no mesh for object {each.name!r}; there are: {', '.join(meshes) or 'none'}")
        mesh = meshes[each.name]
        vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
        if len(faces) > _MAX_FACES:
            vertices, faces = simplify(vertices, faces, _MAX_FACES)
        light = trimesh.Trimesh(np.round(vertices, 6), faces, process=False)
        position = np.asarray(each.position, np.float64) - np.asarray(arena.offset)
        placed.append(PlacedObject(each.name, position, each.rotation, light))
    return replace(arena, objects=tuple(placed))


def stretch_arena(arena: Arena, factor: float, center: float = 0.0) -> Arena:
    """Return the arena with all lengths along x multiplied; boxes stay boxes, heights and objects as they are.

    A survey measures lengths to about a centimeter. What has x = `center` stays there [m]; of a course that is 0.
    """
    if factor == 1.0:
        return arena
    along, course, heights = np.array([factor, 1.0, 1.0]), arena.course, arena.height_field
    shift = np.array([0.0 if course is not None else (1.0 - factor) * center, 0.0, 0.0])
    if isinstance(course, Course):
        patches = [(factor * x0, factor * x1, *rest) for x0, x1, *rest in course.friction_patches]
        lengths = {name: factor * getattr(course, name) for name in ("pit", "floor", "ramp", "plateau")}
        course = replace(course, friction_patches=tuple(patches), **lengths)
    elif course is not None:
        lengths = {name: factor * getattr(course, name) for name in ("run", "floor", "plateau")}
        course = replace(course, **lengths)
    if heights is not None:
        low, high = (edge * along[:2] + shift[:2] for edge in (heights.low, heights.high))
        heights = heights._replace(low=low, high=high)
    surface = trimesh.Trimesh(arena.surface.vertices * along + shift, arena.surface.faces, process=False)
    copy_vertex_colors(arena.surface, surface)
    return replace(
        arena,
        pieces=[_stretch_piece(piece, along, shift) for piece in arena.pieces],
        surface=surface,
        course=course,
        height_field=heights,
        friction_map=None if arena.friction_map is None else arena.friction_map.stretch(factor, shift[0]),
        kind="convex" if arena.kind == "mixed" else arena.kind,
        primitives=None,
        objects=tuple(replace(each, position=each.position * along + shift) for each in arena.objects),
    )


def _stretch_piece(
    piece: trimesh.Trimesh, along: Float[np.ndarray, " 3"], shift: Float[np.ndarray, " 3"]
) -> trimesh.Trimesh:
    """Return a contact piece stretched and moved; a box becomes the box with the same top, stretched."""
    box = find_box(piece)
    if box is None:
        return trimesh.Trimesh(piece.vertices * along + shift, piece.faces, process=False)
    center, half_sizes, axes = box
    up = int(np.abs(axes[2]).argmax())
    others = [k for k in range(3) if k != up]
    first, second = (axes[:, k] * along for k in others)
    sizes = half_sizes[others] * np.linalg.norm([first, second], axis=1)
    first /= np.linalg.norm(first)
    normal = np.cross(first, second)
    normal *= np.sign(normal[2]) / np.linalg.norm(normal)
    top = center + axes[:, up] * np.sign(axes[2, up]) * half_sizes[up]
    frame = np.column_stack([first, np.cross(normal, first), normal])
    stretched = trimesh.creation.box(2 * np.array([*sizes, half_sizes[up]]))
    middle = top * along + shift - normal * half_sizes[up]
    return trimesh.Trimesh(stretched.vertices @ frame.T + middle, stretched.faces, process=False)
