"""Where the robot was: odometry corrected by matching its horizontal scans (paper, section II-A)."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solveh_banded
from scipy.spatial import cKDTree

from reconstruction.errors import ScanError
from reconstruction.extras import require_extras
from reconstruction.geometry.pose import make_pose, to_planar
from reconstruction.progress import Progress, silent
from reconstruction.scans.levelling import find_lean
from reconstruction.scans.mixed_pixels import find_jumps, find_noise
from reconstruction.scans.scan import Array, HorizontalScans, ScanLog

_LAYERS = np.array([-0.04, 0.0, 0.04])
"""The map is drawn at three heights [m], so that a wall's normal is a wall's in 3-D as well."""


_LINE_REACH = 0.15
_NUM_NEIGHBORS, _NOISE = 12, 0.012
"""Points that make a line of the map, and the noise up to which they do [m]; a thicker wall takes more."""
_PLANAR = [3, 4, 2]
"""x, y and the turn about z among the six parameters of a match (turns first)."""
_MATCH_SIGMA = 0.05
"""What a reading is worth in a match [m]; more than its noise, for neighbours err together."""
_GUESS_INFORMATION = np.diag([1 / 0.01**2, 1 / 0.01**2, 1 / 0.02**2])
"""Of a guess: 1 cm, 1 cm, 0.02 rad."""
_SHAKE = 0.0129
"""Pitch to be expected of a robot that drives [rad]."""
_MATCH_ERROR = 0.001
"""Of a scan matched to the settled map [m]."""
_LEAST_HEIGHT, _MAX_PITCH = 0.1, 0.1
_MIN_MAP = 20
_MAX_SCALE_ERROR = 0.2


def localise(log: ScanLog, progress: Progress = silent) -> ScanLog:
    """Return the log with poses from scan matching, and with its errors reported where the truth is known.

    Four degrees of freedom are found: x, y and yaw of the robot's foot, and its pitch, roughly (see
    `find_pitch`). Levelling finds a fifth, see `level_floor`; the foot stands on the ground.

    Raises:
        ScanError: the log has no horizontal scans.
    """
    if log.horizontal is None:
        raise ScanError(
            "the log has no horizontal scans to localise the robot by; give poses with the ScanLog"
        )
    ground = (log.poses @ np.linalg.inv(log.mount))[:, 2, 3]
    place = log.horizontal.mount[:3, 3]
    sway = (find_lean(log)[:, :3, :3] @ place - place)[:, :2]
    matched = _match_to_map(log.horizontal, sway, progress=progress)
    height = float(place[2])
    planar = fuse_odometry(matched, log.horizontal.odometry, sway=_find_sway(height))
    pitch = find_pitch(matched, planar, height)
    planar = _anchor(planar, log.horizontal.start)
    robot = make_pose(*planar.T, pitch=pitch)
    robot[:, 2, 3] = ground
    report = dict(log.report)
    if log.truth is not None:
        report |= judge_localisation(planar, to_planar(log.truth.robot_poses))
    return log.replace(poses=robot @ log.mount, report=report)


def judge_localisation(planar: Array, true: Array) -> dict[str, float]:
    """Compare poses `[S, 3]` (x, y, yaw) with the true ones: largest and median error [m] and [deg]."""
    distance = np.hypot(*(planar - true)[:, :2].T)
    angle = np.degrees(np.abs((planar[:, 2] - true[:, 2] + np.pi) % (2 * np.pi) - np.pi))
    return {
        "localisation_max": float(distance.max()),
        "localisation_median": float(np.median(distance)),
        "localisation_max_deg": float(angle.max()),
        "localisation_median_deg": float(np.median(angle)),
    }


def match_scans(scans: HorizontalScans, sway: Array | None = None, progress: Progress = silent) -> Array:
    """Match horizontal scans to a map of their own making; returns x, y, yaw `[S, 3]`.

    1. A scan starts where the odometry leads from the one before, is matched (point to plane, small_gicp) to
       the map of the key scans so far, and becomes one where the robot has gone on by 0.4 m or 0.35 rad.
    2. Some 400 scans are matched to the map of them all, 8 times over: the map settles, its loop closes.
    3. Every scan is matched to the settled map.
    4. The track is fused with the odometry (`fuse_odometry`): the scanner sways with the robot, its foot does
       not. The whole is moved so that it begins at the start.

    Args:
        scans: the horizontal scans.
        sway: `[S, 2]` where levelling found the scanner off its place, in the robot [m].
        progress: called with what is being done.
    """
    planar = _match_to_map(scans, sway, progress=progress)
    sigma = _find_sway(float(scans.mount[2, 3]))
    return _anchor(fuse_odometry(planar, scans.odometry, sway=sigma), scans.start)


def find_pitch(matched: Array, planar: Array, height: float) -> Array:
    """Find how the robot leans forward at every scan from the sway of its horizontal scanner, `[S]` [rad].

    A scanner at height h is carried ahead of the foot by ``h sin(p)``. With d the way from the smooth track to
    where the scan was matched, ahead: ``p = d / h * s^2 / (s^2 + m^2)``, s the sway to be expected, m the
    matching's error.

    The wheels leave the track open, and sway that lasts looks like driving. For a scanner at 0.3 m, shaking of 0.7
    degrees with a memory of half a scan, wheels wrong by 5 mm a square root of a metre and matches good to 0.8 mm,
    Wiener's filter, the best there can be, leaves 0.29 degrees; this leaves 0.30.

    Args:
        matched: `[S, 3]` x, y, yaw as the scans were matched.
        planar: `[S, 3]` the same, fused with the odometry.
        height: of the horizontal scanner above the ground [m]; below 0.1 m it tells nothing.
    """
    if height < _LEAST_HEIGHT:
        return np.zeros(len(planar))
    ahead = np.stack([np.cos(planar[:, 2]), np.sin(planar[:, 2])], axis=1)
    lead = ((matched - planar)[:, :2] * ahead).sum(axis=1)
    sway = _find_sway(height)
    share = sway**2 / (sway**2 + _MATCH_ERROR**2)
    return np.arcsin(np.clip(share * lead / height, -_MAX_PITCH, _MAX_PITCH))


def _find_sway(height: float) -> float:
    """Standard deviation of the sway of a scanner at this height, with the matching's error [m]."""
    return float(np.hypot(_SHAKE * height, _MATCH_ERROR))


def fuse_odometry(
    planar: Array, odometry: Array, sway: float = 0.004, yaw_noise: float = 0.001, slip: float = 0.005
) -> Array:
    """Smooth matched poses `[S, 3]` by the odometry's steps.

    The wheels are calibrated first, by the mean ratio of matched and counted ways and turns. Then this minimises
    ``sum |x_i - z_i|^2 / sway^2 + sum |x_(i+1) - x_i - R(yaw_i) u_i|^2 / (slip^2 way_i)`` over all positions x, z
    the matched ones and u the steps of the wheels: a tridiagonal system, exact. Likewise for yaw.

    Args:
        planar: matched x, y, yaw.
        odometry: x, y, yaw as the wheels count them.
        sway: standard deviation of the scanner's sway about the foot, and the matching's error [m].
        yaw_noise: standard deviation of the matched yaw [rad].
        slip: standard deviation of the wheels' error after one metre [m] (and [rad]); it grows with the
            square root.
    """
    if len(planar) < 3:
        return planar
    step, turn = np.diff(odometry[:, :2], axis=0), np.diff(odometry[:, 2])
    turn *= _find_scale(planar[:, 2:], turn[:, None])
    error = slip**2 * (np.hypot(*step.T) + 0.2 * np.abs(turn)) + 1e-10
    yaw = _smooth_track(planar[:, 2:], turn[:, None], yaw_noise**2 / error)[:, 0]
    lead = yaw[:-1] - odometry[:-1, 2]
    step = _turn(step, lead)
    step *= _find_scale(planar[:, :2], step)
    return np.c_[_smooth_track(planar[:, :2], step, sway**2 / error), yaw]


def _find_scale(measured: Array, steps: Array, window: int = 20) -> float:
    """How far the robot really goes where its wheels count 1, by least squares over stretches of the track."""
    counted = np.concatenate([np.zeros((1, steps.shape[1])), np.cumsum(steps, axis=0)])
    if len(measured) <= 2 * window:
        return 1.0
    real, counted = measured[window:] - measured[:-window], counted[window:] - counted[:-window]
    total = float((counted * counted).sum())
    scale = float((real * counted).sum()) / total if total > 1e-6 else 1.0
    return scale if abs(scale - 1) < _MAX_SCALE_ERROR else 1.0


def _turn(vectors: Array, angles: Array) -> Array:
    """Turn vectors `[S, 2]` by angles `[S]`."""
    c, s = np.cos(angles), np.sin(angles)
    return np.stack([c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]], axis=1)


def _smooth_track(measured: Array, steps: Array, weight: Array) -> Array:
    bands = np.zeros((2, len(measured)))
    bands[0, 1:] = -weight
    bands[1] = 1.0
    bands[1, 1:] += weight
    bands[1, :-1] += weight
    pull = np.zeros_like(measured)
    pull[1:] += weight[:, None] * steps
    pull[:-1] -= weight[:, None] * steps
    return solveh_banded(bands, measured + pull)


def _anchor(planar: Array, start: Array) -> Array:
    """Move and turn the whole track so that it begins at the start."""
    moved = _move(planar[:, :2] - planar[0, :2], np.array([*start[:2], start[2] - planar[0, 2]]))
    return np.c_[moved, planar[:, 2] + start[2] - planar[0, 2]]


def _match_to_map(
    scans: HorizontalScans,
    sway: Array | None = None,
    num_rounds: int = 8,
    key_distance: float = 0.4,
    key_angle: float = 0.35,
    progress: Progress = silent,
) -> Array:
    """Do steps 1 to 3 of `match_scans`."""
    require_extras("localising a robot", "scan")
    count = len(scans.ranges)
    if not count:
        return np.empty((0, 3))
    points = _find_wall_points(scans)
    thickness = max(1.0, find_noise(scans.ranges) / _NOISE)
    planar, keys = np.tile(scans.start, (count, 1)), [0]
    target = _make_map(points, planar, keys, thickness)
    for i in range(1, count):
        step = _between(scans.odometry[i - 1], scans.odometry[i])
        planar[i] = _align(target, points[i], _compose(planar[i - 1], step), reach=0.15)
        gone = planar[i] - planar[keys[-1]]
        if np.hypot(*gone[:2]) > key_distance or abs(gone[2]) > key_angle:
            keys.append(i)
            target = _make_map(points, planar, keys, thickness)
        if i % 50 == 0:
            progress("localising: first pass", 0.4 * i / count)
    keys = list(range(0, count, max(1, count // 400)))
    for k in range(num_rounds):
        target = _make_map(points, planar, keys, thickness)
        planar[keys] = [_align(target, points[i], planar[i], reach=0.06) for i in keys]
        progress("localising: settling the map", 0.4 + 0.3 * k / num_rounds)
    target = _make_map(points, planar, keys, thickness)
    planar = np.stack([_align(target, p, guess, reach=0.06) for p, guess in zip(points, planar, strict=True)])
    if sway is not None:
        planar[:, :2] -= _turn(sway, planar[:, 2])
    return planar


def _find_wall_points(scans: HorizontalScans) -> list[Array]:
    """End points in the robot's plane, scan by scan, without those at edges."""
    jumps = np.pad(find_jumps(scans.ranges), ((0, 0), (1, 1)), constant_values=True)
    good = np.isfinite(scans.ranges) & ~jumps[:, 1:] & ~jumps[:, :-1]
    beams = np.stack([np.cos(scans.angles), np.sin(scans.angles)], axis=1)
    found = []
    for ranges, is_good in zip(scans.ranges, good, strict=True):
        ends = ranges[is_good, None] * beams[is_good]
        found.append(ends @ scans.mount[:2, :2].T + scans.mount[:2, 3])
    return found


def _move(points: Array, planar: Array) -> Array:
    c, s = np.cos(planar[2]), np.sin(planar[2])
    return points @ np.array([[c, s], [-s, c]]) + planar[:2]


def _compose(planar: Array, step: Array) -> Array:
    return np.append(_move(step[None, :2], planar)[0], planar[2] + step[2])


def _between(a: Array, b: Array) -> Array:
    """The step from planar pose a to b, as seen from a."""
    c, s = np.cos(a[2]), np.sin(a[2])
    d = b - a
    return np.array([c * d[0] + s * d[1], -s * d[0] + c * d[1], d[2]])


def _make_map(
    points: list[Array], planar: Array, keys: range | list[int], thickness: float, cell: float = 0.03
) -> tuple | None:
    """Lay the key scans on each other, average them in cells, draw those onto lines, find normals; None: blind."""
    import small_gicp

    cloud = np.concatenate([_move(points[k], planar[k]) for k in keys])
    if len(cloud) < _MIN_MAP:
        return None
    grid = np.floor(cloud / cell).astype(np.int64)
    grid -= grid.min(axis=0)
    _, index, counts = np.unique(
        grid[:, 0] * (grid[:, 1].max() + 1) + grid[:, 1], return_inverse=True, return_counts=True
    )
    means = np.stack([np.bincount(index, cloud[:, k]) / counts for k in range(2)], axis=1)
    walls = _draw_onto_lines(means, counts.astype(float), round(_NUM_NEIGHBORS * thickness))
    raised = small_gicp.PointCloud(np.concatenate([np.c_[walls, np.full(len(walls), z)] for z in _LAYERS]))
    tree = small_gicp.KdTree(raised)
    small_gicp.estimate_normals_covariances(raised, tree, num_neighbors=15)
    return raised, tree


def _draw_onto_lines(points: Array, weights: Array, num_neighbors: int = _NUM_NEIGHBORS) -> Array:
    """Move points `[N, 2]` onto the line through their neighbours, and drop those at corners.

    A map as thick as the noise holds scans where they are: a point finds its own error in it.
    """
    num_neighbors = min(num_neighbors, len(points))
    distance, near = cKDTree(points).query(points, num_neighbors)
    weight = weights[near] * (distance < _LINE_REACH)
    total = weight.sum(axis=1)
    centre = np.einsum("nk,nki->ni", weight, points[near]) / total[:, None]
    offset = points[near] - centre[:, None]
    spread = np.einsum("nk,nki,nkj->nij", weight, offset, offset) / total[:, None, None]
    values, vectors = np.linalg.eigh(spread)
    normal = vectors[:, :, 0]
    drawn = points - ((points - centre) * normal).sum(axis=1, keepdims=True) * normal
    is_line = (values[:, 0] < 0.05 * values[:, 1]) & (total >= 3)
    return drawn[is_line] if is_line.sum() >= _MIN_MAP else drawn


def _align(target: tuple | None, points: Array, guess: Array, reach: float) -> Array:
    """Match points to the map from a guess, which holds where the walls in view leave a direction open.

    With d the step from guess to match and H the match's information (per variance of a reading), the pose is
    ``guess + (H / s^2 + P)^-1 (H / s^2) d``, P the guess's information.
    """
    import small_gicp

    if target is None or not len(points):
        return guess
    source = small_gicp.PointCloud(np.c_[points, np.zeros(len(points))])
    result = small_gicp.align(
        target[0],
        source,
        target[1],
        make_pose(*guess),
        registration_type="PLANE_ICP",
        max_correspondence_distance=reach,
        rotation_epsilon=1e-5,
        translation_epsilon=1e-4,
        max_iterations=15,
    )
    step = _between(guess, to_planar(result.T_target_source[None])[0])
    step[2] = (step[2] + np.pi) % (2 * np.pi) - np.pi
    information = result.H[np.ix_(_PLANAR, _PLANAR)] / _MATCH_SIGMA**2
    step = np.linalg.solve(information + _GUESS_INFORMATION, information @ step)
    return _compose(guess, step)
