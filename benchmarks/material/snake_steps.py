"""The time of a physics step of a snake that is dropped on contact geometry, side by side with one on boxes."""

from __future__ import annotations

import statistics
import time
from typing import NamedTuple

import mujoco
import numpy as np
import trimesh

from benchmarks.material.contact_judge import cast, sample
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.arenas.spec import SURFACE_GROUP
from symbrion_gym._src.environment.config import SnakePitConfig
from symbrion_gym._src.robot.organism import snake

MODULES = 8
NUM_SPOTS = 3
"""Places where the snake is dropped."""
_SETTLE = 1.0
"""Time to fall and to come to rest [s]."""
_DRIVE = 1.0
"""Time that is measured, under waves [s]."""
_HALF_LENGTH = 0.55
"""Half the length of the snake [m]."""
_ROOM = 0.5
"""Clearance that is wanted above a spot [m]."""
_STEEP = 0.3
"""Ground below the snake that rises by more than this is avoided where there is other ground [m]."""
_GAP = 0.02
"""The snake falls from this height above the highest contact below it [m]."""


class Spot(NamedTuple):
    """Where the middle of the snake is dropped.

    Attributes:
        position: of the highest contact below the snake, above the spot's x and y [m].
        yaw: heading [rad].
    """

    position: np.ndarray
    yaw: float


class Lane:
    """A snake at one place of an arena, ready to be stepped."""

    def __init__(self, model: mujoco.MjModel, spot: Spot) -> None:
        """Drop the snake and let it settle."""
        self.model, self.data, self.tick = model, mujoco.MjData(model), 0
        organism = snake(MODULES)
        middle = np.mean([pose.position for pose in organism.find_poses()], axis=0)
        turn = np.array([[np.cos(spot.yaw), -np.sin(spot.yaw)], [np.sin(spot.yaw), np.cos(spot.yaw)]])
        start = model.jnt_qposadr[model.joint("root").id]
        self.data.qpos[start : start + 2] = spot.position[:2] - turn @ np.asarray(middle)[:2]
        self.data.qpos[start + 2] = spot.position[2] + _GAP + organism.scout.size[2] / 2
        self.data.qpos[start + 3 : start + 7] = [np.cos(spot.yaw / 2), 0, 0, np.sin(spot.yaw / 2)]
        self.step(round(_SETTLE / model.opt.timestep))

    def step(self, count: int) -> float:
        """Step under waves; return the processor time of a step [µs]."""
        begin = time.thread_time()
        for _ in range(count // 4):
            self.data.ctrl[: MODULES - 1] = 0.2 * np.sin(0.04 * self.tick + np.arange(MODULES - 1))
            mujoco.mj_step(self.model, self.data, nstep=4)
            self.tick += 1
        return 1e6 * (time.thread_time() - begin) / (4 * (count // 4))


def find_spots(arena: Arena, below: float = np.inf, count: int = NUM_SPOTS, seed: int = 0) -> list[Spot]:
    """Return places with contact below the whole snake and room above it; the best there are where none has both."""
    ground = arena.height_field.as_mesh() if arena.height_field else _join(arena)
    places = sample(arena.surface, 1000, seed)
    places = places[places[:, 2] < below][:300]
    yaws = np.random.default_rng(seed).uniform(0, 2 * np.pi, len(places))
    reach = np.linspace(-_HALF_LENGTH, _HALF_LENGTH, 9)[:, None]
    ahead = np.stack([np.cos(yaws), np.sin(yaws), np.zeros(len(yaws))], axis=1)
    lines = places[:, None] + reach * ahead[:, None] + np.array([0.0, 0.0, _ROOM])
    starts = lines.reshape(-1, 3)
    down = cast(ground, starts, np.tile([0.0, 0.0, -1.0], (len(starts), 1))).reshape(lines.shape[:2])
    is_there = down < 2 * _ROOM
    top = np.where(is_there, down, 2 * _ROOM).min(axis=1)
    is_steep = np.where(is_there, down, 0.0).max(axis=1) - top > _STEEP
    order = np.argsort((~is_there).sum(axis=1) + is_steep, kind="stable")[:count]
    tops = np.where(is_there.any(axis=1), places[:, 2] + _ROOM - top, places[:, 2])
    return [Spot(np.array([*places[i, :2], tops[i]]), float(yaws[i])) for i in order]


def compare_steps(
    arenas: dict[str, Arena], below: float = np.inf, rounds: int = 5
) -> dict[str, dict[str, float]]:
    """Return the median time of a step on each arena [µs], over spots and rounds, and relative to boxes.

    Args:
        arenas: to be compared.
        below: the snake is dropped on ground lower than this, the scanner's height say, so on no ceiling [m].
        rounds: how often each is timed.
    """
    boxes = Arena.from_course(Course())
    all_arenas = {"boxes": boxes, **arenas}
    lanes: dict[str, list[Lane]] = {}
    for name, arena in all_arenas.items():
        model = _compile(arena)
        lanes[name] = [Lane(model, spot) for spot in find_spots(arena, np.inf if name == "boxes" else below)]
    laps: dict[str, list[float]] = {name: [] for name in lanes}
    count = round(_DRIVE / rounds / SnakePitConfig().timestep)
    for _ in range(rounds):
        for spot in range(NUM_SPOTS):
            for name, ready in lanes.items():
                laps[name].append(ready[spot].step(count))
    medians = {name: statistics.median(times) for name, times in laps.items()}
    return {
        name: {"step_us": value, "step_over_boxes": value / medians["boxes"]}
        for name, value in medians.items()
    }


def _compile(arena: Arena) -> mujoco.MjModel:
    """Compile the arena with a snake in it, with the solver of the environments; the exact surface is left out."""
    spec = arena.spec()
    for geom in [geom for geom in spec.worldbody.geoms if geom.group == SURFACE_GROUP]:
        spec.delete(geom)
    snake(MODULES).add_to(spec, spec.worldbody)
    spec.option.timestep = SnakePitConfig().timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    return spec.compile()


def _join(arena: Arena) -> trimesh.Trimesh:
    joined = trimesh.util.concatenate([piece.convex_hull for piece in arena.pieces])
    assert isinstance(joined, trimesh.Trimesh)
    return joined
