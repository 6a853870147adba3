"""Where the scanner stood, and which way is up, of a cloud whose file does not say it: as its readings tell."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from reconstruction._src.geometry.orientation import find_up_axis
from reconstruction._src.scans.frames import CAMERA_AXES

_FEWEST = 1000  # Fewer readings do not tell
_NUM_SAMPLES, _NUM_TESTED = 50_000, 5_000
_NUM_NEIGHBORS = 4
_OTHER_SURFACE = 0.1  # Neighbors in direction whose ranges differ by this share lie on different surfaces
_HIDDEN = 0.12
"""A scanner that stood at the origin sees hardly a reading behind another. On another surface lie most neighbors in
direction of 1 to 4 % of the readings of ten files, and 8 % of one with 32 coarse beams; of 17 to 33 % of those of six
maps and scans from elsewhere, and 13 % of one from 0.2 m beside."""
_STAND, _LEAST_BELOW = 0.15, 0.1
"""So far over this share of its readings a scanner stands [m]; maps often begin on the floor, or below the ground."""
_CAMERA_CONE = np.cos(np.deg2rad(60.0))  # A camera sees nothing farther from its axis
_MOST_AHEAD = 0.99  # of its readings; some fly
_CAMERA_RANGE = 10.0  # Median of the ranges of a depth camera, at most [m]
_LEAST_NEAR, _NEARER = 0.02, 5.0
"""Share of the readings that stand out to a camera from a level surface, and over that of those behind it, at least: a
floor hides what is below it."""
_MOST_TILT = np.cos(np.deg2rad(50.0))  # A camera is held so far from upright, at most
_LEVEL = np.cos(np.deg2rad(10.0))  # Normals of level surfaces are so near to each other
_UPRIGHT = np.sin(np.deg2rad(10.0))  # So near to level are normals of walls
_DOUBTFUL_TILT = np.cos(np.deg2rad(15.0))  # A floor that is tilted by less may be a slope
_MOST_FLOOR = 1.5
"""Level surface of a tilted room over that of any of its walls, at least: a room may lie on its side."""
_LEAST_LEVEL = 0.1  # Share of the surface that is level, at least: else there is no floor to go by
_MOST_POINTS, _NUM_CELLS = 200_000, 100  # Points, and cells along the longest side, that tell what is flat
_NUM_NORMAL = 12  # Points for a normal
_NUM_DIRECTIONS = 1000  # Directions that are tried for up
_LANDSCAPE, _FLATNESS = 50.0, 5.0
"""A landscape is as wide and as long [m], which no front of a house is, and so many times as wide and long as high."""
_HIGH = 2 / 3  # Half of a landscape lies above this share of its height only if it is upside down
_FLAT = 0.02  # Share of a plane's variance off it, at most


@np.errstate(over="ignore", invalid="ignore")  # of broken coordinates
def is_seen_from_origin(points: Float[np.ndarray, "N 3"]) -> bool:
    """Return whether a scanner at the origin can have taken all readings: hardly one is hidden behind another.

    From far away none is: the origin of a country's coordinates is not where a scanner stood.
    """
    drawn = _draw(points, _NUM_SAMPLES)
    low, high = drawn.min(axis=0), drawn.max(axis=0)
    if np.linalg.norm(np.clip(0.0, low, high)) > np.linalg.norm(high - low):
        return False
    ranges = np.linalg.norm(drawn, axis=1)
    is_off = ranges > 0
    rays, ranges = drawn[is_off] / ranges[is_off, None], ranges[is_off]
    if len(rays) < _FEWEST:
        return False
    tested = np.random.default_rng(0).permutation(len(rays))[:_NUM_TESTED]
    neighbors = cKDTree(rays).query(rays[tested], _NUM_NEIGHBORS + 1)[1]
    jumps = np.abs(np.log(ranges[neighbors] / ranges[tested, None])) > _OTHER_SURFACE
    return float((2 * jumps.sum(axis=1) > _NUM_NEIGHBORS).mean()) < _HIDDEN


def has_ground_below(points: Float[np.ndarray, "N 3"]) -> bool:
    """Return whether a scanner at the origin stood over some of the readings (z up), and not among them."""
    return float((points[:, 2] < -_STAND).mean()) >= _LEAST_BELOW


@np.errstate(over="ignore", invalid="ignore")  # of broken coordinates
def find_upright(points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "3 3"] | None:
    """Return the rotation that levels the floor of a camera's readings; None where it is no camera's.

    They were seen from the origin in a cone along z (y down, or up as in Kinect's frame) or -z (y up, as in OpenGL's).
    Of the surfaces that look to the camera enough look up, within 50 degrees of y: those that most of these agree with
    are level, as floors, tables and shelves are.
    """
    ahead = _find_ahead(points)
    if not ahead:
        return None
    places, normals = _find_flat(points)
    normals *= -np.sign(np.sum(normals * places, axis=1))[:, None]  # to the camera
    for y in (ahead, -ahead):
        axes = CAMERA_AXES @ np.diag([ahead * y, y, ahead])
        up = _find_level(normals @ axes.T)
        if up is not None:
            return _make_level(up) @ axes
    return None


@np.errstate(over="ignore", invalid="ignore")  # of broken coordinates
def may_look_down(points: Float[np.ndarray, "N 3"]) -> bool:
    """Return whether readings may be those of a camera at the origin that looks down along z.

    From a level surface things stand out to the camera, and hardly any away from it, as they do on ground with z up.
    """
    if _find_ahead(points) <= 0.0:
        return False
    places, normals = _find_flat(points)
    away = _find_level(normals * np.where(normals[:, 2:] < 0.0, -1.0, 1.0))
    if away is None:
        return False
    level = np.median(places[np.abs(normals @ away) > _LEVEL] @ away)
    beyond = _draw(points, _NUM_SAMPLES) @ away - level
    near, far = (beyond < -_STAND).mean(), (beyond > _STAND).mean()
    return bool(near > max(_LEAST_NEAR, _NEARER * far))


def _find_ahead(points: Float[np.ndarray, "N 3"]) -> float:
    """Return 1 or -1, the sign of z before a camera at the origin that can have taken all readings; 0 of others."""
    drawn = _draw(points, _NUM_SAMPLES)
    ranges, ahead = np.linalg.norm(drawn, axis=1), np.sign(np.median(drawn[:, 2]))
    is_ahead = ahead * drawn[:, 2] >= _CAMERA_CONE * ranges
    if is_ahead.mean() < _MOST_AHEAD or np.median(ranges) > _CAMERA_RANGE or not is_seen_from_origin(points):
        return 0.0
    return float(ahead)


@np.errstate(over="ignore", invalid="ignore")  # of broken coordinates
def find_tilt(points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "3 3"] | None:
    """Return the rotation that levels the floor of a room that is tilted beyond doubt; None of any other.

    That with which most of the surface agrees is level where it lies within 50 degrees of z and walls stand upright on
    it: so a hillside is left as it is.
    """
    normals = _find_flat(points)[1]
    up = _find_level(normals * np.where(normals[:, 2:] < 0.0, -1.0, 1.0))
    if up is None or up[2] > _DOUBTFUL_TILT or len(normals) < _FEWEST:
        return None
    walls = normals[np.abs(normals @ up) < _UPRIGHT]
    if len(walls) < _LEAST_LEVEL * len(normals):
        return None
    tried = walls[:: max(1, len(walls) // _NUM_DIRECTIONS)]
    of_walls = (np.abs(normals @ tried.T) > _LEVEL).sum(axis=0).max()
    return _make_level(up) if (np.abs(normals @ up) > _LEVEL).sum() >= _MOST_FLOOR * of_walls else None


def _find_level(normals: Float[np.ndarray, "P 3"]) -> Float[np.ndarray, " 3"] | None:
    """Return the direction within 50 degrees of z with which most normals agree; None where these are few."""
    upward = normals[normals[:, 2] > _MOST_TILT]
    if not len(upward):
        return None
    agrees = upward @ upward[:: max(1, len(upward) // _NUM_DIRECTIONS)].T > _LEVEL
    level = upward[agrees[:, agrees.sum(axis=0).argmax()]]
    mean = level.mean(axis=0)
    return mean / np.linalg.norm(mean) if len(level) >= _LEAST_LEVEL * len(normals) else None


def _make_level(up: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """Return the smallest rotation that turns a direction to z."""
    return Rotation.align_vectors([[0.0, 0.0, 1.0]], [up])[0].as_matrix()


@np.errstate(over="ignore", invalid="ignore")  # of broken coordinates
def find_up(points: Float[np.ndarray, "N 3"]) -> str | None:
    """Return the axis that points up where it is not z beyond doubt: that along which a landscape is flat.

    Of anything else it is as `find_up_axis` finds it by the flat parts, unless it was seen from the origin: other
    scanners than cameras have z up in their own frames, and where few beams meet the floor, walls are most of what is
    level.
    """
    low, middle, high = np.percentile(_draw(points, _NUM_SAMPLES), [1, 50, 99], axis=0)
    axis = int((high - low).argmin())
    others = np.delete(high - low, axis).min()
    if axis != 2 and others > max(_LANDSCAPE, _FLATNESS * (high - low)[axis]):
        is_hung = (middle - low)[axis] > _HIGH * (high - low)[axis]
        if is_seen_from_origin(points):  # by a scanner that stood over it
            is_hung = middle[axis] > 0.0
        return f"{'-' if is_hung else ''}{'xyz'[axis]}"
    if is_seen_from_origin(points):
        return None
    places, normals = _find_flat(points)
    return find_up_axis(normals, places) if len(places) >= _FEWEST else None


def _draw(points: Float[np.ndarray, "N 3"], count: int) -> Float[np.ndarray, "M 3"]:
    """Return about so many of the points, each at most once, or all, without much memory."""
    if len(points) <= count:
        return points
    return points[np.unique(np.random.default_rng(0).integers(len(points), size=count))]


def _find_flat(points: Float[np.ndarray, "N 3"]) -> tuple[Float[np.ndarray, "P 3"], Float[np.ndarray, "P 3"]]:
    """Return places on flat parts of the surface, as many on far ones as on near ones, and normals of either sign."""
    points = _draw(points, _MOST_POINTS)
    cell = max(float(np.ptp(points, axis=0).max()) / _NUM_CELLS, np.finfo(float).tiny)
    _, first = np.unique(np.floor(points / cell).astype(np.int64), axis=0, return_index=True)
    places = points[np.sort(first)]
    if len(places) <= _NUM_NORMAL:
        return np.zeros((0, 3)), np.zeros((0, 3))
    around = places[cKDTree(places).query(places, _NUM_NORMAL)[1]]
    around = around - around.mean(axis=1, keepdims=True)
    spread, axes = np.linalg.eigh(np.swapaxes(around, 1, 2) @ around)
    is_flat = spread[:, 0] <= _FLAT * spread.sum(axis=1)
    return places[is_flat], axes[is_flat, :, 0]
