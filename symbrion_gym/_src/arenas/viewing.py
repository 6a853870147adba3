"""An arena as MuJoCo's viewer shows it: contact translucent over the surface, drivable ground, a route."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.spec import CONTACT_GROUP, SURFACE_GROUP
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.headless import has_display
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.traversability.drivable import TraversabilityMap
from symbrion_gym._src.traversability.routes import DrivingRoute


def place_modules(body: Organism, route: DrivingRoute) -> Float[np.ndarray, "N 4 4"]:
    """Return the poses of the centers of all modules, hinges straight, the middle of the body at the start.

    The body stands level at the height of the ground at the start and looks where the route begins.
    """
    poses = body.compute_poses()
    places = np.array([(pose.x, pose.y) for pose in poses])
    places -= (places.min(axis=0) + places.max(axis=0)) / 2
    along = np.array([np.cos(route.heading), np.sin(route.heading)])
    left = np.array([-along[1], along[0]])
    made = np.tile(np.eye(4), (len(poses), 1, 1))
    for each, (x, y), pose in zip(made, places, poses, strict=True):
        c, s = np.cos(route.heading + pose.heading), np.sin(route.heading + pose.heading)
        each[:2, :2] = [[c, -s], [s, c]]
        each[:2, 3] = np.add(route.start[:2], x * along + y * left)
        each[2, 3] = route.start[2] + body.scout.size[2] / 2
    return made


LAYERS = ("surface", "contact", "drivable", "route")  # What can be shown
CONTACT_OPACITY = 0.35
_SHOWN_GROUP = 1  # Geom group of what is added; the viewer shows groups 0 to 2 at first
_GROUND_COLORS = ((0.22, 0.62, 0.34, 0.7), (0.35, 0.50, 0.80, 0.7), (0.86, 0.45, 0.38, 0.7))
"""Largest drivable region, other drivable regions, other ground."""
_ROUTE_COLOR = (0.70, 0.0, 0.31, 1.0)
_ROBOT_COLOR = (0.98, 0.78, 0.16, 1.0)
_LIFT = 0.02  # Ground and route are drawn this far above contact [m]
_MOST_SEGMENTS = 200  # Parts of a route
_ROUTE_RADIUS, _END_RADIUS = 0.012, 0.05  # Of the path, and of start and goal [m]


def make_view_spec(
    arena: Arena,
    layers: Sequence[str] = LAYERS,
    ground: TraversabilityMap | None = None,
    route: DrivingRoute | None = None,
    robot: Organism | None = None,
) -> mujoco.MjSpec:
    """Return a spec to look at: nothing of it is touched by anything."""
    unknown = [layer for layer in layers if layer not in LAYERS]
    if unknown:
        raise OptionError(f"no layer {unknown[0]!r}; there are {', '.join(LAYERS)}")
    spec = arena.spec()
    hidden = {CONTACT_GROUP: "contact" not in layers, SURFACE_GROUP: "surface" not in layers}
    for geom in list(spec.geoms):
        if hidden.get(int(geom.group), False):
            spec.delete(geom)
        elif geom.group == CONTACT_GROUP:
            geom.group = _SHOWN_GROUP
            geom.rgba = [*np.asarray(geom.rgba)[:3], CONTACT_OPACITY]
    if "drivable" in layers and ground is not None:
        _add_ground(spec, ground)
    if "route" in layers and route is not None:
        _add_route(spec, route)
        if robot is not None:
            _add_robot(spec, robot, route)
    return spec


def open_viewer(spec: mujoco.MjSpec) -> None:
    """Show a spec in MuJoCo's viewer until its window is closed."""
    if not has_display():
        raise OptionError("no display: MuJoCo's viewer cannot open; draw a picture instead")
    from mujoco import viewer

    viewer.launch(spec.compile())


def _add_robot(spec: mujoco.MjSpec, robot: Organism, route: DrivingRoute) -> None:
    """Add a box for each module of a robot."""
    for index, pose in enumerate(place_modules(robot, route)):
        spec.worldbody.add_geom(
            name=f"robot_{index}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=pose[:3, 3],
            euler=[0.0, 0.0, float(np.arctan2(pose[1, 0], pose[0, 0]))],
            size=[edge / 2 for edge in robot.scout.size],
            contype=0,
            conaffinity=0,
            group=_SHOWN_GROUP,
            rgba=_ROBOT_COLOR,
        )


def _add_ground(spec: mujoco.MjSpec, ground: TraversabilityMap) -> None:
    """Add the cells of the map as three meshes of different colors."""
    kind = np.where(ground.region == 0, 0, np.where(ground.region > 0, 1, 2))
    for index, color in enumerate(_GROUND_COLORS):
        if (kind == index).any():
            vertices, faces = _make_tiles(ground, kind == index)
            name = f"ground_{index}"
            spec.add_mesh(
                name=name,
                uservert=vertices.ravel(),
                userface=faces.ravel(),
                inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
            )
            spec.worldbody.add_geom(
                name=name,
                type=mujoco.mjtGeom.mjGEOM_MESH,
                meshname=name,
                contype=0,
                conaffinity=0,
                group=_SHOWN_GROUP,
                rgba=color,
            )


def _make_tiles(
    ground: TraversabilityMap, is_chosen: Bool[np.ndarray, " P"]
) -> tuple[Float[np.ndarray, "V 3"], np.ndarray]:
    """Return one square a place, seen from above and from below."""
    half = ground.grid.cell / 2
    corners = np.array(
        [[-half, -half, _LIFT], [half, -half, _LIFT], [half, half, _LIFT], [-half, half, _LIFT]]
    )
    vertices = (ground.positions[is_chosen][:, None] + corners).reshape(-1, 3)
    square = np.array([[0, 1, 2], [0, 2, 3], [0, 2, 1], [0, 3, 2]])
    faces = (4 * np.arange(int(is_chosen.sum()))[:, None, None] + square).reshape(-1, 3)
    return vertices, faces.astype(np.int32)


def _add_route(spec: mujoco.MjSpec, route: DrivingRoute) -> None:
    """Add the path as capsules, start and goal as balls."""
    path = np.add(route.path, [0.0, 0.0, _LIFT])
    path = path[np.unique(np.linspace(0, len(path) - 1, _MOST_SEGMENTS + 1).astype(int))]
    look = {"contype": 0, "conaffinity": 0, "group": _SHOWN_GROUP, "rgba": _ROUTE_COLOR}
    for index, (start, end) in enumerate(itertools.pairwise(path)):
        spec.worldbody.add_geom(
            name=f"route_{index}",
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[*start, *end],
            size=[_ROUTE_RADIUS, 0.0, 0.0],
            **look,
        )
    for name, place in (("start", path[0]), ("goal", path[-1])):
        spec.worldbody.add_geom(
            name=name, type=mujoco.mjtGeom.mjGEOM_SPHERE, pos=place, size=[_END_RADIUS, 0.0, 0.0], **look
        )
