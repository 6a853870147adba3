"""A virtual robot with two laser scanners drives around an arena and logs it (paper, section II-A)."""

import itertools
import os
from dataclasses import replace

import numpy as np
import trimesh
from jaxtyping import Bool, Float, UInt8
from numpy.typing import ArrayLike

from reconstruction._src.base.errors import ScanError
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.geometry.pose import make_pose
from reconstruction._src.scans.localization import localize
from reconstruction._src.scans.mesh_files import load_mesh
from reconstruction._src.scans.scan import HorizontalScans, ScanLog, ScanTruth
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course, StairsCourse
from symbrion_gym._src.arenas.making import load_arena
from symbrion_gym._src.assets import NAMED_ARENAS
from symbrion_gym._src.errors import SurveyError
from symbrion_gym._src.sensing.friction_drive import drive_lanes
from symbrion_gym._src.sensing.survey_robot import LaserScanner, SurveyRobot, expose, look_at
from symbrion_gym._src.sensing.survey_world import SurveyWorld

Waypoints = Float[np.ndarray, "W 2"]  # x and y [m]

SPACING = 0.015  # One point in each cube of this edge suffices [m]: the scanner reads places where it turns very often
_PATTERN = "checker"  # Of the courses by name, which have no colors of their own
_GROUND = 0.5  # Gray of the ground around an arena, and of a pixel that shows nothing
_RIM = 1e-3  # The arena ends this far outside of its box [m]
_CAMERA_STREAM = 20  # The camera draws from a stream of its own: ranges are those of a survey without it
_FIRST_WAYPOINT = 2
"""The drive begins next to the arena, not in a corner of the room, where little is seen of its length."""

_SMALLEST = 1e-3  # The steps of a range reading are no smaller [m]
_LARGEST = 200.0
"""The scanner would see next to nothing of a larger mesh [m]; the file's unit is likely another."""
_LEAST_VERTICES = 4  # A mesh with fewer is subdivided: MuJoCo takes none
_REPORT_EVERY = 100  # Scans from one report of progress to the next
_SAME_PLACE = 1e-6  # Waypoints closer than this are the same [m]


def survey(
    arena: str | os.PathLike | Arena | Course | StairsCourse | trimesh.Trimesh,
    path: ArrayLike | None = None,
    sensor: SurveyRobot | LaserScanner | None = None,
    seed: int = 0,
    progress: Progress = silent,
    camera: bool = False,
    friction: bool = False,
) -> ScanLog:
    """Drive a virtual robot around an arena and return its scan log, localized.

    The robot drives on the level ground around the arena (the height of the arena's lowest point), its
    vertical scanner on a mast of 2.2 m, or 1 m above the arena's highest point. The ground begins 0.1 m off
    the arena's bounding box; the open sides of the arena are covered by black skirting that returns nothing. A
    room with pilasters stands around it; only the horizontal scanner sees it.

    Args:
        arena: a name, an `Arena`, a course, a trimesh, or a mesh file.
        path: `[W, 2]` waypoints [m] on the ground; straight legs, turns on the spot. Default: see
            `make_path`.
        sensor: robot, or scanner on the default robot.
        seed: decides every error; equal seeds give equal logs.
        progress: called with what is being done.
        camera: whether a camera beside the vertical scanner gives each reading a color (`ScanLog.colors`). The ranges
            stay the same. The courses "truth" and "stairs" are painted as a checker then; other arenas
            need colors of their own.
        friction: whether docked Scouts drive over the arena afterwards and feel the ground (`ScanLog.slip`); the scans
            are the same with and without.

    Returns:
        Poses come from localization: x, y and yaw of the robot's foot, and its pitch to about 0.3 degrees. Leveling
        finds its lean in the plane of each scan (`level_floor`). A pitch not found moves a point by its height above
        the ground times the pitch, 1.3 mm at 0.25 m. `truth` holds the true poses and mixed beams, for comparison;
        `report` the errors of localization against them.

    Raises:
        ArenaError: the arena is unknown.
        SurveyError: its mesh is empty or too large, the path unusable, there is nothing for a camera to see, or
            friction is to be felt on a mesh, of which nobody knows any.
        MissingExtraError: the extra `scan` is not installed.
    """
    require_extras("a survey", "scan")
    known, surface = _find_arena(arena, camera)
    if camera and (known is None or known.texture is None):
        raise SurveyError(
            "camera: a mesh, or an arena that has no colors, shows none; give an Arena with colors, made of a colored "
            "scan or mesh, or of a Course with a color_pattern"
        )
    if friction and known is None:
        raise SurveyError(
            "friction is felt on an Arena, a named arena or its folder; a mesh has none, an arena made of it has"
        )
    robot = sensor if isinstance(sensor, SurveyRobot) else SurveyRobot(scanner=sensor or LaserScanner())
    bounds = np.asarray(surface.bounds, float)
    if bounds[1, 2] - bounds[0, 2] + robot.head_room > robot.mast:
        robot = replace(robot, mast=float(bounds[1, 2] - bounds[0, 2] + robot.head_room))
    waypoints = make_path(bounds) if path is None else _check_path(path)
    rng = np.random.default_rng(seed)
    true_planar = drive(waypoints, robot)
    odometry = _integrate_odometry(true_planar, robot, rng)
    ground = float(bounds[0, 2])
    roll, pitch = _sample_sway(len(true_planar), robot, rng)
    robot_poses = _lift(make_pose(*true_planar.T, roll=roll, pitch=pitch), ground)
    world = SurveyWorld(surface, waypoints)
    vertical, mixed, low = _scan(robot_poses, robot, world, rng, progress)
    colors = None
    if known is not None and camera:
        light = np.random.default_rng([seed, _CAMERA_STREAM])
        colors = _color_readings(vertical, robot_poses, robot, world, known, light)
    angles = robot.scanner.angles
    log = ScanLog(
        vertical,
        angles,
        _lift(make_pose(*odometry.T), ground) @ robot.vertical_mount,
        mount=robot.vertical_mount,
        box=bounds,
        horizontal=HorizontalScans(low, angles, robot.horizontal_mount, odometry, true_planar[0]),
        truth=ScanTruth(robot_poses, mixed),
        report={"seed": float(seed)},
        colors=colors,
    )
    log = localize(log, progress=progress)
    if known is None or not friction:
        return log
    return log.replace(slip=drive_lanes(known, np.random.default_rng([seed, 1]), progress))


def _find_arena(
    arena: str | os.PathLike | Arena | Course | StairsCourse | trimesh.Trimesh, is_painted: bool
) -> tuple[Arena | None, trimesh.Trimesh]:
    """Return the arena, where it is more than a mesh, and its surface; courses by name are painted on demand."""
    if isinstance(arena, str) and arena in ("truth", "stairs") and is_painted:
        arena = (StairsCourse if arena == "stairs" else Course)(color_pattern=_PATTERN)
    if isinstance(arena, Course | StairsCourse):
        arena = Arena.from_course(arena)
    what = f"survey of {arena}" if isinstance(arena, str | os.PathLike) else "survey"
    if isinstance(arena, str | os.PathLike):
        if str(arena) in NAMED_ARENAS or os.path.isdir(arena):
            arena = load_arena(str(arena))
        else:
            try:
                arena = load_mesh(arena)
            except ScanError as error:
                raise SurveyError(
                    f"no named arena ({', '.join(NAMED_ARENAS)}), and no mesh: {error}"
                ) from error
            arena.apply_translation(arena.metadata["offset"])
            _check_size(arena, what)
            arena.merge_vertices()
    surface = arena.surface if isinstance(arena, Arena) else arena
    if not isinstance(surface, trimesh.Trimesh):
        raise SurveyError(f"survey needs a mesh with faces, got {surface!r}")
    _check_size(surface, what)
    few = len(surface.vertices) < _LEAST_VERTICES
    return arena if isinstance(arena, Arena) else None, surface.subdivide() if few else surface


def _lift(poses: Float[np.ndarray, "S 4 4"], height: float) -> Float[np.ndarray, "S 4 4"]:
    """Return the poses with z at a height [m]."""
    poses[:, 2, 3] = height
    return poses


def _scan(
    robot_poses: Float[np.ndarray, "S 4 4"],
    robot: SurveyRobot,
    caster: SurveyWorld,
    rng: np.random.Generator,
    progress: Progress,
) -> tuple[Float[np.ndarray, "S B"], Bool[np.ndarray, "S B"], Float[np.ndarray, "S B"]]:
    """Scan at every pose; return the vertical ranges, which of these are mixed, and the horizontal ranges [m]."""
    vertical, mixed, low = [], [], []
    for i, pose in enumerate(robot_poses):
        ranges, is_mixed = robot.scanner.scan(caster.cast_on_arena, pose @ robot.vertical_mount, rng)
        vertical.append(ranges)
        mixed.append(is_mixed)
        low.append(robot.scanner.scan(caster.cast_on_walls, pose @ robot.horizontal_mount, rng)[0])
        if i % _REPORT_EVERY == 0:
            progress("scanning", i / len(robot_poses))
    return np.stack(vertical), np.stack(mixed), np.stack(low)


def _color_readings(
    ranges: Float[np.ndarray, "S B"],
    robot_poses: Float[np.ndarray, "S 4 4"],
    robot: SurveyRobot,
    world: SurveyWorld,
    arena: Arena,
    rng: np.random.Generator,
) -> UInt8[np.ndarray, "S B 3"]:
    """Return the color that the camera sees where each reading falls on its picture; zeros without a reading."""
    beams = robot.scanner.directions
    is_read = np.isfinite(ranges)
    places, seen = np.zeros((*ranges.shape, 3)), np.zeros(ranges.shape, dtype=bool)
    for scan, robot_pose in enumerate(robot_poses):
        pose, read = robot_pose @ robot.vertical_mount, is_read[scan]
        if read.any():
            ends = (ranges[scan, read, None] * beams[read]) @ pose[:3, :3].T + pose[:3, 3]
            places[scan, read], seen[scan, read] = look_at(ends, pose, world.cast_on_arena)
    low, high = np.asarray(arena.surface.bounds, float)
    on_arena = seen & ((places >= low - _RIM) & (places <= high + _RIM)).all(axis=2)
    colors = np.full((*ranges.shape, 3), _GROUND)
    colors[on_arena] = arena.find_colors(places[on_arena])
    pictures = np.stack([expose(row, rng) for row in colors])
    pictures[~is_read] = 0
    return pictures


def make_path(bounds: Float[np.ndarray, "2 3"], clearance: float = 0.3, stride: float = 1.2) -> Waypoints:
    """Make the default path [m]: once around the arena, clockwise, in zigzag.

    The legs run at 45 degrees to the arena's sides, so the vertical scanner, which looks to the robot's
    right, sweeps
    every place in two diagonal directions from either side: walls that face any way are seen, and pits to
    their ground, but nothing is seen along its whole length.
    """
    (x0, y0), (x1, y1) = bounds[0, :2] - clearance, bounds[1, :2] + clearance
    corners = np.array([(x0, y1), (x1, y1), (x1, y0), (x0, y0), (x0, y1)])
    sides = [_zigzag(a, b, stride) for a, b in itertools.pairwise(corners)]
    loop = np.roll(np.concatenate(sides), -_FIRST_WAYPOINT, axis=0)
    return np.concatenate([loop, loop[:1]])


def _zigzag(start: Float[np.ndarray, " 2"], stop: Float[np.ndarray, " 2"], stride: float) -> Waypoints:
    """Go from start towards stop (left out), every other waypoint as far to the left as the legs are long."""
    along = stop - start
    length = float(np.hypot(*along))
    num_legs = 2 * max(1, round(length / stride / 2))
    left = np.array([-along[1], along[0]]) / num_legs
    i = np.arange(num_legs)[:, None]
    return start + i / num_legs * along + (i % 2) * left


def drive(waypoints: Waypoints, robot: SurveyRobot) -> Float[np.ndarray, "S 3"]:
    """Follow the waypoints at constant speed, turn on the spot; return x, y [m] and yaw [rad] at every scan."""
    legs = np.diff(waypoints, axis=0)
    yaws = np.arctan2(legs[:, 1], legs[:, 0])
    yaws = yaws[0] + np.concatenate([[0.0], np.cumsum((np.diff(yaws) + np.pi) % (2 * np.pi) - np.pi)])
    times, knots = [0.0, robot.rest], [[*waypoints[0], yaws[0]]] * 2
    for i, leg in enumerate(legs):
        if i:
            times.append(times[-1] + abs(yaws[i] - yaws[i - 1]) / robot.turn_rate)
            knots.append([*waypoints[i], yaws[i]])
        times.append(times[-1] + float(np.hypot(*leg)) / robot.speed)
        knots.append([*waypoints[i + 1], yaws[i]])
    at = np.arange(0.0, times[-1], 1.0 / robot.scan_rate)
    table = np.array(knots)
    return np.stack([np.interp(at, times, table[:, k]) for k in range(3)], axis=1)


def _integrate_odometry(
    true: Float[np.ndarray, "S 3"], robot: SurveyRobot, rng: np.random.Generator
) -> Float[np.ndarray, "S 3"]:
    """Add up the wheels' steps with their errors; start at the true start."""
    step = np.diff(true, axis=0)
    middle = true[:-1, 2] + step[:, 2] / 2
    ahead = step[:, 0] * np.cos(middle) + step[:, 1] * np.sin(middle)
    scale = 1 + np.array([robot.distance_drift, robot.turn_drift]) * rng.standard_normal(2)
    way = np.sqrt(np.abs(ahead) + robot.turn_weight * np.abs(step[:, 2]))
    ahead = ahead * scale[0] + robot.step_noise * way * rng.standard_normal(len(step))
    turn = step[:, 2] * scale[1] + robot.step_noise * way * rng.standard_normal(len(step))
    yaw = true[0, 2] + np.concatenate([[0.0], np.cumsum(turn)])
    middle = yaw[:-1] + turn / 2
    x = true[0, 0] + np.concatenate([[0.0], np.cumsum(ahead * np.cos(middle))])
    y = true[0, 1] + np.concatenate([[0.0], np.cumsum(ahead * np.sin(middle))])
    return np.stack([x, y, yaw], axis=1)


def _sample_sway(count: int, robot: SurveyRobot, rng: np.random.Generator) -> Float[np.ndarray, "2 S"]:
    """Draw roll and pitch at every scan [rad]: an autoregressive process."""
    draws, shake = rng.standard_normal((count, 2)), np.zeros((count, 2))
    fresh = np.sqrt(1 - robot.shake_memory**2)
    for i in range(count):
        shake[i] = robot.shake_memory * shake[i - 1] * (i > 0) + (fresh if i else 1.0) * draws[i]
    return robot.shake * shake.T


def _check_size(surface: trimesh.Trimesh, what: str) -> None:
    if not len(surface.faces):
        raise SurveyError(f"{what}: the mesh has no faces")
    if not np.isfinite(surface.vertices).all():
        raise SurveyError(f"{what}: the mesh has vertices that are not finite")
    with np.errstate(over="ignore"):
        extent = float(np.ptp(surface.vertices[surface.faces.ravel()], axis=0).max())
    if not extent >= _SMALLEST:
        raise SurveyError(f"{what}: the mesh is {extent:g} m large; {_SMALLEST:g} m is the least")
    if extent > _LARGEST:
        remedy = "if its unit is the millimeter, scale it first: mesh.apply_scale(0.001)"
        raise SurveyError(f"{what}: the mesh is {extent:g} m large, more than {_LARGEST:g} m; {remedy}")


def _check_path(path: ArrayLike) -> Waypoints:
    """Return the waypoints of a path, those that are the same as the one before left out."""
    waypoints = np.asarray(path, float)
    is_list = waypoints.ndim == 2 and waypoints.shape[1] == 2 and len(waypoints) >= 2
    if not is_list or not np.isfinite(waypoints).all():
        raise SurveyError(f"path must be [W, 2] finite waypoints, W >= 2, got shape {waypoints.shape}")
    keep = np.r_[True, np.hypot(*np.diff(waypoints, axis=0).T) > _SAME_PLACE]
    if keep.sum() < 2:
        raise SurveyError("path must lead somewhere: all waypoints are the same")
    return waypoints[keep]
