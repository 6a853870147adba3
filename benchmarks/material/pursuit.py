"""A tracked robot that follows a route by pure pursuit (Coulter 1992), and what it is compared with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from benchmarks.material.tracked_robot import TrackedRobot
from symbrion_gym._src.traversability.drivable import TraversabilityMap
from symbrion_gym._src.traversability.routes import DrivingRoute

Driver = Callable[[Float[np.ndarray, " 3"], float, np.random.Generator], tuple[float, float]]
"""From the middle of the robot [m], its heading [rad] and a generator to the speeds of its left and right tracks
[m/s]."""


@dataclass(frozen=True)
class PursuitConfig:
    """How a robot follows a route, and when it has arrived.

    Attributes:
        speed: of the tracks at most [m/s].
        look_ahead: the robot drives towards the point of the path this far ahead of its front [m].
        turn_gain: turning speed of the tracks per error of the heading [m/s/rad].
        max_turn: turning speed of the tracks at most, per module in the length [m/s]: a module that turns faster tips
            over on slopes, and more modules in a row slip more than they turn.
        turn_on_spot: larger errors of the heading are turned away on the spot, smaller ones on the way [rad].
        reverse: with a larger error of the heading the robot goes on with its other end ahead [rad].
        arrived: distance in plan from the goal [m] ...
        arrived_share: ... or this share of half the robot's length, whichever is more.
        storey: difference in height from the goal at most, and from the ground for a robot on it [m].
        patience: time for a route relative to that at full speed; turns take time, and slopes slip.
        extra_time: time for every route beside that [s] ...
        turn_time: ... and per meter of half the robot's length: eight modules turn by 0.07 rad/s [s/m].
        control_steps: physics steps in a tick of control, of 5 ms each.
        stuck_ticks: ticks in which a robot that is not stuck moves or turns.
        stuck_motion: it moves its middle or, in a turn, its ends at least this far [m].
        recovery_ticks: ticks for which a stuck robot drives straight, forwards or backwards by chance: fewest, and one
            more than the most.
        lift: height above the ground at which the robot is put down [m].
    """

    speed: float = 0.10
    look_ahead: float = 0.15
    turn_gain: float = 0.10
    max_turn: float = 0.05
    turn_on_spot: float = 1.0
    reverse: float = 1.9
    arrived: float = 0.08
    arrived_share: float = 0.3
    storey: float = 0.12
    patience: float = 3.0
    extra_time: float = 30.0
    turn_time: float = 120.0
    control_steps: int = 10
    stuck_ticks: int = 60
    stuck_motion: float = 0.03
    recovery_ticks: tuple[int, int] = (10, 50)
    lift: float = 0.005


@dataclass
class Drive:
    """What a drive came to.

    Attributes:
        has_arrived: whether the middle of the robot reached the goal on its storey.
        time: length of the drive [s].
        remaining: distance from the goal at the end [m].
        has_left_ground: whether the robot was ever above or below all ground of the map by more than a module.
        has_tipped_over: whether a module ever lay on its side or back.
        path: middle of the robot over time [m].
    """

    has_arrived: bool
    time: float
    remaining: float
    has_left_ground: bool
    has_tipped_over: bool = False
    path: list[list[float]] = field(default_factory=list)


class Pursuit:
    """Follows a route; where the robot is stuck, it backs off and tries again."""

    def __init__(self, route: DrivingRoute, config: PursuitConfig, half_length: float = 0.05) -> None:
        """Begin at the start of a route.

        Args:
            route: its path is followed.
            config: how.
            half_length: half of the robot's length [m].
        """
        self._path, self._config, self._half_length = route.path[:, :2], config, half_length
        self._look_ahead = config.look_ahead + half_length
        self._max_turn = min(config.max_turn * half_length / 0.0525, config.speed)
        steps = np.linalg.norm(np.diff(self._path, axis=0), axis=1)
        self._travelled = np.concatenate([[0.0], np.cumsum(steps)])
        self._reached = 0.0
        self._last: list[np.ndarray] = []
        self._recovery, self._direction = 0, 1.0
        self._ahead = 1.0

    def __call__(
        self, center: Float[np.ndarray, " 3"], heading: float, rng: np.random.Generator
    ) -> tuple[float, float]:
        """Return the speeds of the left and right tracks [m/s]."""
        config = self._config
        way = self._find_target(center[:2]) - center[:2]
        error = _wrap(np.arctan2(way[1], way[0]) - heading - np.pi * (self._ahead < 0))
        if abs(error) > config.reverse:
            self._ahead, error = -self._ahead, _wrap(error + np.pi)
        self._notice(center, heading, rng)
        if self._recovery > 0:
            self._recovery -= 1
            return self._direction * config.speed, self._direction * config.speed
        turn = float(np.clip(config.turn_gain * error, -self._max_turn, self._max_turn))
        forward = self._ahead * config.speed * max(0.0, 1.0 - abs(error) / config.turn_on_spot)
        slower = config.speed / max(config.speed, abs(forward) + abs(turn))
        return slower * (forward - turn), slower * (forward + turn)

    def _find_target(self, place: Float[np.ndarray, " 2"]) -> Float[np.ndarray, " 2"]:
        """Return the point of the path to drive to: ahead of the nearest one near what was reached before."""
        ahead, travelled = self._look_ahead, self._travelled
        is_near = np.abs(travelled - self._reached) <= 2 * ahead
        gap = np.where(is_near, np.linalg.norm(self._path - place, axis=1), np.inf)
        self._reached = max(self._reached, float(travelled[np.argmin(gap)]))
        return np.array([np.interp(self._reached + ahead, travelled, self._path[:, k]) for k in range(2)])

    def _notice(self, center: Float[np.ndarray, " 3"], heading: float, rng: np.random.Generator) -> None:
        """Begin to recover where the robot has hardly moved for a while."""
        ends = self._half_length * np.array([np.cos(heading), np.sin(heading)])
        pose = np.concatenate([center, ends])
        self._last = [*self._last[-self._config.stuck_ticks :], pose]
        is_stuck = np.linalg.norm(pose - self._last[0]) < self._config.stuck_motion
        if len(self._last) > self._config.stuck_ticks and is_stuck and self._recovery == 0:
            self._recovery, self._last = int(rng.integers(*self._config.recovery_ticks)), []
            self._direction = float(rng.choice([-1.0, 1.0]))


def _wrap(angle: float) -> float:
    """Return an angle between -pi and pi [rad]."""
    return float((angle + np.pi) % (2 * np.pi) - np.pi)


def make_random(config: PursuitConfig) -> Driver:
    """Return a driver with random speeds on either side, a new pair about once a second."""
    speeds = np.zeros(2)

    def drive(center: np.ndarray, heading: float, rng: np.random.Generator) -> tuple[float, float]:
        if rng.random() < config.control_steps * 0.005:
            speeds[:] = rng.uniform(-config.speed, config.speed, 2)
        return float(speeds[0]), float(speeds[1])

    return drive


def make_idle(config: PursuitConfig) -> Driver:
    """Return a driver that stands still."""
    return lambda center, heading, rng: (0.0, 0.0)


def drive_route(
    robot: TrackedRobot,
    ground: TraversabilityMap,
    route: DrivingRoute,
    driver: Driver,
    heading: float,
    rng: np.random.Generator,
    config: PursuitConfig,
) -> Drive:
    """Put a robot at the start of a route and let a driver drive it until it arrives or the time is over.

    Args:
        robot: the robot, in the arena of the map.
        ground: the map, for what is ground.
        route: start and goal.
        driver: what drives.
        heading: direction of the robot at the start [rad].
        rng: for the driver.
        config: when it has arrived.
    """
    half = robot.organism.scout.size[2] / 2
    start, goal = np.array(route.start), np.array(route.goal)
    point, normal = _find_plane(ground, start)
    robot.put_down(heading, point + config.lift * normal, normal)
    tick = config.control_steps * robot.model.opt.timestep
    limit = config.patience * route.length / config.speed + config.extra_time
    limit += config.turn_time * robot.half_length
    arrived = max(config.arrived, config.arrived_share * robot.half_length)
    drive = Drive(False, 0.0, route.length, False)
    while drive.time < limit and not (drive.has_arrived or drive.has_left_ground or drive.has_tipped_over):
        robot.step(*driver(robot.center, robot.heading, rng), config.control_steps)
        drive.time += tick
        center = robot.center - (0.0, 0.0, half)
        drive.path.append(center.round(4).tolist())
        drive.has_tipped_over = robot.tilt > np.pi / 2
        drive.has_left_ground = _is_off_ground(ground, center, config.storey)
        drive.remaining = float(np.linalg.norm(center - goal))
        is_near = np.linalg.norm(center[:2] - goal[:2]) < arrived
        drive.has_arrived = bool(is_near and abs(center[2] - goal[2]) < config.storey)
    drive.has_arrived &= not (drive.has_left_ground or drive.has_tipped_over)
    return drive


def _find_plane(
    ground: TraversabilityMap, place: Float[np.ndarray, " 3"]
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Return a point and the unit normal of the plane that lies on the ground under a robot."""
    offset = ground.positions - place
    is_under = np.linalg.norm(offset[:, :2], axis=1) <= ground.footprint.reach + ground.grid.cell
    is_under &= np.abs(offset[:, 2]) <= ground.footprint.height
    x, y, z = offset[is_under].T
    slope = np.linalg.lstsq(np.column_stack([x, y, np.ones(len(x))]), z, rcond=None)[0]
    lift = float((z - slope[0] * x - slope[1] * y).max(initial=0.0))
    normal = np.array([-slope[0], -slope[1], 1.0])
    return place + np.array([0.0, 0.0, lift]), normal / np.linalg.norm(normal)


def _is_off_ground(ground: TraversabilityMap, center: Float[np.ndarray, " 3"], storey: float) -> bool:
    """Return whether there is no ground of the map within a module's height of a place, here or next to it."""
    c = ground.grid.cell
    spots = center[:2] + c * np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)])
    near = ground.sorted_heights.find_nearest(ground.grid.find_cells(spots), np.full(len(spots), center[2]))
    return not bool((np.abs(ground.height[near[near >= 0]] - center[2]) <= storey).any())
