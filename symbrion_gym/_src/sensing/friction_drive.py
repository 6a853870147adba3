"""Docked Scouts drive lanes over an arena and log the slip of their tracks; the physics is MuJoCo's.

They drive backwards: the last module feels the ground, dragging its tracks in turn to either side. It goes first, so
that it is on ice while the others still hold.
"""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.geometry.pose import make_quaternion
from reconstruction._src.scans.slip_readings import SlipReadings
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.robot.organism import add_sensors, snake
from symbrion_gym._src.robot.scout import find_road_wheels, set_physics
from symbrion_gym._src.robot.scout_constants import ScoutConfig

_MODULES = 3  # Length of the snake; two pull, so that one that drags does not stop them on level ground
_SPEED = 0.12  # Of the tracks [m/s] (estimates of the Scout's: 0.06 to 0.15)
_DRAG_SPEED = 0.24
"""How much slower, and in turn faster, the tracks of the last module run in a drag [m/s]: tracks hold with all that
friction gives from a slip of some 0.1 m/s."""
_CRUISE, _DRAG = 0.5, 0.5  # Time from one drag to the next, and length of a drag [s]
_SOFT = (60.0, 3.0)
"""Gains of the servos of the hinges [N m/rad, N m s/rad]: with stiffer ones the last module is not borne by its own
tracks where the ground bends, and is felt to have another friction there."""
_SPACING = 0.4  # Distance of the lanes, along the longer side of the arena [m]
_MARGIN = 0.15  # Of the lanes from the rim, and of their ends from steps [m]
_HIGHEST_STEP = 0.01  # A lane ends where the ground changes by more within a centimeter [m]
_LEAST_RUN = 0.8  # Stretches of a lane that are shorter are left out [m]
_PATIENCE = 12.0  # A drive that gets nowhere for this long ends [s]
_TICK = 0.02  # From one reading to the next [s]
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

# Errors of the sensors, as standard deviations; estimates, none was measured on the robot:
_FORCE_NOISE, _FORCE_BIAS = 0.25, 0.1  # Of the force in the dock, a tick, and along each axis a survey [N]
_FORCE_GAIN = 0.01  # Its relative error, drawn once a survey: a strain gauge calibrated with weights
_MASS_ERROR = 0.005  # Relative, of the mass that the robot is told, drawn once a survey
_ACCELERATION_NOISE, _ACCELERATION_BIAS = 0.15, 0.1  # Of the accelerometers, a tick, and a survey [m/s²]
_POSITION_NOISE, _DRIFT = 0.003, 0.005  # Of the localization, a tick, and slow [m]
_DRIFT_TIME = 10.0  # How long a slow error of the localization lasts [s]
_ANGLE_NOISE = float(np.radians(0.3))  # Of heading and pitch [rad]


class Lane(NamedTuple):
    """A straight stretch of ground: where the robot starts, and where it is to arrive (x, y) [m]."""

    start: Float[np.ndarray, " 2"]
    end: Float[np.ndarray, " 2"]


def drive_lanes(arena: Arena, rng: np.random.Generator, progress: Progress = silent) -> SlipReadings:
    """Drive every lane in both directions and return what the last module reads.

    Friction is alike in all directions here (an elliptic cone).
    """
    lanes, simulation = find_lanes(arena), _Simulation(arena)
    sensors, parts = SlipSensors(simulation.mass, rng), []
    for number, lane in enumerate(lanes):
        progress("feeling the ground", number / len(lanes))
        parts += simulation.drive(lane, number, sensors)
    return sensors.collect(parts)


def find_lanes(arena: Arena) -> list[Lane]:
    """Return the stretches without steps along the longer side of an arena, in both directions."""
    low, high = np.asarray(arena.surface.bounds, dtype=np.float64)[:, :2]
    along = int(np.argmax(high - low))
    length, width = (high - low)[along], (high - low)[1 - along]
    count = max(1, int((width - 2 * _MARGIN) / _SPACING) + 1)
    across = (low + high)[1 - along] / 2 + _SPACING * (np.arange(count) - (count - 1) / 2)
    steps = np.arange(low[along] + _SAMPLE / 2, low[along] + length, _SAMPLE)
    lanes = []
    for offset in across:
        places = np.full((len(steps), 2), offset)
        places[:, along] = steps
        heights = arena.height(*places.T)
        is_step = ~(np.abs(np.diff(heights)) <= _HIGHEST_STEP)
        for part in np.split(np.arange(len(steps)), np.flatnonzero(is_step) + 1):
            ends = places[part[[0, -1]]]
            if np.isfinite(heights[part]).all() and len(part) * _SAMPLE >= _LEAST_RUN:
                ahead = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
                near, far = ends[0] + _MARGIN * ahead, ends[1] - _MARGIN * ahead
                lanes += [Lane(near, far), Lane(far, near)]
    return lanes


class Tick(NamedTuple):
    """One row of `SlipReadings`, exact or as read."""

    time: float
    run: int
    position: Float[np.ndarray, " 3"]
    heading: float
    pitch: float
    commanded: float
    acceleration: Float[np.ndarray, " 3"]
    force: Float[np.ndarray, " 3"]


class SlipSensors:
    """The sensors of one survey, at a module whose true mass is given [kg]."""

    def __init__(self, mass: float, rng: np.random.Generator) -> None:
        self._rng = rng
        self._gain = 1.0 + _FORCE_GAIN * rng.standard_normal()
        self._mass = mass * (1.0 + _MASS_ERROR * rng.standard_normal())
        self._force_bias = _FORCE_BIAS * rng.standard_normal(3)
        self._acceleration_bias = _ACCELERATION_BIAS * rng.standard_normal(3)
        self._drift, self._last = np.zeros(3), 0.0

    def begin(self) -> None:
        """Begin a run: the localization begins with an error of its own."""
        self._drift, self._last = _DRIFT * self._rng.standard_normal(3), 0.0

    def read(self, exact: Tick) -> Tick:
        """Return a tick as it is read."""
        draw = self._rng.standard_normal
        memory = float(np.exp(-(exact.time - self._last) / _DRIFT_TIME))
        self._drift = memory * self._drift + _DRIFT * np.sqrt(1 - memory**2) * draw(3)
        self._last = exact.time
        return exact._replace(
            position=exact.position + self._drift + _POSITION_NOISE * draw(3),
            heading=exact.heading + _ANGLE_NOISE * draw(),
            pitch=exact.pitch + _ANGLE_NOISE * draw(),
            acceleration=exact.acceleration + self._acceleration_bias + _ACCELERATION_NOISE * draw(3),
            force=self._gain * exact.force + self._force_bias + _FORCE_NOISE * draw(3),
        )

    def collect(self, ticks: Sequence[Tick]) -> SlipReadings:
        """Return the ticks of all runs."""
        columns = zip(*ticks, strict=True) if ticks else [()] * len(Tick._fields)
        table = dict(zip(Tick._fields, map(np.array, columns), strict=True))
        vectors = {name: table[name].reshape(-1, 3) for name in ("position", "acceleration", "force")}
        return SlipReadings(*(table | vectors).values(), mass=self._mass)


def _find_offset(time: float) -> float:
    """Return how much faster the tracks of the last module run than the others, at a time [m/s]."""
    number, phase = divmod(time, _CRUISE + _DRAG)
    if phase < _CRUISE:
        return 0.0
    return _DRAG_SPEED * (-1.0 if int(number) % 2 == 0 else 1.0)


class _Simulation:
    """A snake in an arena."""

    def __init__(self, arena: Arena) -> None:
        self.arena = arena
        soft = dict(zip(("hinge_stiffness", "hinge_derivative"), _SOFT, strict=True))
        scout = ScoutConfig(track_speed=_SPEED, friction=arena.friction, **soft)
        organism, spec = snake(_MODULES, scout), arena.spec()
        organism.add_to(spec, spec.worldbody)
        add_sensors(spec, organism, ("acceleration", "dock_force"), 0.0)
        set_physics(spec.option, _TIMESTEP, _MODULES)
        self.model = model = spec.compile()
        self.data = mujoco.MjData(model)
        last = _MODULES - 1
        self.body_length = last * scout.pitch
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
        while time - since < _PATIENCE and farthest < length:
            offset = _find_offset(time)
            specific, pull = self._advance(-_SPEED, offset, turn)
            time += _TICK
            position = self.data.site_xpos[self._site].copy()
            ahead = self.data.site_xmat[self._site].reshape(3, 3)[:, 0]
            heading, pitch = float(np.arctan2(*ahead[1::-1])), float(np.arcsin(np.clip(ahead[2], -1.0, 1.0)))
            exact = Tick(time, run, position, heading, pitch, offset - _SPEED, specific, pull)
            tick = sensors.read(exact)
            ticks.append(tick)
            away = tick.position[:2] - lane.start
            bend = float(np.sin(tick.heading + np.pi - course))
            turn = -_STEERING[0] * float(away @ left) - _STEERING[1] * bend
            if away @ direction > farthest + _ADVANCE:
                farthest, since = float(away @ direction), time
            ground = float(self.arena.height(*position[:2]))
            if not position[2] > ground - _FALLEN + self._height:
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
        for _ in range(round(_SETTLING / _TICK)):
            self._advance(0.0, 0.0, 0.0)

    def _advance(
        self, speed: float, offset: float, turn: float
    ) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
        """Simulate a tick; return the mean readings of accelerometers [m/s²] and dock [N]."""
        limit = _MOST_TURN * abs(speed)
        side = float(np.clip(turn * _TRACK_ARM, -limit, limit))
        wanted = np.full(self._tracks.shape, speed)
        half = self._tracks.shape[1] // 2
        wanted[:-1, :half] -= side
        wanted[:-1, half:] += side
        wanted[-1] += offset
        total, count = np.zeros(6), round(_TICK / _TIMESTEP)
        velocity = self.model.geom_surfacevel
        for _ in range(count):
            now = velocity[self._tracks, 4] * self._radius
            velocity[self._tracks, 4] = (now + (wanted - now) * _TIMESTEP / _BELT_LAG) / self._radius
            mujoco.mj_step(self.model, self.data)
            front, rear, dock = (self.data.sensordata[a : a + 3] for a in self._addresses)
            total += np.concatenate([(front + rear) / 2, dock])
        return total[:3] / count, total[3:] / count
