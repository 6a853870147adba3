"""A tracked robot that follows a route by pure pursuit (Coulter 1992), and what it is compared with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import mujoco
import numpy as np
from jaxtyping import Float

from symbrion_gym.arenas.arena import Arena
from symbrion_gym.robot.organism import Organism
from symbrion_gym.traversability.drivable import TraversabilityMap
from symbrion_gym.traversability.routes import DrivingRoute

_SETTLING = 100
"""Physics steps at rest after a robot has been put down."""
Driver = Callable[[Float[np.ndarray, " 3"], float, np.random.Generator], tuple[float, float]]
"""From the middle of the robot [m], its heading [rad] and a generator to the speeds of its left and right tracks
[m/s]."""


@dataclass(frozen=True)
class PursuitConfig:
    """How a robot follows a route, and when it has arrived.

    Attributes:
        speed: of the tracks at most [m/s].
        look_ahead: the robot drives towards the point of the path this far ahead [m].
        turn_gain: turning speed of the tracks per error of the heading [m/s/rad].
        turn_on_spot: larger errors of the heading are turned away on the spot [rad].
        arrived: distance in plan from the goal [m].
        storey: difference in height from the goal at most, and from the ground for a robot on it [m].
        patience: time for a route relative to that at full speed; turns take time, and slopes slip.
        extra_time: time for every route beside that [s].
        control_steps: physics steps in a tick of control, of 5 ms each.
        stuck_ticks: ticks in which a robot that is not stuck moves or turns.
        stuck_motion: it moves at least this far, or turns by this per 0.1 m of half its size [m].
        recovery_ticks: ticks for which a stuck robot drives straight, backwards and forwards in turns.
        lift: height above the ground at which the robot is put down [m].
    """

    speed: float = 0.10
    look_ahead: float = 0.20
    turn_gain: float = 0.10
    turn_on_spot: float = 0.6
    arrived: float = 0.15
    storey: float = 0.15
    patience: float = 3.0
    extra_time: float = 30.0
    control_steps: int = 10
    stuck_ticks: int = 60
    stuck_motion: float = 0.03
    recovery_ticks: int = 30
    lift: float = 0.005


@dataclass
class Drive:
    """What a drive came to.

    Attributes:
        has_arrived: whether the middle of the robot reached the goal on its storey.
        time: length of the drive [s].
        remaining: distance from the goal at the end [m].
        has_left_ground: whether the robot was ever above or below all ground of the map by more than a module.
        path: middle of the robot over time [m].
    """

    has_arrived: bool
    time: float
    remaining: float
    has_left_ground: bool
    path: list[list[float]] = field(default_factory=list)


class TrackedRobot:
    """An organism on its tracks in an arena: both sides of all modules have one speed each; hinges stay straight."""

    def __init__(self, arena: Arena, organism: Organism) -> None:
        """Compile the arena with the organism."""
        spec = arena.spec()
        organism.add_to(spec, spec.worldbody)
        spec.option.timestep = 0.005
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.organism = organism
        self._sites = [self.model.site(f"module_{i}").id for i in range(organism.num_modules)]
        tracks = [i for i in range(self.model.ngeom) if "_track_" in self.model.geom(i).name]
        is_left = [int(self.model.geom(i).name.rsplit("_", 1)[1]) < 5 for i in tracks]
        self._left = [i for i, left in zip(tracks, is_left, strict=True) if left]
        self._right = [i for i, left in zip(tracks, is_left, strict=True) if not left]
        poses = np.array([(pose.x, pose.y) for pose in organism.find_poses()])
        self._middle = poses.mean(axis=0)

    @property
    def center(self) -> Float[np.ndarray, " 3"]:
        """Mean of the centers of the modules [m]."""
        return self.data.site_xpos[self._sites].mean(axis=0)

    @property
    def heading(self) -> float:
        """Direction of the first module in plan [rad]."""
        matrix = self.data.site_xmat[self._sites[0]]
        return float(np.arctan2(matrix[3], matrix[0]))

    def put_down(
        self, heading: float, point: Float[np.ndarray, " 3"], normal: Float[np.ndarray, " 3"]
    ) -> None:
        """Put the robot on the ground, and let it come to rest.

        Args:
            heading: direction in plan [rad].
            point: where the middle of the robot touches the ground [m].
            normal: unit normal of the ground there.
        """
        mujoco.mj_resetData(self.model, self.data)
        ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
        ahead -= normal * (ahead @ normal)
        ahead /= np.linalg.norm(ahead)
        axes = np.column_stack([ahead, np.cross(normal, ahead), normal])
        middle = np.append(self._middle, -self.organism.scout.size[2] / 2)
        self.data.qpos[:3] = point - axes @ middle
        mujoco.mju_mat2Quat(self.data.qpos[3:7], axes.ravel())
        self.step(0.0, 0.0, _SETTLING)

    def step(self, left: float, right: float, steps: int) -> None:
        """Drive with a speed of the tracks on either side [m/s] for a number of physics steps."""
        radius = self.organism.scout.track_radius
        self.model.geom_surfacevel[self._left, 4] = left / radius
        self.model.geom_surfacevel[self._right, 4] = right / radius
        mujoco.mj_step(self.model, self.data, nstep=steps)


class Pursuit:
    """Follows a route; where the robot is stuck, it backs off and tries again."""

    def __init__(self, route: DrivingRoute, config: PursuitConfig) -> None:
        """Begin at the start of a route."""
        self._path, self._config = route.path[:, :2], config
        steps = np.linalg.norm(np.diff(self._path, axis=0), axis=1)
        self._travelled = np.concatenate([[0.0], np.cumsum(steps)])
        self._reached = 0.0
        self._last: list[np.ndarray] = []
        self._recovery, self._direction = 0, 1.0

    def __call__(
        self, center: Float[np.ndarray, " 3"], heading: float, rng: np.random.Generator
    ) -> tuple[float, float]:
        """Return the speeds of the left and right tracks [m/s]."""
        config = self._config
        self._notice(np.append(center, 0.1 * heading))
        if self._recovery > 0:
            self._recovery -= 1
            return self._direction * config.speed, self._direction * config.speed
        way = self._find_target(center[:2]) - center[:2]
        error = (np.arctan2(way[1], way[0]) - heading + np.pi) % (2 * np.pi) - np.pi
        turn = float(np.clip(config.turn_gain * error, -config.speed, config.speed))
        forward = 0.0 if abs(error) > config.turn_on_spot else config.speed - abs(turn)
        return forward - turn, forward + turn

    def _find_target(self, place: Float[np.ndarray, " 2"]) -> Float[np.ndarray, " 2"]:
        """Return the point of the path to drive to: ahead of the nearest one near what was reached before."""
        ahead, travelled = self._config.look_ahead, self._travelled
        is_near = np.abs(travelled - self._reached) <= 2 * ahead
        gap = np.where(is_near, np.linalg.norm(self._path - place, axis=1), np.inf)
        self._reached = max(self._reached, float(travelled[np.argmin(gap)]))
        return np.array([np.interp(self._reached + ahead, travelled, self._path[:, k]) for k in range(2)])

    def _notice(self, pose: Float[np.ndarray, " 4"]) -> None:
        """Begin to recover where the robot has hardly moved for a while."""
        self._last = [*self._last[-self._config.stuck_ticks :], pose]
        is_stuck = np.linalg.norm(pose - self._last[0]) < self._config.stuck_motion
        if len(self._last) > self._config.stuck_ticks and is_stuck and self._recovery == 0:
            self._recovery, self._last = self._config.recovery_ticks, []
            self._direction = -self._direction


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
    tick = config.control_steps * 0.005
    limit = config.patience * route.length / config.speed + config.extra_time
    drive = Drive(False, 0.0, route.length, False)
    while drive.time < limit and not drive.has_arrived:
        robot.step(*driver(robot.center, robot.heading, rng), config.control_steps)
        drive.time += tick
        center = robot.center - (0.0, 0.0, half)
        drive.path.append(center.round(4).tolist())
        drive.has_left_ground |= _is_off_ground(ground, center, config.storey)
        drive.remaining = float(np.linalg.norm(center - goal))
        is_near = np.linalg.norm(center[:2] - goal[:2]) < config.arrived
        drive.has_arrived = bool(is_near and abs(center[2] - goal[2]) < config.storey)
    drive.has_arrived &= not drive.has_left_ground
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
