"""Mixed pixels: readings of beams that met an edge, and lie between two surfaces or near one of them.

References:
    Ye and Borenstein (2002), Characterization of a 2-D laser scanner for mobile robot obstacle negotiation: mixed
    pixels of the SICK LMS 200.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import uniform_filter1d
from scipy.spatial import cKDTree

from reconstruction._src.geometry.rows import compute_lengths, sum_rows
from reconstruction._src.scans.scan import ScanLog
from reconstruction._src.scans.selection import find_flat

_STEP = 0.10  # Two such steps of one sign make a veil point [m]: nine times the noise of a SICK LMS 200
_STEP_SPACING = float(np.radians(0.5))
"""Beams at most this far apart [rad] have such steps; for coarser scanners the step grows in proportion, as that of
a surface at an angle does. Half a degree is the SICK LMS 200."""
_SAME_SPACING = 1.01  # Spacings that differ by less are the same: angles come with rounding errors
_JUMP = 0.03  # Height of the lowest edge, at range 0 [m]: several times the noise of a step
_JUMP_PER_METER = 0.003  # Growth of that height with the range. 0.003 finds a ledge of 4 cm at 3 m.
_MAX_SHARE = 0.02  # Largest share of the valid readings that may go by jumps and clutter
_CLUTTER_WINDOW = 9  # Beams of the window in which mixed readings are counted
_CLUTTER_COUNT = 4  # A window with as many is clutter: two jumps within nine beams are an edge along the scan
_CLUTTER_HEIGHT = 1e-3  # What a reading in clutter counts [m] where not all may go: less than any jump
_MAX_GAP = 0.10
"""A mixed reading stays where no other is left within this [m], and it lies with its neighbors on a surface
(`select_needed_beams`): walls far away, or at a low angle, step as edges do. As `_STEP`: what is read less densely
has such steps on any slanted surface."""
_FLAT_NEIGHBORS = 10  # Neighbors that show whether it lies on one
_FLATNESS = 0.1  # Their least variance over the largest; noise of 2 cm at gaps of 10 cm gives 0.05
_MIN_COSINE = 0.05
"""Least cosine between the beam and the normal of that plane. A veil along a straight edge lies in the beams:
0. 0.05 are 3 degrees, a floor 1 m below the sensor 20 m away."""


def find_mixed_beams(
    ranges: Float[np.ndarray, "S B"], angles: Float[np.ndarray, " B"]
) -> Bool[np.ndarray, "S B"]:
    """Find the beams that may have met an edge.

    1. *Veil points*: ``|r_i - r_(i-1)| > step`` and ``|r_(i+1) - r_i| > step`` with the same sign. The reading lies
       between two surfaces, or on one at such an angle that its position is uncertain.
    2. *Jumps*: a beam on either side of a jump (`find_jumps`). A mixture of much of one surface and little of the
       other cannot be distinguished by its range from the better of the two: each counts with the height of its
       jumps [m].
    3. *Clutter*: every beam with four of 1 and 2 among the nine around it; an edge along the scan plane.

    In a cluttered scene 2 and 3 would cost a tenth of the beams: those with the highest jumps go, at most 2 % of all
    valid beams.
    """
    spacing = float(np.median(np.abs(np.diff(angles)))) if len(angles) > 1 else _STEP_SPACING
    step = _STEP * spacing / _STEP_SPACING if spacing > _SAME_SPACING * _STEP_SPACING else _STEP
    bridged = _bridge_gaps(ranges)
    difference = np.diff(bridged, axis=1)
    is_valid = np.isfinite(ranges)
    is_veil = np.zeros(ranges.shape, bool)
    rising, falling = difference > step, difference < -step
    is_veil[:, 1:-1] = (rising[:, 1:] & rising[:, :-1]) | (falling[:, 1:] & falling[:, :-1])
    is_jump = find_jumps(bridged, _JUMP, _JUMP_PER_METER)
    step_height = np.pad(np.where(is_jump, np.abs(difference), 0.0), ((0, 0), (1, 1)))
    height = step_height[:, 1:] + step_height[:, :-1]
    around = uniform_filter1d(
        (is_veil | (height > 0)).astype(np.float32), _CLUTTER_WINDOW, axis=1, mode="constant"
    )
    is_cluttered = around > (_CLUTTER_COUNT - 0.5) / _CLUTTER_WINDOW
    height[is_cluttered & (height == 0)] = _CLUTTER_HEIGHT
    height[is_veil | ~is_valid] = 0.0
    max_count = int(_MAX_SHARE * np.count_nonzero(is_valid))
    if np.count_nonzero(height) > max_count:
        place = height.size - max_count - 1
        height[height <= np.partition(height, place, axis=None)[place]] = 0.0
    return (is_veil | (height > 0)) & is_valid


def select_needed_beams(log: ScanLog, is_mixed: Bool[np.ndarray, "S B"]) -> Bool[np.ndarray, "S B"]:
    """Return which mixed readings stay: without them a sparsely read surface would have a hole.

    A far wall, or one at a low angle, has steps between neighboring beams that look like veil points in a single
    scan. In space its readings lie on a plane, among others as far apart; those of a veil do not, or the plane
    contains the beam.
    """
    is_needed = np.zeros(is_mixed.shape, bool)
    points, place = log.points(), np.flatnonzero(log.is_valid)
    is_dropped = is_mixed[log.is_valid]
    chosen = np.flatnonzero(is_dropped)
    if not len(chosen) or is_dropped.all():
        return is_needed
    gap, _ = cKDTree(points[~is_dropped]).query(points[chosen])
    chosen = chosen[gap > _MAX_GAP]
    is_flat, _, _, normals = find_flat(points, chosen, _FLAT_NEIGHBORS, _FLATNESS)
    ray = points[chosen] - log.poses[place[chosen] // is_mixed.shape[1], :3, 3]
    cosine = np.abs(sum_rows(normals * ray)) / np.maximum(compute_lengths(ray), 1e-300)
    is_needed.ravel()[place[chosen[is_flat & (cosine > _MIN_COSINE)]]] = True
    return is_needed


def find_jumps(
    ranges: Float[np.ndarray, "S B"], jump: float = 0.03, jump_per_meter: float = 0.004
) -> Bool[np.ndarray, "S B-1"]:
    """Find where two neighboring beams are on no common surface.

    On a plane 1/r goes as cos(a - a0), so steps of 1/r change little from beam to beam at any angle of incidence:
    beams i and i+1 are separated by a jump where both ``|r_(i+1) - r_i|`` and ``r_i r_(i+1) |s_i - s_j|``,
    ``s_i = 1/r_(i+1) - 1/r_i``, for all but one of the four neighboring steps j (two on either side), exceed
    ``jump + jump_per_meter sqrt(r_i r_(i+1))``, several times the noise of a step (10 to 15 mm).
    """
    step = np.diff(1.0 / ranges, axis=1)
    num_steps = step.shape[1]
    padded = np.pad(step, ((0, 0), (2, 2)), constant_values=np.nan)
    distances = np.abs(np.stack([step - padded[:, k : k + num_steps] for k in (0, 1, 3, 4)]))
    second = np.partition(np.where(np.isnan(distances), np.inf, distances), 1, axis=0)[1]
    product = ranges[:, 1:] * ranges[:, :-1]
    threshold = jump + jump_per_meter * np.sqrt(product)
    with np.errstate(invalid="ignore"):
        return (second * product > threshold) & (np.abs(np.diff(ranges, axis=1)) > threshold)


def _bridge_gaps(ranges: Float[np.ndarray, "S B"]) -> Float[np.ndarray, "S B"]:
    """Fill single beams without return by the mean of 1/r on both sides: planes stay planes, jumps stay jumps."""
    inverse = 1.0 / ranges
    bridged = ranges.copy()
    if ranges.shape[1] >= 3:
        mean = 2.0 / (inverse[:, 2:] + inverse[:, :-2])
        bridged[:, 1:-1] = np.where(np.isnan(ranges[:, 1:-1]), mean, ranges[:, 1:-1])
    return bridged
