"""A SICK LMS 200 as it measures: noise, millimeter steps, a beam with a width, and mixed pixels at edges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from reconstruction._src.base.range_checks import check_not_negative, check_positive
from symbrion_gym._src.errors import SurveyError

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

    def sigma(self, ranges: Float[np.ndarray, " R"]) -> Float[np.ndarray, " R"]:
        """Return the standard deviation of readings at these ranges [m]."""
        return self.noise + self.noise_per_meter * ranges

    @property
    def directions(self) -> Float[np.ndarray, "B 3"]:
        """Beams in the sensor's x-y plane, unit vectors."""
        return np.stack([np.cos(self.angles), np.sin(self.angles), np.zeros(self.num_beams)], axis=1)

    def scan(
        self, cast: Cast, pose: Float[np.ndarray, "4 4"], rng: np.random.Generator
    ) -> tuple[Float[np.ndarray, " B"], Bool[np.ndarray, " B"]]:
        """Take one scan; return the readings [m] (nan: no return) and which of them mix two surfaces.

        Args:
            cast: returns the exact distances.
            pose: sensor -> world; the beams lie in its x-y plane.
            rng: source of the noise; the same number of draws whatever is hit.
        """
        return self.measure(cast, pose, self.directions, rng)

    def measure(
        self,
        cast: Cast,
        pose: Float[np.ndarray, "4 4"],
        directions: Float[np.ndarray, "R 3"],
        rng: np.random.Generator,
    ) -> tuple[Float[np.ndarray, " R"], Bool[np.ndarray, " R"]]:
        """Read along any directions (unit vectors in the sensor); otherwise as `scan`."""
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
        self,
        cast: Cast,
        pose: Float[np.ndarray, "4 4"],
        directions: Float[np.ndarray, "R 3"],
        exact: Float[np.ndarray, " R"],
    ) -> tuple[Float[np.ndarray, " R"], Float[np.ndarray, " R"], Bool[np.ndarray, " R"]]:
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


def _find_rim(directions: Float[np.ndarray, "R 3"]) -> Float[np.ndarray, "R 4 3"]:
    """Return four points on the rim of a light spot of radius 1: two in the scan plane, two across it."""
    aside = np.cross([0.0, 0.0, 1.0], directions)
    is_upright = np.linalg.norm(aside, axis=1) < _UPRIGHT
    aside[is_upright] = [1.0, 0.0, 0.0]
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    across = np.cross(directions, aside)
    return np.stack([aside, -aside, across, -across], axis=1)
