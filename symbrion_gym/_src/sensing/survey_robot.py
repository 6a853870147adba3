"""The robot that surveys an arena: its laser scanners and its camera as they measure, how it drives and errs.

Pictures are made without OpenGL: equal seeds give equal pictures on any machine. Light is even and white: no shades, no
highlights.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, UInt8

from reconstruction._src.base.range_checks import check_not_negative, check_positive
from reconstruction._src.geometry.pose import make_rotation
from symbrion_gym._src.errors import SurveyError

Directions = Float[np.ndarray, "R 3"]  # Of each beam, as unit vectors

Ranges = Float[np.ndarray, " R"]  # Of each beam [m]
Pose = Float[np.ndarray, "4 4"]  # Of a frame in the world

Cast = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""(origin `[3]`, unit directions `[R, 3]`) -> distances `[R]` [m], inf where nothing is hit."""
_UPRIGHT = 1e-9  # A beam whose sine to the z axis is smaller is parallel to it but for rounding


@dataclass(frozen=True)
class LaserScanner:
    """A planar laser scanner; the defaults are the LMS 200 at half a degree.

    A beam lights a spot of ``spot + divergence * r``. Where the spot meets an edge (its rim is off the plane
    through its middle by more than ``edge_step``) the reading is a mix, near + w (far - near), w uniform in
    0..1.

    Attributes:
        num_beams: beams a scan.
        field_of_view: angle between the first and the last beam [rad].
        max_range: readings beyond it are no returns [m].
        noise: standard deviation of a reading at range 0 [m].
        noise_per_meter: its growth with the range; 5 mm + 0.5 mm/m gives the paper's 7 mm at 4 m.
        resolution: readings come in steps of this [m]; 0: continuous.
        spot: diameter of the light spot at the sensor [m].
        divergence: growth of the spot with the range [rad].
        edge_step: depth that makes an edge [m].

    Raises:
        SurveyError: a number is out of range.
    """

    num_beams: int = 361
    field_of_view: float = np.pi
    max_range: float = 8.19
    noise: float = 0.005
    noise_per_meter: float = 0.0005
    resolution: float = 0.001
    spot: float = 0.010
    divergence: float = 0.0044
    edge_step: float = 0.05

    def __post_init__(self) -> None:
        if self.num_beams < 2:
            raise SurveyError(f"LaserScanner: num_beams must be at least 2, got {self.num_beams}")
        if not 0 < self.field_of_view <= 2 * np.pi:
            raise SurveyError(f"LaserScanner: field_of_view must lie in (0, 2 pi], got {self.field_of_view}")
        check_positive(self, ("max_range", "edge_step"), SurveyError)
        check_not_negative(
            self, ("noise", "noise_per_meter", "resolution", "spot", "divergence"), SurveyError
        )

    @property
    def angles(self) -> Float[np.ndarray, " B"]:
        """Beam angles [rad], symmetric about 0."""
        return np.linspace(-self.field_of_view / 2, self.field_of_view / 2, self.num_beams)

    def sigma(self, ranges: Ranges) -> Ranges:
        """Return the standard deviation of readings at these ranges [m]."""
        return self.noise + self.noise_per_meter * ranges

    @property
    def directions(self) -> Float[np.ndarray, "B 3"]:
        """Beams in the sensor's x-y plane, unit vectors."""
        return np.stack([np.cos(self.angles), np.sin(self.angles), np.zeros(self.num_beams)], axis=1)

    def scan(
        self, cast: Cast, pose: Pose, rng: np.random.Generator, directions: Directions | None = None
    ) -> tuple[Ranges, Bool[np.ndarray, " R"]]:
        """Take one scan; return the readings [m] (nan: no return) and which of them mix two surfaces.

        Args:
            cast: returns the exact distances.
            pose: sensor -> world; the beams lie in its x-y plane.
            rng: source of the noise; the same number of draws whatever is hit.
            directions: unit vectors in the sensor to read along, in place of its beams.
        """
        directions = self.directions if directions is None else directions
        exact = cast(pose[:3, 3], directions @ pose[:3, :3].T)
        exact[exact > self.max_range] = np.inf
        near, far, is_mixed = self._meet_edges(cast, pose, directions, exact)
        share, error = rng.random(len(exact)), rng.standard_normal(len(exact))
        ranges = exact.copy()
        ranges[is_mixed] = (near + share * (far - near))[is_mixed]
        hits = np.isfinite(ranges)
        ranges[hits] += self.sigma(ranges[hits]) * error[hits]
        if self.resolution:
            ranges[hits] = self.resolution * np.round(ranges[hits] / self.resolution)
        ranges[~hits | (ranges <= 0) | (ranges > self.max_range)] = np.nan
        return ranges, is_mixed & np.isfinite(ranges)

    def _meet_edges(
        self, cast: Cast, pose: Pose, directions: Directions, exact: Ranges
    ) -> tuple[Ranges, Ranges, Bool[np.ndarray, " R"]]:
        """Return the nearest and the farthest surface in every light spot [m], and whether an edge parts them."""
        near, far, is_mixed = np.zeros_like(exact), np.zeros_like(exact), np.zeros(len(exact), bool)
        hits = np.flatnonzero(np.isfinite(exact))
        if not hits.size or (self.spot == 0 and self.divergence == 0):
            return near, far, is_mixed
        radius = (self.spot / exact[hits] + self.divergence)[:, None, None] / 2
        rim = directions[hits, None] + radius * _find_rim(directions[hits])
        rim /= np.linalg.norm(rim, axis=2, keepdims=True)
        depth = cast(pose[:3, 3], rim.reshape(-1, 3) @ pose[:3, :3].T).reshape(hits.size, 4)
        depth[depth > self.max_range] = np.inf
        middle = exact[hits, None]
        is_lost = np.isinf(depth)
        depth = np.where(is_lost, middle, depth)  # nothing behind an edge: no second echo to mix with
        bend = np.abs(depth[:, 0::2] + depth[:, 1::2] - 2 * middle)
        bend[is_lost.reshape(-1, 2, 2).any(axis=2)] = 0.0
        near[hits] = np.minimum(depth.min(axis=1), exact[hits])
        far[hits] = np.maximum(depth.max(axis=1), exact[hits])
        is_mixed[hits] = bend.max(axis=1) > self.edge_step
        return near, far, is_mixed


def _find_rim(directions: Directions) -> Float[np.ndarray, "R 4 3"]:
    """Return four points on the rim of a light spot of radius 1: two in the scan plane, two across it."""
    aside = np.cross([0.0, 0.0, 1.0], directions)
    is_upright = np.linalg.norm(aside, axis=1) < _UPRIGHT
    aside[is_upright] = [1.0, 0.0, 0.0]
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    across = np.cross(directions, aside)
    return np.stack([aside, -aside, across, -across], axis=1)


# The camera beside a range finder looks along the x axis of the sensor, z up in the picture. Its lens is a fisheye, a
# pixel an equal angle everywhere, so that one picture holds all beams of a scan.
_PIXEL = float(np.radians(0.2))  # Angle between neighboring pixels [rad]: 950 pixels over the field of view
_LENS = float(np.radians(190.0))  # Full angle of the lens [rad]
_OFFSET = np.array([0.0, 0.0, 0.08])
"""Of the camera from the range finder, along the sensor's axes [m]: what hides a place from one of them alone takes a
wrong color."""
_EXPOSURE_NOISE = 0.02  # Relative standard deviation of the exposure from one picture to the next
_COLOR_NOISE = 0.02  # Standard deviation of a channel of a pixel, of 1; then it is rounded to bytes
_WHITE = 255


def look_at(
    positions: Float[np.ndarray, "N 3"], pose: Pose, cast: Cast
) -> tuple[Float[np.ndarray, "N 3"], Bool[np.ndarray, " N"]]:
    """Return the places that the pixels show which readings fall on, and which of them show any."""
    center = pose[:3, 3] + pose[:3, :3] @ _OFFSET
    ways = (positions - center) @ pose[:3, :3]
    directions = round_to_pixels(ways, _PIXEL)
    distance = cast(center, directions @ pose[:3, :3].T)
    is_seen = np.isfinite(distance) & (np.arccos(np.clip(directions[:, 0], -1, 1)) <= _LENS / 2)
    length = np.where(is_seen, distance, 0.0)
    return center + length[:, None] * (directions @ pose[:3, :3].T), is_seen


def expose(colors: Float[np.ndarray, "*N 3"], rng: np.random.Generator) -> UInt8[np.ndarray, "*N 3"]:
    """Return colors as the camera measures them in one picture, 0 to 255."""
    measured = colors * (1.0 + _EXPOSURE_NOISE * rng.standard_normal())
    measured = measured + _COLOR_NOISE * rng.standard_normal(colors.shape)
    return np.round(_WHITE * np.clip(measured, 0.0, 1.0)).astype(np.uint8)


def round_to_pixels(ways: Float[np.ndarray, "N 3"], pixel: float) -> Float[np.ndarray, "N 3"]:
    """Return the directions of the middles of the pixels that ways fall on, as unit vectors."""
    aside = np.hypot(ways[:, 1], ways[:, 2])
    angle = np.arctan2(aside, ways[:, 0])
    share = ways[:, 1:] / np.maximum(aside, np.finfo(float).tiny)[:, None]
    middle = pixel * np.round(angle[:, None] * share / pixel)
    angle = np.hypot(*middle.T)
    side = middle / np.maximum(angle, np.finfo(float).tiny)[:, None]
    return np.concatenate([np.cos(angle)[:, None], np.sin(angle)[:, None] * side], axis=1)


_SCAN_PLANE = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Scanner -> robot without a tilt: angle 0 to the right, 90 degrees up."""
_NOT_NEGATIVE = ("rest", "shake", "distance_drift", "turn_drift", "step_noise", "turn_weight", "head_room")


@dataclass(frozen=True)
class SurveyRobot:
    """A differential-drive robot with a mast: speeds, positions of its scanners, its sway, its wheels' errors.

    Attributes:
        scanner: model of both scanners.
        speed: driving speed [m/s].
        turn_rate: turning speed on the spot [rad/s].
        scan_rate: scans a second [Hz]; the LMS 200 reaches 75 Hz at one degree, 37.5 Hz at half a degree.
        rest: standing still at the start [s]: the sway averages out of the first pose.
        mast: height of the vertical scanner above the ground [m]; more over high arenas, see `survey`.
        tilt: its middle beam points to the right and this far below the horizon [rad]; at 60 degrees it sees
            the ground on both sides of the robot, which leveling needs.
        low_height: height of the horizontal scanner above the ground [m].
        shake: standard deviation of the sway in roll and pitch [rad], about the point of contact with the ground.
        shake_memory: correlation of the sway from one scan to the next.
        distance_drift, turn_drift: relative error of the wheels in distance and turning, drawn once a survey
            (standard deviations).
        step_noise: random error of the wheels, per square root of a meter [m] (and [rad]).
        turn_weight: meters that a turn of one radian counts as in that error.
        head_room: the mast is at least this much higher than the arena [m].

    Raises:
        SurveyError: a number is out of range.
    """

    scanner: LaserScanner = field(default_factory=LaserScanner)
    speed: float = 0.25
    turn_rate: float = 1.0
    scan_rate: float = 20.0
    rest: float = 4.0
    mast: float = 2.2
    tilt: float = np.pi / 3
    low_height: float = 0.3
    shake: float = np.radians(0.7)
    shake_memory: float = 0.5
    distance_drift: float = 0.01
    turn_drift: float = 0.02
    step_noise: float = 0.005
    turn_weight: float = 0.2
    head_room: float = 1.0

    def __post_init__(self) -> None:
        check_positive(self, ("speed", "turn_rate", "scan_rate", "mast", "low_height"), SurveyError)
        check_not_negative(self, _NOT_NEGATIVE, SurveyError)
        if not 0 <= self.shake_memory < 1:
            raise SurveyError(f"SurveyRobot: shake_memory must lie in [0, 1), got {self.shake_memory}")

    @property
    def vertical_mount(self) -> Pose:
        """Pose of the vertical scanner in the robot; its plane is the robot's y-z plane."""
        mount = np.eye(4)
        mount[:3, :3] = make_rotation(roll=self.tilt) @ _SCAN_PLANE
        mount[2, 3] = self.mast
        return mount

    @property
    def horizontal_mount(self) -> Pose:
        """Pose of the horizontal scanner in the robot: its middle beam ahead."""
        mount = np.eye(4)
        mount[2, 3] = self.low_height
        return mount
