"""A sled and a wheel drawn along and across an arena, to and fro, over the seams between its pieces."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from scipy.ndimage import minimum_filter1d

from reconstruction.geometry.elevation import Elevation
from symbrion_gym.arenas.arena import Arena
from symbrion_gym.arenas.course import Course

SPEED = 0.3
_LANES = (-0.7, -0.45, -0.2, 0.05, 0.3, 0.55, 0.8)
"""y of the ways along the course [m]."""
_CROSSINGS = (-2.3, -0.45, 0.0, 0.45, 2.3)
"""x of the ways across it [m]: floors, plateaus and the bottom of the pit."""
_REACH, _SIDE = 3.0, 0.9
"""Ways end here along the course, and across it [m]."""
_WALL = 0.05
"""Ways keep this far from the walls of the pit [m]: at an edge bodies tip over, at a wall they stop."""
_HALF_SIZE = 0.04
_HEIGHTS = {"sled": 0.01, "wheel": _HALF_SIZE}
"""Middle of a body above the ground it rests on [m]."""
_SPACING = 0.001
_RUN_UP = 0.04
"""Nothing is compared before this far from the start, where bodies gather speed [m]."""
_NEARBY = 0.02
"""The truth's pace is the slowest so far before and behind: a crease may lie a little elsewhere [m]."""
_SMOOTH = 0.05
"""Speeds are means over this time [s]: 15 mm of way."""
_TIMESTEP = 0.002
_SETTLING = 100
"""Steps at rest before a body is drawn."""


class Way(NamedTuple):
    """A straight way in plan.

    Attributes:
        axis: 0 along the course, 1 across it.
        start: where it starts on that axis [m].
        end: where it ends [m].
        beside: the other coordinate [m].
    """

    axis: int
    start: float
    end: float
    beside: float


class Drawn(NamedTuple):
    """What a body did on its way, at evenly spaced places.

    Attributes:
        place: `[N]` coordinate along the way [m].
        height: `[N]` [m].
        pace: `[N]` speed over the wanted speed.
    """

    place: np.ndarray
    height: np.ndarray
    pace: np.ndarray


def find_ways(course: Course) -> list[Way]:
    """Ways to and fro: each lane before the pit, on its bottom and behind it; and across the level parts."""
    edge = course.pit / 2
    parts = ((-_REACH, -edge - _WALL), (-edge + _WALL, edge - _WALL), (edge + _WALL, _REACH))
    ways = [Way(0, start, end, y) for start, end in parts for y in _LANES]
    ways += [Way(1, -_SIDE, _SIDE, x) for x in _CROSSINGS]
    return ways + [way._replace(start=way.end, end=way.start) for way in ways]


def compare_drawn(truth: Arena, course: Course, arenas: dict[str, Arena]) -> dict[str, dict[str, dict]]:
    """Vertical kicks [mm] and losses of speed of a sled and a wheel against the truth, the worst of all ways.

    A kick is how much higher a body is than in the truth at the same place: what the surface itself is too high
    counts as well. A loss is how much slower it is than in the truth within 2 cm, as a share of the wanted speed.
    Both are given with the place where they are, and the share of ways with a kick above 2 mm or a loss above 5 %.
    Left out are 5 cm on either side of the pit's walls and the first 4 cm of each way; what is beyond the pit
    starts anew behind it.
    """
    ways = find_ways(course)
    reach = 2 * round(_NEARBY / _SPACING) + 1
    found: dict[str, dict[str, dict]] = {}
    for body in ("sled", "wheel"):
        exact = draw(truth, body, ways)
        found[body] = {}
        for name, arena in arenas.items():
            kicks, losses, places = [], [], []
            for way, wanted, drawn in zip(ways, exact, draw(arena, body, ways), strict=True):
                kicks.append(1e3 * (drawn.height - wanted.height))
                losses.append(minimum_filter1d(wanted.pace, reach) - drawn.pace)
                places += [_name_place(way, place) for place in drawn.place]
            is_off = [kick.max() > 2.0 or loss.max() > 0.05 for kick, loss in zip(kicks, losses, strict=True)]
            row: dict = {"ways": len(ways), "ways_off": int(sum(is_off))}
            for key, at, values in (("kick_mm", "kick_at", kicks), ("speed_loss", "loss_at", losses)):
                worst = np.concatenate(values)
                row[key], row[at] = float(worst.max()), places[worst.argmax()]
            found[body][name] = row
    return found


def draw(arena: Arena, body: str, ways: list[Way]) -> list[Drawn]:
    """Draw a body along ways at constant speed by a spring: a "sled" that slides, or a "wheel" that rolls."""
    # Bodies are set down on what they touch.
    ground = Elevation(*arena.pieces)
    models = [_compile(arena, body, axis) for axis in (0, 1)]
    return [_draw(models[way.axis], ground, body, way) for way in ways]


def _draw(model: mujoco.MjModel, ground: Elevation, body: str, way: Way) -> Drawn:
    start = _find_start(ground, body, way)
    model.body(body).pos = start
    data = mujoco.MjData(model)
    length, sign = abs(way.end - way.start), np.sign(way.end - way.start)
    trace = []
    for step in range(-_SETTLING, round(length / SPEED / _TIMESTEP)):
        target, speed = sign * SPEED * max(step, 0) * _TIMESTEP, sign * SPEED * (step >= 0)
        data.qfrc_applied[0] = 300.0 * (target - data.qpos[0]) + 30.0 * (speed - data.qvel[0])
        mujoco.mj_step(model, data)
        trace.append((sign * data.qpos[0], start[2] + data.qpos[1], sign * data.qvel[0] / SPEED))
    covered, height, pace = np.array(trace).T
    window = round(_SMOOTH / _TIMESTEP)
    smooth = np.convolve(pace, np.ones(window) / window, mode="same")
    is_drawn = slice(_SETTLING, -window // 2)
    covered, height, smooth = covered[is_drawn], height[is_drawn], smooth[is_drawn]
    order = np.argsort(covered, kind="stable")
    grid = np.arange(_RUN_UP, length - SPEED * _SMOOTH, _SPACING)
    drawn = (np.interp(grid, covered[order], values[order]) for values in (height, smooth))
    return Drawn(way.start + sign * grid, *drawn)


def _find_start(ground: Elevation, body: str, way: Way) -> np.ndarray:
    """Where a body rests at the start of a way, `[3]` [m]."""
    position = np.array([way.start, way.beside] if way.axis == 0 else [way.beside, way.start])
    side = np.linspace(-_HALF_SIZE, _HALF_SIZE, 9)
    footprint = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2) + position
    return np.append(position, np.nanmax(ground.height(*footprint.T)) + _HEIGHTS[body])


def _compile(arena: Arena, body: str, axis: int) -> mujoco.MjModel:
    """The arena with a body that is free to go along an axis, up and over."""
    ahead = np.eye(3)[axis]
    spec = arena.spec()
    moved = spec.worldbody.add_body(name=body)
    for direction in (ahead, [0, 0, 1]):
        moved.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=direction)
    moved.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=np.cross([0, 0, 1], ahead))
    shape = moved.add_geom(mass=0.5)
    if body == "sled":
        shape.type, shape.size = mujoco.mjtGeom.mjGEOM_BOX, [_HALF_SIZE, _HALF_SIZE, _HEIGHTS[body]]
        shape.friction = [0.2, 0.005, 0.0001]
    else:
        shape.type, shape.size = mujoco.mjtGeom.mjGEOM_ELLIPSOID, [_HALF_SIZE] * 3
        shape.size[1 - axis] = _HALF_SIZE / 2
    spec.option.timestep = _TIMESTEP
    return spec.compile()


def _name_place(way: Way, place: float) -> list[float]:
    """x and y, in millimetres' precision."""
    both = [float(place), way.beside]
    return [round(value, 3) for value in (both if way.axis == 0 else both[::-1])]
