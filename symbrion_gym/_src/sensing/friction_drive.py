"""A robot drives lanes over an arena and logs the slip of its tracks; the physics is MuJoCo's, of the arena as it is.

It drives backwards: the module that feels the ground goes first, so that it is on ice while the others still hold.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.geometry.pose import make_quaternion
from reconstruction._src.scans.slip_readings import SlipReadings
from symbrion_gym._src.errors import SurveyError
from symbrion_gym._src.robot.organism import add_sensors, snake
from symbrion_gym._src.robot.scout_constants import ScoutConfig
from symbrion_gym._src.robot.tracks import find_road_wheels
from symbrion_gym._src.sensing.friction_robot import FrictionRobot, SlipSensors, Tick

if TYPE_CHECKING:
    from symbrion_gym._src.arenas.arena import Arena

_TIMESTEP = 0.0025  # [s]
_BELT_LAG = 0.01  # Time in which tracks follow their command [s] (estimate)
_SETTLING = 0.4  # Standing still at the start of a lane [s]
_SAMPLE = 0.01  # Spacing of the heights along a lane [m]
_CLEARANCE = 0.005  # The robot is set down from this height [m]
_FALLEN = 0.15  # A module that is so much below the ground of its lane has fallen [m]
_STEERING = (6.0, 1.5)  # Turning rate per lateral error [1/s per m] and per error of the heading [1/s]
_TRACK_ARM = 0.04  # Half the distance of the tracks [m], for steering
_MOST_TURN = 0.4  # Largest difference of the sides, as a share of the speed
_ADVANCE = 0.02  # What counts as getting somewhere [m]


class Lane(NamedTuple):
    """A straight stretch of ground: where the robot starts, and where it is to arrive (x, y) [m]."""

    start: Float[np.ndarray, " 2"]
    end: Float[np.ndarray, " 2"]


def drive_lanes(
    arena: Arena,
    robot: FrictionRobot,
    rng: np.random.Generator,
    progress: Progress = silent,
    lanes: list[Lane] | None = None,
) -> SlipReadings:
    """Drive every lane in both directions and return what the last module reads.

    Friction is alike in all directions here (an elliptic cone).
    """
    lanes = find_lanes(arena, robot) if lanes is None else lanes
    simulation = _Simulation(arena, robot)
    sensors = SlipSensors(robot.noise, simulation.mass, rng)
    parts = []
    for number, lane in enumerate(lanes):
        progress("feeling the ground", number / len(lanes))
        parts += simulation.drive(lane, number, sensors)
    return sensors.collect(parts)


def find_friction_robot(
    friction: bool | FrictionRobot, arena: object
) -> tuple[FrictionRobot | None, Arena | None]:
    """Return the robot that feels the ground, and the ground; None for both where it is not to be felt."""
    from symbrion_gym._src.arenas.arena import Arena
    from symbrion_gym._src.arenas.making import load_arena
    from symbrion_gym._src.assets import NAMED_ARENAS

    if friction is False:
        return None, None
    robot = FrictionRobot() if friction is True else friction
    if isinstance(arena, str | os.PathLike) and (str(arena) in NAMED_ARENAS or os.path.isdir(arena)):
        arena = load_arena(str(arena))
    if not isinstance(arena, Arena):
        raise SurveyError(
            "friction is felt on an Arena, a named arena or its folder; a mesh has none: make_arena(mesh, friction=...)"
        )
    return robot, arena


def find_lanes(arena: Arena, robot: FrictionRobot) -> list[Lane]:
    """Return the stretches without steps along the longer side of an arena, in both directions."""
    low, high = np.asarray(arena.surface.bounds, dtype=np.float64)[:, :2]
    along = int(np.argmax(high - low))
    length, width = (high - low)[along], (high - low)[1 - along]
    count = max(1, int((width - 2 * robot.margin) / robot.spacing) + 1)
    across = (low + high)[1 - along] / 2 + robot.spacing * (np.arange(count) - (count - 1) / 2)
    steps = np.arange(low[along] + _SAMPLE / 2, low[along] + length, _SAMPLE)
    lanes = []
    for offset in across:
        places = np.full((len(steps), 2), offset)
        places[:, along] = steps
        heights = arena.height(*places.T)
        is_step = ~(np.abs(np.diff(heights)) <= robot.highest_step)
        for part in np.split(np.arange(len(steps)), np.flatnonzero(is_step) + 1):
            ends = places[part[[0, -1]]]
            if np.isfinite(heights[part]).all() and len(part) * _SAMPLE >= robot.least_run:
                lanes += _shorten(ends, robot.margin)
    return lanes


def _shorten(ends: Float[np.ndarray, "2 2"], margin: float) -> list[Lane]:
    ahead = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    near, far = ends[0] + margin * ahead, ends[1] - margin * ahead
    return [Lane(near, far), Lane(far, near)]


class _Simulation:
    """A snake in an arena."""

    def __init__(self, arena: Arena, robot: FrictionRobot) -> None:
        self.arena, self.robot = arena, robot
        scout = ScoutConfig(track_speed=robot.speed, friction=arena.friction)
        organism, spec = snake(robot.modules, scout), arena.spec()
        organism.add_to(spec, spec.worldbody)
        add_sensors(spec, organism, ("acceleration", "dock_force"), 0.0)
        option = spec.option
        option.timestep, option.integrator = _TIMESTEP, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        option.cone, option.jacobian = mujoco.mjtCone.mjCONE_ELLIPTIC, mujoco.mjtJacobian.mjJAC_DENSE
        self.model = model = spec.compile()
        self.data = mujoco.MjData(model)
        self.body_length = (robot.modules - 1) * scout.pitch
        last = robot.modules - 1
        self._radius, self._height = scout.track_radius, scout.size[2] / 2
        wheels = range(len(find_road_wheels(scout)))
        self._tracks = np.array(
            [[model.geom(f"module_{i}_track_{k}").id for k in wheels] for i in range(last + 1)]
        )
        self._site = model.site(f"module_{last}").id
        self.mass = float(model.body_mass[model.site_bodyid[self._site]])
        names = (f"module_{last}_accel_front", f"module_{last}_accel_rear", f"dock_force_{last}")
        self._addresses = [int(model.sensor(name).adr[0]) for name in names]

    def drive(self, lane: Lane, run: int, sensors: SlipSensors) -> list[Tick]:
        """Drive a lane until its end, a fall, or no more progress; return the readings of every tick."""
        direction = (lane.end - lane.start) / np.linalg.norm(lane.end - lane.start)
        self._lay_down(lane.start, direction)
        course = np.arctan2(*direction[::-1])
        left = np.array([-direction[1], direction[0]])
        length = float((lane.end - lane.start) @ direction) - self._height
        ticks, farthest, since, time = [], 0.0, 0.0, 0.0
        turn = 0.0
        sensors.begin()
        while time - since < self.robot.patience and farthest < length:
            offset = self.robot.find_offset(time)
            specific, pull = self._advance(offset, turn)
            time += self.robot.tick
            tick = sensors.read(self._find_tick(time, run, offset, specific, pull))
            ticks.append(tick)
            away = tick.position[:2] - lane.start
            bend = float(np.sin(tick.heading + np.pi - course))
            turn = -_STEERING[0] * float(away @ left) - _STEERING[1] * bend
            if away @ direction > farthest + _ADVANCE:
                farthest, since = float(away @ direction), time
            if self._has_fallen():
                break
        return ticks

    def _lay_down(self, place: Float[np.ndarray, " 2"], direction: Float[np.ndarray, " 2"]) -> None:
        """Set the robot on the ground at rest, its head at a place, its last module ahead: it drives backwards."""
        mujoco.mj_resetData(self.model, self.data)
        ends = np.array([place + self.body_length * direction, place])
        heights = self.arena.height(*ends.T)
        yaw, pitch = np.arctan2(*-direction[::-1]), np.arctan2(heights[0] - heights[1], self.body_length)
        self.data.qpos[:3] = [*place, max(heights) + self._height + _CLEARANCE]
        self.data.qpos[3:7] = make_quaternion(yaw, pitch)
        for _ in range(round(_SETTLING / self.robot.tick)):
            self._advance(0.0, 0.0, speed=0.0)

    def _advance(
        self, offset: float, turn: float, speed: float | None = None
    ) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
        """Simulate a tick; return the mean readings of accelerometers [m/s²] and dock [N]."""
        speed = -self.robot.speed if speed is None else speed
        limit = _MOST_TURN * abs(speed)
        side = float(np.clip(turn * _TRACK_ARM, -limit, limit))
        wanted = np.full(self._tracks.shape, speed)
        half = self._tracks.shape[1] // 2
        wanted[:-1, :half] -= side
        wanted[:-1, half:] += side
        wanted[-1] += offset
        total, count = np.zeros(6), round(self.robot.tick / _TIMESTEP)
        velocity = self.model.geom_surfacevel
        for _ in range(count):
            now = velocity[self._tracks, 4] * self._radius
            velocity[self._tracks, 4] = (now + (wanted - now) * _TIMESTEP / _BELT_LAG) / self._radius
            mujoco.mj_step(self.model, self.data)
            front, rear, dock = (self.data.sensordata[a : a + 3] for a in self._addresses)
            total += np.concatenate([(front + rear) / 2, dock])
        return total[:3] / count, total[3:] / count

    def _find_tick(
        self,
        time: float,
        run: int,
        offset: float,
        specific: Float[np.ndarray, " 3"],
        pull: Float[np.ndarray, " 3"],
    ) -> Tick:
        ahead = self.data.site_xmat[self._site].reshape(3, 3)[:, 0]
        return Tick(
            time,
            run,
            self.data.site_xpos[self._site].copy(),
            float(np.arctan2(ahead[1], ahead[0])),
            float(np.arcsin(np.clip(ahead[2], -1.0, 1.0))),
            offset - self.robot.speed,
            specific,
            pull,
        )

    def _has_fallen(self) -> bool:
        x, y, z = self.data.site_xpos[self._site]
        return not z > float(self.arena.height(x, y)) - _FALLEN + self._height
