"""Made rooms with known objects at known poses, with clutter, and scans of them by a simulated scanner."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import trimesh

from benchmarks.material.ray_casts import make_embree_cast
from reconstruction._src.geometry.pose import make_rotation
from reconstruction._src.scans.cloud import Cloud

MIN_READINGS = 60
"""An object counts as seen with this many readings on it; one with fewer is neither wanted nor false."""
_CLEARANCE = 0.05
"""Bodies of a room stay this far from an object [m]."""


class PlacedObject(NamedTuple):
    """An object at a place.

    Attributes:
        name: which object.
        position: `[3]` of its origin [m].
        rotation: `[3, 3]` object to room.
        readings: number of readings on it.
    """

    name: str
    position: np.ndarray
    rotation: np.ndarray
    readings: int = 0


class RoomSurvey(NamedTuple):
    """A scan of a room and what is in it.

    Attributes:
        cloud: readings with viewpoints.
        objects: what was placed.
    """

    cloud: Cloud
    objects: list[PlacedObject]


class RoomScan(NamedTuple):
    """How a room is scanned.

    Attributes:
        noise: standard deviation of the range [m].
        step: between beams, in azimuth and elevation [deg].
        num_viewpoints: how many places the scanner stands at.
    """

    noise: float = 0.005
    step: float = 0.4
    num_viewpoints: int = 4


def make_survey(
    meshes: dict[str, trimesh.Trimesh], seed: int, num_objects: int | None = None, how: RoomScan | None = None
) -> RoomSurvey:
    """Make a room of random sizes with objects and clutter, and scan it.

    Args:
        meshes: name -> object; "station" and "box" stand on the floor, others hang on walls.
        seed: of everything.
        num_objects: how many; None for 0 to 6, drawn.
        how: noise and spacing of the scan; None for the defaults.
    """
    rng, how = np.random.default_rng(seed), how or RoomScan()
    parts, placed, viewpoints = make_room(meshes, rng, num_objects, how.num_viewpoints)
    return _scan(meshes, parts, placed, viewpoints, how, rng)


def make_room(
    meshes: dict[str, trimesh.Trimesh], rng: np.random.Generator, num_objects: int | None, num_viewpoints: int
) -> tuple[list[trimesh.Trimesh], list[PlacedObject], np.ndarray]:
    """Return the bodies of a room, the objects in it, and places for the scanner that are clear of both."""
    size = np.array([rng.uniform(4.0, 6.5), rng.uniform(3.5, 5.0), rng.uniform(2.4, 2.8)])
    count = int(rng.integers(0, 7)) if num_objects is None else num_objects
    parts, spheres = _make_shell(size), []
    placed: list[PlacedObject] = []
    names = sorted(meshes)
    for _ in range(count):
        name = names[int(rng.integers(len(names)))]
        _place_object(rng, size, name, meshes[name], placed, spheres)
    viewpoints = _choose_viewpoints(rng, size, num_viewpoints)
    keep = [(viewpoint, 0.25) for viewpoint in viewpoints] + spheres
    return [*parts, *_make_clutter(rng, size, keep)], placed, viewpoints


def _scan(
    meshes: dict[str, trimesh.Trimesh],
    parts: list[trimesh.Trimesh],
    placed: list[PlacedObject],
    viewpoints: np.ndarray,
    how: RoomScan,
    rng: np.random.Generator,
) -> RoomSurvey:
    """Cast the beams; every reading knows the body that it is on."""
    bodies = [*parts, *(place_mesh(meshes[each.name], each) for each in placed)]
    whole = trimesh.util.concatenate(bodies)
    owner = np.repeat(np.arange(len(bodies)), [len(body.faces) for body in bodies])
    from trimesh.ray.ray_pyembree import RayMeshIntersector

    faces_of = RayMeshIntersector(whole)
    cast = make_embree_cast(whole)
    elevation = np.radians(np.arange(-80.0, 90.0, how.step))
    points, seen_from, hit = [], [], []
    for row, viewpoint in enumerate(viewpoints):
        azimuth = rng.uniform(0, 2 * np.pi) + np.radians(np.arange(0.0, 360.0, how.step))
        tilt, heading = (grid.ravel() for grid in np.meshgrid(elevation, azimuth, indexing="ij"))
        directions = np.stack(
            [np.cos(tilt) * np.cos(heading), np.cos(tilt) * np.sin(heading), np.sin(tilt)], axis=1
        )
        ranges = cast(viewpoint, directions)
        face = np.asarray(faces_of.intersects_first(np.broadcast_to(viewpoint, directions.shape), directions))
        is_hit = np.isfinite(ranges)
        noisy = ranges[is_hit] + rng.normal(0, how.noise, int(is_hit.sum()))
        points.append(viewpoint + directions[is_hit] * noisy[:, None])
        seen_from.append(np.full(len(noisy), row))
        hit.append(owner[face[is_hit]])
    readings = np.bincount(np.concatenate(hit), minlength=len(bodies))[len(parts) :]
    cloud = Cloud(np.concatenate(points), viewpoints=viewpoints, seen_from=np.concatenate(seen_from))
    return RoomSurvey(
        cloud, [each._replace(readings=int(n)) for each, n in zip(placed, readings, strict=True)]
    )


def place_mesh(mesh: trimesh.Trimesh, each: PlacedObject) -> trimesh.Trimesh:
    """Return an object's mesh at its place."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = each.rotation, each.position
    return mesh.copy().apply_transform(pose)


def _make_shell(size: np.ndarray) -> list[trimesh.Trimesh]:
    """Make floor, ceiling and walls around the origin of the floor, 0.1 m thick."""
    x, y, z = size
    return [
        _box((0, 0, -0.05), (x + 0.2, y + 0.2, 0.1)),
        _box((0, 0, z + 0.05), (x + 0.2, y + 0.2, 0.1)),
        *(_box((s * (x / 2 + 0.05), 0, z / 2), (0.1, y + 0.2, z)) for s in (-1, 1)),
        *(_box((0, s * (y / 2 + 0.05), z / 2), (x, 0.1, z)) for s in (-1, 1)),
    ]


def _place_object(
    rng: np.random.Generator,
    size: np.ndarray,
    name: str,
    mesh: trimesh.Trimesh,
    placed: list[PlacedObject],
    spheres: list[tuple[np.ndarray, float]],
) -> None:
    """Place an object on a wall, or on the floor, away from those that are placed."""
    radius = float(np.linalg.norm(mesh.extents)) / 2 + _CLEARANCE
    for _ in range(200):
        if name in ("station", "box"):
            position = np.array([*rng.uniform(-size[:2] / 2 + 0.3, size[:2] / 2 - 0.3), 0.0])
            rotation = make_rotation(yaw=rng.uniform(-np.pi, np.pi))
        else:
            wall, along = int(rng.integers(4)), rng.uniform(-0.42, 0.42)
            height = rng.uniform(0.25, min(1.6, size[2] - 0.4))
            side = (np.array([0.5, along]), np.array([along, 0.5]))[wall % 2] * (1 if wall < 2 else -1)
            position = np.array([*(side * size[:2]), height])
            yaw = (np.pi, -np.pi / 2, 0.0, np.pi / 2)[wall]
            rotation = make_rotation(yaw=yaw) @ make_rotation(roll=rng.uniform(-np.pi, np.pi))
        if all(np.linalg.norm(position - other) > radius + reach for other, reach in spheres):
            spheres.append((position, radius))
            placed.append(PlacedObject(name, position, rotation))
            return


def _choose_viewpoints(rng: np.random.Generator, size: np.ndarray, count: int) -> np.ndarray:
    """Choose one viewpoint in each part of the room, 1.0 to 1.6 m high."""
    corners = np.array([(-1, -1), (1, 1), (1, -1), (-1, 1), (0, 0)])[np.arange(count) % 5]
    places = corners * size[:2] / 4 + rng.uniform(-0.3, 0.3, (count, 2))
    return np.column_stack([places, rng.uniform(1.0, 1.6, count)])


def _make_clutter(
    rng: np.random.Generator, size: np.ndarray, keep: list[tuple[np.ndarray, float]]
) -> list[trimesh.Trimesh]:
    """Make tables, shelves, boxes and cylinders on the floor, and small boxes and cylinders on the walls.

    Those on the walls are as large as a socket: they could be taken for one.
    """
    parts: list[trimesh.Trimesh] = []
    for _ in range(int(rng.integers(1, 3))):
        parts += _try(rng, size, keep, _make_table)
    parts += _try(rng, size, keep, _make_shelf)
    for _ in range(int(rng.integers(5, 11))):
        parts += _try(rng, size, keep, _make_floor_thing)
    for _ in range(int(rng.integers(4, 9))):
        parts += _try(rng, size, keep, _make_wall_thing)
    return parts


def _try(rng: np.random.Generator, size: np.ndarray, keep: list, make) -> list[trimesh.Trimesh]:
    """Return what `make` made, where it keeps clear of viewpoints and objects; nothing after 30 trials."""
    for _ in range(30):
        parts = make(rng, size)
        low = np.min([part.bounds[0] for part in parts], axis=0)
        high = np.max([part.bounds[1] for part in parts], axis=0)
        gaps = [np.linalg.norm(np.maximum(0, np.maximum(low - p, p - high))) - reach for p, reach in keep]
        if min(gaps, default=1.0) > 0:
            return parts
    return []


def _make_table(rng: np.random.Generator, size: np.ndarray) -> list[trimesh.Trimesh]:
    x, y = rng.uniform(-size[:2] / 2 + 0.7, size[:2] / 2 - 0.7)
    long, wide, high = rng.uniform(0.8, 1.4), rng.uniform(0.5, 0.8), rng.uniform(0.65, 0.8)
    turn = trimesh.transformations.rotation_matrix(rng.uniform(0, np.pi), [0, 0, 1], [x, y, 0])
    legs = [
        (x + s * (long / 2 - 0.05), y + t * (wide / 2 - 0.05), high / 2) for s in (-1, 1) for t in (-1, 1)
    ]
    parts = [_box((x, y, high), (long, wide, 0.03)), *(_box(leg, (0.05, 0.05, high)) for leg in legs)]
    for _ in range(int(rng.integers(0, 4))):
        thing = rng.uniform((0.05, 0.05, 0.04), (0.3, 0.25, 0.25))
        place = (x + rng.uniform(-0.3, 0.3) * long, y + rng.uniform(-0.3, 0.3) * wide, high + thing[2] / 2)
        parts.append(_box(place, thing))
    return [part.apply_transform(turn) for part in parts]


def _make_shelf(rng: np.random.Generator, size: np.ndarray) -> list[trimesh.Trimesh]:
    """Make a shelf with four boards and things on them, along a wall at -y or y."""
    long, deep, side = rng.uniform(0.8, 1.4), 0.3, rng.choice([-1, 1])
    x, y = rng.uniform(-0.5, 0.5) * (size[0] - long - 0.2), side * (size[1] / 2 - deep / 2)
    boards = np.linspace(0.05, 1.7, 5)
    parts = [_box((x, y, z), (long, deep, 0.025)) for z in boards]
    parts += [_box((x + s * long / 2, y, 0.9), (0.025, deep, 1.8)) for s in (-1, 1)]
    for z in boards[:-1]:
        for _ in range(int(rng.integers(0, 4))):
            thing = rng.uniform((0.04, 0.05, 0.05), (0.2, 0.2, 0.3))
            parts.append(_box((x + rng.uniform(-0.4, 0.4) * long, y, z + 0.0125 + thing[2] / 2), thing))
    return parts


def _make_floor_thing(rng: np.random.Generator, size: np.ndarray) -> list[trimesh.Trimesh]:
    x, y = rng.uniform(-size[:2] / 2 + 0.25, size[:2] / 2 - 0.25)
    if rng.random() < 0.3:
        radius, height = rng.uniform(0.04, 0.2), rng.uniform(0.1, 0.6)
        place = trimesh.transformations.translation_matrix((x, y, height / 2))
        return [trimesh.creation.cylinder(radius, height, sections=32, transform=place)]
    thing = rng.uniform((0.1, 0.1, 0.08), (0.6, 0.5, 0.5))
    turn = trimesh.transformations.rotation_matrix(rng.uniform(0, np.pi), [0, 0, 1], [x, y, 0])
    return [_box((x, y, thing[2] / 2), thing).apply_transform(turn)]


def _make_wall_thing(rng: np.random.Generator, size: np.ndarray) -> list[trimesh.Trimesh]:
    wall, height = int(rng.integers(4)), rng.uniform(0.2, size[2] - 0.3)
    axis, sign = wall % 2, 1 if wall < 2 else -1
    deep, wide, high = rng.uniform((0.02, 0.05, 0.05), (0.15, 0.3, 0.3))
    along = rng.uniform(-0.45, 0.45) * size[1 - axis]
    center = np.zeros(3)
    center[axis], center[1 - axis], center[2] = sign * (size[axis] / 2 - deep / 2), along, height
    extent = np.zeros(3)
    extent[axis], extent[1 - axis], extent[2] = deep, wide, high
    if rng.random() < 0.35:  # a round lamp or a pipe's end
        normal = -sign * np.eye(3)[axis]
        place = trimesh.geometry.align_vectors([0, 0, 1], normal)
        place[:3, 3] = center
        return [trimesh.creation.cylinder(wide / 2, deep, sections=32, transform=place)]
    return [_box(tuple(center), extent)]


def _box(center: tuple, size) -> trimesh.Trimesh:
    return trimesh.creation.box(size, trimesh.transformations.translation_matrix(center))
