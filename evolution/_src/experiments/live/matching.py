"""Readings of a drive as points: the poses that the robot was told, corrected by matching against the known surface."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Float

from evolution._src.errors import RunError
from evolution._src.experiments.live.drive import DriveConfig, Readings
from reconstruction._src.base.range_checks import check_positive
from reconstruction._src.geometry.rows import cross_rows
from symbrion_gym._src.contact.distances import find_nearest
from symbrion_gym._src.robot.scout_rays import find_scout_rays


@dataclass(frozen=True)
class MatchConfig:
    """How readings are matched against the known surface, and become points.

    Attributes:
        window: readings of this long share one correction [s]: the error of a pose changes little meanwhile.
        gate: readings farther from the surface than this take no part [m]: something has changed there.
        sigma: standard deviation of a reading from the surface [m], more than its noise: the surface has errors, too.
        iterations: of the correction.
        farthest: longer ranges are left out [m]: the error of an angle moves their ends most.
        cell: readings within a cell of this width become their mean [m].
        min_readings: cells with fewer are left out: stray readings.
        free_every: of every so many scans one shows what space is free: neighbors show the same.

    Raises:
        RunError: a field is not above 0.
    """

    window: float = 0.3
    gate: float = 0.04
    sigma: float = 0.05
    iterations: int = 4
    farthest: float = 1.6
    cell: float = 0.02
    min_readings: int = 2
    free_every: int = 8

    def __post_init__(self) -> None:
        check_positive(self, [field.name for field in fields(self)], RunError)


class DrivenPoints(NamedTuple):
    """Points that a robot has read on a drive.

    Attributes:
        points: [m].
        origins: where the sensor was [m].
        free_rays: where beams of the laser that met nothing began, and how far they surely went [m].
        told_error: mean distance of the robot from where it was told to be [m].
        matched_error: the same after matching [m].
    """

    points: Float[np.ndarray, "N 3"]
    origins: Float[np.ndarray, "N 3"]
    free_rays: Float[np.ndarray, "K 2 3"]
    told_error: float
    matched_error: float


def find_points(
    readings: Readings,
    surface: trimesh.Trimesh,
    config: MatchConfig | None = None,
    drive: DriveConfig | None = None,
) -> DrivenPoints:
    """Return the points that readings show, by poses matched against the known surface.

    Args:
        readings: of a drive.
        surface: what is known of the place; what has changed there is left out of the match.
        config: how they are matched.
        drive: the errors of the poses told, from which the match starts.

    Raises:
        RunError: nothing was read.
    """
    config, drive = config or MatchConfig(), drive or DriveConfig()
    rays = find_scout_rays()
    scans, beams = np.nonzero(np.isfinite(readings.ranges) & (readings.ranges < config.farthest))
    if not len(scans):
        raise RunError("the Scout has read nothing; start it where it sees its surroundings")
    ends = rays.origins[beams] + readings.ranges[scans, beams][:, None] * rays.directions[beams]
    window = (readings.times // config.window).astype(np.int64)
    poses = readings.poses.copy()
    for number in np.unique(window[scans]):
        part = window[scans] == number
        move = _match(ends[part], readings.poses[scans[part]], surface, config, drive)
        rows = window == number
        poses[rows] = move @ readings.poses[rows]
    points, origins = (
        np.einsum("nij,nj->ni", poses[scans, :3, :3], places) + poses[scans, :3, 3]
        for places in (ends, rays.origins[beams])
    )
    points, origins = _average(points, origins, config)
    errors = [
        float(np.linalg.norm(found[:, :3, 3] - readings.true_poses[:, :3, 3], axis=1).mean())
        for found in (readings.poses, poses)
    ]
    return DrivenPoints(points, origins, _find_free_rays(readings.ranges, poses, config), *errors)


def _find_free_rays(
    ranges: Float[np.ndarray, "T R"], poses: Float[np.ndarray, "T 4 4"], config: MatchConfig
) -> Float[np.ndarray, "K 2 3"]:
    """Return the laser's beams that met nothing, up to the farthest range that is used: space there is free."""
    rays = find_scout_rays()
    is_laser = rays.max_ranges > config.farthest
    scans, beams = np.nonzero(np.isposinf(ranges[:: config.free_every]) & is_laser)
    poses = poses[:: config.free_every][scans]
    ends = rays.origins[beams] + config.farthest * rays.directions[beams]
    places = np.stack([rays.origins[beams], ends], axis=1)
    return np.einsum("nij,nkj->nki", poses[:, :3, :3], places) + poses[:, None, :3, 3]


def _match(
    ends: Float[np.ndarray, "N 3"],
    poses: Float[np.ndarray, "N 4 4"],
    surface: trimesh.Trimesh,
    config: MatchConfig,
    drive: DriveConfig,
) -> Float[np.ndarray, "4 4"]:
    """Return the motion that brings readings onto the surface, as far as the errors of the poses allow.

    Weighted least squares of the distances from the planes of the nearest faces, with the errors of the poses told as
    prior; readings beyond the gate take no part.

    Args:
        ends: readings in the frame of the module [m].
        poses: module -> world, of each reading.
        surface: what is known.
        config: the match.
        drive: the errors.
    """
    start = np.einsum("nij,nj->ni", poses[:, :3, :3], ends) + poses[:, :3, 3]
    center = poses[:, :3, 3].mean(axis=0)
    vertices, faces = np.asarray(surface.vertices), np.asarray(surface.faces)
    prior = np.diag([drive.position_error**-2] * 3 + [drive.angle_error**-2] * 3)
    found = np.zeros(6)
    for _ in range(config.iterations):
        move = _to_motion(found, center)
        places = start @ move[:3, :3].T + move[:3, 3]
        _, face, nearest = find_nearest(places, vertices, faces)
        normals = surface.face_normals[face]
        height = np.einsum("ni,ni->n", places - nearest, normals)
        is_used = np.linalg.norm(places - nearest, axis=1) < config.gate
        rows = np.concatenate([normals, cross_rows(places - center, normals)], axis=1)[is_used]
        weighted = rows.T / config.sigma**2
        step = np.linalg.solve(weighted @ rows + prior, -weighted @ height[is_used] - prior @ found)
        found = found + step
    return _to_motion(found, center)


def _to_motion(values: Float[np.ndarray, " 6"], center: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "4 4"]:
    """Return the motion of a translation [m] and a small rotation vector about a center [rad]."""
    from scipy.spatial.transform import Rotation

    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec(values[3:]).as_matrix()
    motion[:3, 3] = center + values[:3] - motion[:3, :3] @ center
    return motion


def _average(
    points: Float[np.ndarray, "N 3"], origins: Float[np.ndarray, "N 3"], config: MatchConfig
) -> tuple[Float[np.ndarray, "M 3"], Float[np.ndarray, "M 3"]]:
    """Return the mean point of each cell with enough readings, and the origin of its first reading."""
    cells = np.floor(points / config.cell).astype(np.int64)
    _, first, owner, counts = np.unique(
        cells, axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    owner = owner.ravel()
    means = np.stack([np.bincount(owner, points[:, axis]) for axis in range(3)], axis=1) / counts[:, None]
    is_kept = counts >= config.min_readings
    if not is_kept.any():
        raise RunError(f"no place was read {config.min_readings} times; drive longer, or take wider cells")
    return means[is_kept], origins[first[is_kept]]
