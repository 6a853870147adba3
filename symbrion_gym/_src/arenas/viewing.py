"""An arena as MuJoCo's viewer shows it: contact translucent over the surface, drivable ground, a route."""

import itertools
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction._src.geometry.pose import make_pose, transform_planar
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.primitives import add_mesh
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
    x, y = transform_planar(places, np.array([*route.start[:2], route.heading])).T
    made = make_pose(x, y, [route.heading + pose.heading for pose in poses])
    made[:, 2, 3] = route.start[2] + body.scout.size[2] / 2
    return made


LAYERS = ("surface", "contact", "drivable", "route")  # What can be shown
CONTACT_OPACITY = 0.35
_SHOWN_GROUP = 1  # Geom group of what is added; the viewer shows groups 0 to 2 at first
_LOOK: dict[str, Any] = {"contype": 0, "conaffinity": 0, "group": _SHOWN_GROUP}
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
        _add_route(spec, route, robot)
    return spec


def open_viewer(spec: mujoco.MjSpec) -> None:
    """Show a spec in MuJoCo's viewer until its window is closed."""
    if not has_display():
        raise OptionError("no display: MuJoCo's viewer cannot open; draw a picture instead")
    from mujoco import viewer

    viewer.launch(spec.compile())


def _add_ground(spec: mujoco.MjSpec, ground: TraversabilityMap) -> None:
    """Add the cells of the map as three meshes of different colors, one square a place, seen from both sides."""
    kind = np.where(ground.region == 0, 0, np.where(ground.region > 0, 1, 2))
    half = ground.grid.cell / 2
    corners = [[-half, -half, _LIFT], [half, -half, _LIFT], [half, half, _LIFT], [-half, half, _LIFT]]
    square = np.array([[0, 1, 2], [0, 2, 3], [0, 2, 1], [0, 3, 2]])
    for index, color in enumerate(_GROUND_COLORS):
        places = ground.positions[kind == index]
        if len(places):
            vertices = (places[:, None] + np.array(corners)).reshape(-1, 3)
            faces = (4 * np.arange(len(places))[:, None, None] + square).reshape(-1, 3)
            squares = trimesh.Trimesh(vertices, faces, process=False)
            add_mesh(spec, spec.worldbody, f"ground_{index}", squares, **_LOOK, rgba=color)


def _add_route(spec: mujoco.MjSpec, route: DrivingRoute, robot: Organism | None) -> None:
    """Add the path as capsules, start and goal as balls, and a box for each module of a robot."""
    add, shapes = spec.worldbody.add_geom, mujoco.mjtGeom
    path = np.add(route.path, [0.0, 0.0, _LIFT])
    path = path[np.unique(np.linspace(0, len(path) - 1, _MOST_SEGMENTS + 1).astype(int))]
    look = _LOOK | {"rgba": _ROUTE_COLOR}
    for index, (start, end) in enumerate(itertools.pairwise(path)):
        size = [_ROUTE_RADIUS, 0.0, 0.0]
        add(name=f"route_{index}", type=shapes.mjGEOM_CAPSULE, fromto=[*start, *end], size=size, **look)
    for name, place in (("start", path[0]), ("goal", path[-1])):
        add(name=name, type=shapes.mjGEOM_SPHERE, pos=place, size=[_END_RADIUS, 0.0, 0.0], **look)
    look = _LOOK | {"type": shapes.mjGEOM_BOX, "rgba": _ROBOT_COLOR}
    for index, pose in enumerate(place_modules(robot, route) if robot is not None else ()):
        turn = [0.0, 0.0, float(np.arctan2(pose[1, 0], pose[0, 0]))]
        half = [edge / 2 for edge in robot.scout.size] if robot is not None else []
        add(name=f"robot_{index}", pos=pose[:3, 3], euler=turn, size=half, **look)
