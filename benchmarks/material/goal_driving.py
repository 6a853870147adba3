"""One Scout on tracks, driven to the goal of an arena's own route by a simple pursuit, from random starts."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from symbrion_gym.arenas.arena import Arena
from symbrion_gym.arenas.spec import SURFACE_GROUP
from symbrion_gym.environment.config import SnakePitConfig
from symbrion_gym.errors import ArenaError
from symbrion_gym.robot.organism import Organism

NUM_STARTS = 16
"""Random starts in the region of the goal."""
SPEED = 0.1
"""Speed of the faster track [m/s]: what a Scout has."""
_LOOK_AHEAD = 0.12
"""The pursuit heads for the point of the path this far ahead [m]: about the length of a Scout."""
_NEAR_GOAL = 0.08
"""The goal is reached within this distance in plan [m]."""
_OFF_GROUND = 0.12
"""Higher or lower than this above the nearest ground of its path it is on a ceiling, or through a floor [m]."""
_GAP = 0.005
"""Between tracks and ground at the start [m]."""
_NUM_NEAR = 9
"""Places of the map that tell how the ground slopes at the start."""
_TURN = 0.5
"""Speed of the tracks in a turn on the spot, as a share of the full one: a faster one tips it over on slopes."""
_TICK = 20
"""Physics steps between two commands: 10 Hz."""
_PATIENCE = 3.0
"""It has this many times the time that the path takes at full speed, and the time for a turn."""
_TURN_TIME = 15.0
"""Time for turns on the spot [s]."""


def drive_to_goal(arena: Arena, seed: int = 0, num_starts: int = NUM_STARTS) -> dict[str, Any]:
    """Return how many of the starts reach the goal, and how many leave the ground; `failed` if there is no route."""
    try:
        route = arena.find_route()
    except ArenaError as error:
        return {"route": 0.0, "failed": str(error)}
    found: dict[str, Any] = {"route": 1.0, "route_m": route.length, "start": route.start, "goal": route.goal}
    ground = arena.traversability()
    rng = np.random.default_rng(seed)
    region = np.flatnonzero(ground.region == route.region)
    model = _compile(arena)
    arrived, left, drives = 0, 0, []
    for place in ground.positions[rng.choice(region, num_starts)]:
        try:
            path = arena.find_route(start=place, goal=route.goal).path
        except ArenaError:
            path = place[None]  # the start is the goal's own cell
        near = np.argsort(np.linalg.norm(ground.positions[region] - place, axis=1))[:_NUM_NEAR]
        pose = _stand(ground.positions[region][near], path[0], rng.uniform(-np.pi, np.pi))
        has_arrived, has_left, distance = _drive(model, path, pose)
        arrived, left = arrived + has_arrived, left + has_left
        drives.append({"start": place.tolist(), "arrived": has_arrived, "left": has_left, "short": distance})
    return found | {"starts": num_starts, "arrived": arrived, "left_ground": left, "drives": drives}


def _stand(near: np.ndarray, place: np.ndarray, yaw: float) -> np.ndarray:
    """Return the pose of a Scout that stands on the ground at a place: position and quaternion, `[7]`."""
    normal = np.linalg.svd(near - near.mean(axis=0))[2][2]
    normal *= np.sign(normal[2]) or 1.0
    ahead = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    ahead -= (ahead @ normal) * normal
    ahead /= np.linalg.norm(ahead)
    turn = np.stack([ahead, np.cross(normal, ahead), normal], axis=1)
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, turn.ravel())
    return np.concatenate([place + (Organism(1).scout.size[2] / 2 + _GAP) * normal, quaternion])


def _drive(model: mujoco.MjModel, path: np.ndarray, pose: np.ndarray) -> tuple[bool, bool, float]:
    """Drive along a path; return whether it arrived, whether it left the ground, and how far from the goal it ended."""
    data, tracks = mujoco.MjData(model), _find_tracks(model)
    sides = np.sign(model.geom_pos[tracks, 1])
    radius, half = Organism(1).scout.track_radius, Organism(1).scout.size[2] / 2
    data.qpos[:] = pose
    length = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
    num_ticks = round((_PATIENCE * length / SPEED + _TURN_TIME) / model.opt.timestep / _TICK)
    nearest, distance = 0, np.inf
    for _ in range(num_ticks):
        position = data.qpos[:3] - [0.0, 0.0, half]
        # The path is followed from where it was left, so that the upper of two storeys draws nothing up.
        ahead = path[nearest : nearest + 20]
        nearest += int(np.linalg.norm(ahead - position, axis=1).argmin())
        distance = float(np.linalg.norm(path[-1, :2] - position[:2]))
        if abs(position[2] - path[nearest, 2]) > _OFF_GROUND:
            return False, True, distance
        if distance < _NEAR_GOAL and nearest >= len(path) - 20:
            return True, False, distance
        left, right = _steer(data, _find_target(path, nearest))
        model.geom_surfacevel[tracks, 4] = np.where(sides > 0, left, right) / radius
        mujoco.mj_step(model, data, nstep=_TICK)
    return False, False, distance


def _find_target(path: np.ndarray, nearest: int) -> np.ndarray:
    """Return the point of the path that is `_LOOK_AHEAD` farther on."""
    rest = path[nearest:]
    covered = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(rest[:, :2], axis=0), axis=1))])
    return rest[min(int(np.searchsorted(covered, _LOOK_AHEAD)), len(rest) - 1)]


def _steer(data: mujoco.MjData, target: np.ndarray) -> tuple[float, float]:
    """Return the speeds of the left and right track [m/s]: turn on the spot if the target is far to the side."""
    ahead = np.empty(3)
    mujoco.mju_rotVecQuat(ahead, np.array([1.0, 0.0, 0.0]), data.qpos[3:7])
    wanted = np.arctan2(*(target[:2] - data.qpos[:2])[::-1])
    error = (wanted - np.arctan2(ahead[1], ahead[0]) + np.pi) % (2 * np.pi) - np.pi
    turn = float(np.clip(error, -_TURN, _TURN))
    forward = max(0.0, 1.0 - abs(error) / 0.8)
    left, right = forward - turn, forward + turn
    scale = SPEED / max(1.0, abs(left), abs(right))
    return scale * left, scale * right


def _find_tracks(model: mujoco.MjModel) -> np.ndarray:
    names = [model.geom(geom).name for geom in range(model.ngeom)]
    return np.array([geom for geom, name in enumerate(names) if name.startswith("module_0_track_")])


def _compile(arena: Arena) -> mujoco.MjModel:
    """Compile the arena with one Scout first; the exact surface is left out."""
    spec = arena.spec()
    for geom in [geom for geom in spec.worldbody.geoms if geom.group == SURFACE_GROUP]:
        spec.delete(geom)
    Organism(1).add_to(spec, spec.worldbody)
    spec.option.timestep = SnakePitConfig().timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    return spec.compile()
