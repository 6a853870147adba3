"""Where the modules of a body stand at the beginning of a route, to be shown."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.traversability.routes import DrivingRoute


def place_modules(body: Organism, route: DrivingRoute) -> Float[np.ndarray, "N 4 4"]:
    """Return the poses of the centers of all modules, hinges straight, the middle of the body at the start.

    The body stands level at the height of the ground at the start and looks where the route begins.
    """
    poses = body.find_poses()
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
