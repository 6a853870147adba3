"""A sled and a wheel pulled along and across an arena, in both directions, over the seams between its pieces."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from scipy.ndimage import minimum_filter1d

from reconstruction._src.geometry.elevation import Elevation
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course

SPEED = 0.3
_LANES = (-0.7, -0.45, -0.2, 0.05, 0.3, 0.55, 0.8)
"""y of the lines along the course [m]."""
_CROSSINGS = (-2.3, -0.45, 0.0, 0.45, 2.3)
"""x of the lines across it [m]: floors, plateaus and the bottom of the pit."""
_REACH, _SIDE = 3.0, 0.9
"""Lines end here along the course, and across it [m]."""
_WALL = 0.05
"""Distance of the lines from the walls of the pit [m]: at an edge bodies tip over, at a wall they stop."""
_HALF_SIZE = 0.04
_HEIGHTS = {"sled": 0.01, "wheel": _HALF_SIZE}
"""Height of the center of a body above the ground [m]."""
_SPACING = 0.001
_RUN_UP = 0.04
"""Length at the start of a line that is ignored, where bodies accelerate [m]."""
_NEARBY = 0.02
"""The true arena's pace is the minimum within this distance: a crease may be at a slightly different place [m]."""
_SMOOTH = 0.05
"""Speeds are averaged over this time [s], which is 15 mm."""
_TIMESTEP = 0.002
_SETTLING = 100
"""Steps at rest before a body is pulled."""


class Line(NamedTuple):
    """A straight horizontal line.

    Attributes:
        axis: 0 along the course, 1 across it.
        start: its start on that axis [m].
        end: its end on that axis [m].
        offset: the other coordinate [m].
    """

    axis: int
    start: float
    end: float
    offset: float


class Motion(NamedTuple):
    """The motion of a body along its line, at evenly spaced places.

    Attributes:
        place: `[N]` coordinate along the line [m].
        height: `[N]` [m].
        pace: `[N]` actual over commanded speed.
    """

    place: np.ndarray
    height: np.ndarray
    pace: np.ndarray


def find_lines(course: Course) -> list[Line]:
    """Return lines in both directions: along each lane before, in and behind the pit, and across the level parts."""
    edge = course.pit / 2
    parts = ((-_REACH, -edge - _WALL), (-edge + _WALL, edge - _WALL), (edge + _WALL, _REACH))
    lines = [Line(0, start, end, y) for start, end in parts for y in _LANES]
    lines += [Line(1, -_SIDE, _SIDE, x) for x in _CROSSINGS]
    return lines + [line._replace(start=line.end, end=line.start) for line in lines]


def compare_pulled(truth: Arena, course: Course, arenas: dict[str, Arena]) -> dict[str, dict[str, dict]]:
    """Measure jumps [mm] and losses of speed of a sled and a wheel relative to the true arena, worst of all lines.

    A jump is how much higher a body is than at the same place in the true arena, including errors of the surface
    itself. A loss is how much slower it is than in the true arena within 2 cm, as a share of the commanded speed. Both
    are returned with their place, together with the number of lines with a jump above 2 mm or a loss above 5 %.
    5 cm on either side of the pit's walls and the first 4 cm of each line are left out; behind the pit a new line
    begins.
    """
    lines = find_lines(course)
    reach = 2 * round(_NEARBY / _SPACING) + 1
    found: dict[str, dict[str, dict]] = {}
    for body in ("sled", "wheel"):
        exact = pull(truth, body, lines)
        found[body] = {}
        for name, arena in arenas.items():
            kicks, losses, places = [], [], []
            for line, wanted, motion in zip(lines, exact, pull(arena, body, lines), strict=True):
                kicks.append(1e3 * (motion.height - wanted.height))
                losses.append(minimum_filter1d(wanted.pace, reach) - motion.pace)
                places += [_name_place(line, place) for place in motion.place]
            is_off = [kick.max() > 2.0 or loss.max() > 0.05 for kick, loss in zip(kicks, losses, strict=True)]
            row: dict = {"ways": len(lines), "ways_off": int(sum(is_off))}
            for key, at, values in (("kick_mm", "kick_at", kicks), ("speed_loss", "loss_at", losses)):
                worst = np.concatenate(values)
                row[key], row[at] = float(worst.max()), places[worst.argmax()]
            found[body][name] = row
    return found


def pull(arena: Arena, body: str, lines: list[Line]) -> list[Motion]:
    """Pull a body along lines at constant speed by a spring: a "sled" that slides, or a "wheel" that rolls."""
    # Bodies start on the contact geometry.
    ground = Elevation(*arena.pieces)
    models = [_compile(arena, body, axis) for axis in (0, 1)]
    return [_pull(models[line.axis], ground, body, line) for line in lines]


def _pull(model: mujoco.MjModel, ground: Elevation, body: str, line: Line) -> Motion:
    start = _find_start(ground, body, line)
    model.body(body).pos = start
    data = mujoco.MjData(model)
    length, sign = abs(line.end - line.start), np.sign(line.end - line.start)
    trace = []
    for step in range(-_SETTLING, round(length / SPEED / _TIMESTEP)):
        target, speed = sign * SPEED * max(step, 0) * _TIMESTEP, sign * SPEED * (step >= 0)
        data.qfrc_applied[0] = 300.0 * (target - data.qpos[0]) + 30.0 * (speed - data.qvel[0])
        mujoco.mj_step(model, data)
        trace.append((sign * data.qpos[0], start[2] + data.qpos[1], sign * data.qvel[0] / SPEED))
    covered, height, pace = np.array(trace).T
    window = round(_SMOOTH / _TIMESTEP)
    smooth = np.convolve(pace, np.ones(window) / window, mode="same")
    is_pulled = slice(_SETTLING, -window // 2)
    covered, height, smooth = covered[is_pulled], height[is_pulled], smooth[is_pulled]
    order = np.argsort(covered, kind="stable")
    grid = np.arange(_RUN_UP, length - SPEED * _SMOOTH, _SPACING)
    motion = (np.interp(grid, covered[order], values[order]) for values in (height, smooth))
    return Motion(line.start + sign * grid, *motion)


def _find_start(ground: Elevation, body: str, line: Line) -> np.ndarray:
    """Return where a body rests at the start of a line, `[3]` [m]."""
    position = np.array([line.start, line.offset] if line.axis == 0 else [line.offset, line.start])
    side = np.linspace(-_HALF_SIZE, _HALF_SIZE, 9)
    footprint = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2) + position
    return np.append(position, np.nanmax(ground.height(*footprint.T)) + _HEIGHTS[body])


def _compile(arena: Arena, body: str, axis: int) -> mujoco.MjModel:
    """Compile the arena with a body that can move along an axis, move vertically, and tip over."""
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


def _name_place(line: Line, place: float) -> list[float]:
    """Return x and y, rounded to millimeters."""
    both = [float(place), line.offset]
    return [round(value, 3) for value in (both if line.axis == 0 else both[::-1])]
