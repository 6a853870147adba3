"""Friction by place: where a module dragged its tracks, the ground held with all that friction gives.

A module whose tracks run at another speed than the ground passes slips, and the ground pulls at it with the friction
times the load: ``T = mu N``. Newton's law for the module gives both, with f the reading of the accelerometers, which
feel forces and not gravity, and D the pull of the dock: ``T = m f_x - D_x``, ``N = m f_z - D_z``. Slopes and
accelerated motion change nothing in this. It is the locked-wheel test of roads (ASTM E274) between docked robots.

A track that runs as fast as the ground passes holds with less than friction gives, and tells nothing: the slip, the
commanded speed less the speed by localization, decides which drags count. So a robot that slides down a slope, or spins
its tracks before one that it cannot climb, feels the ground as well.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.scans.slip_readings import SlipReadings

_ROUNDING = 1e-6  # Times closer than this are the same [s]
_GAUSSIAN = 1.4826  # Standard deviation of a normal distribution in median absolute deviations
_LEAST_SLIP = 0.10
"""Slip from which tracks hold with all that friction gives [m/s]; below it the force rises with slip."""
_SETTLING = 0.16  # What of a drag is left out at its beginning, as the body still swings [s]
_WINDOW = 0.16
"""Each reading of friction is a mean over this; longer ones are less noisy and know less of where [s]."""
_BEND = 0.03
"""A pitch that changes by more from before a drag to after it: the robot bridges a knick, and some of its
tracks are in the air [rad]."""
_LEAST_LOAD = 0.5
"""The ground carries less than this share of the weight: the module is held up by the others."""
_MOST_LOAD = 1.6  # And more than this: it carries others
_PAIR_DISTANCE = 0.2  # Drags in opposite directions closer than this are on the same ground [m]
_REPLACED = 0.2
"""Old readings this close to a new one are out of date [m]: twice the way from one drag to the next."""

# What is known of the sensors before the robot drives, as standard deviations (estimates):
_GAIN = 0.015
"""Relative error of the force in the dock and of the mass, alike in all readings: a strain gauge is calibrated with
weights to 1 or 2 %."""
_LOAD_BIAS = 0.15  # Offset of the load, alike in all readings [N]
_PULL_BIAS = 0.5  # Offset of the pull before any drag [N]; drags in both directions tell it
_TILT = 0.008
"""Angle between the frame of the sensors and the ground, by mounting, bending of the hinges and uneven ground [rad];
friction is wrong by as much."""
_NOISE = 0.01  # Of the friction that one drag shows, at least: ground differs from place to place


class FrictionReadings(NamedTuple):
    """Friction by place, one row a drag."""

    places: Float[np.ndarray, "D 3"]  # middle of the module during the drag [m]
    frictions: Float[np.ndarray, " D"]  # friction of the ground below it
    sigmas: Float[np.ndarray, " D"]  # standard deviation of each by noise
    # standard deviation by errors that readings of one ground have in common, which do not average out
    shared: Float[np.ndarray, " D"]
    runs: Int[np.ndarray, " D"]  # number of the uninterrupted drive


class _Drags(NamedTuple):
    """Means over the drags: place, run, sign of the slip, pull and load [N]."""

    places: Float[np.ndarray, "D 3"]
    runs: Int[np.ndarray, " D"]
    signs: Float[np.ndarray, " D"]
    pulls: Float[np.ndarray, " D"]
    loads: Float[np.ndarray, " D"]


def find_friction(readings: SlipReadings) -> FrictionReadings:
    """Return the friction at every place where tracks slipped."""
    drags = _select_drags(readings)
    if not len(drags.runs):
        nothing = np.zeros(0)
        return FrictionReadings(np.zeros((0, 3)), nothing, nothing, nothing, np.zeros(0, dtype=np.int64))
    bias, bias_error = _estimate_pull_bias(drags)
    frictions = np.maximum(drags.signs * (drags.pulls - bias) / drags.loads, 0.0)
    load = np.median(drags.loads)
    shared = np.hypot(frictions * np.hypot(_GAIN, _LOAD_BIAS / load), _TILT)
    sigmas = np.full(len(frictions), _estimate_noise(frictions, drags.runs, _NOISE))
    return FrictionReadings(drags.places, frictions, np.hypot(sigmas, bias_error / load), shared, drags.runs)


def _select_drags(readings: SlipReadings) -> _Drags:
    starts = np.r_[True, (np.diff(readings.commanded) != 0.0) | (np.diff(readings.runs) != 0)]
    parts = np.split(np.arange(len(readings)), np.flatnonzero(starts)[1:])
    rows = []
    for before, part, after in zip([None, *parts], parts, [*parts[1:], None], strict=False):
        if len(part) and _is_even(readings, part, before, after):
            rows += _measure(readings, part)
    if not rows:
        return _Drags(np.zeros((0, 3)), np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0), np.zeros(0))
    return _Drags(*(np.array(column) for column in zip(*rows, strict=True)))


def _is_even(
    readings: SlipReadings,
    part: Int[np.ndarray, " P"],
    before: Int[np.ndarray, " B"] | None,
    after: Int[np.ndarray, " A"] | None,
) -> bool:
    """Return whether the pitch is the same before, during and after a drag."""
    pitch = readings.pitches[part]
    for other in (before, after):
        if other is not None and readings.runs[other[0]] == readings.runs[part[0]]:
            half = other[len(other) // 2 :] if other is before else other[: len(other) // 2 + 1]
            if abs(readings.pitches[half].mean() - pitch.mean()) > _BEND:
                return False
    return bool(np.ptp(pitch) <= 2 * _BEND)


def _measure(
    readings: SlipReadings, part: Int[np.ndarray, " P"]
) -> list[tuple[Float[np.ndarray, " 3"], int, float, float, float]]:
    """Return place, run, sign, pull and load of every window of a drag that tells something."""
    times = readings.times[part] - readings.times[part[0]] - _SETTLING
    numbers = np.floor(times / _WINDOW + _ROUNDING).astype(np.int64)
    tick = float(np.median(np.diff(readings.times))) if len(readings) > 1 else 0.0
    whole = np.flatnonzero(np.bincount(numbers[numbers >= 0]) * tick >= _WINDOW - _ROUNDING)
    rows = []
    for window in (part[numbers == number] for number in whole):
        slip = float(readings.commanded[window[0]]) - _estimate_speed(readings, window)
        specific, dock = (array[window].mean(axis=0) for array in (readings.accelerations, readings.forces))
        pull, _, load = readings.mass * specific - dock
        weight = readings.mass * float(np.linalg.norm(specific))
        carries = _LEAST_LOAD * weight < load < _MOST_LOAD * weight
        if abs(slip) >= _LEAST_SLIP and carries:
            place = readings.positions[window].mean(axis=0)
            rows.append(
                (place, int(readings.runs[window[0]]), float(np.sign(slip)), float(pull), float(load))
            )
    return rows


def _estimate_speed(readings: SlipReadings, part: Int[np.ndarray, " P"]) -> float:
    """Return the speed ahead, along the ground, by a line through the places [m/s]."""
    heading = np.median(readings.headings[part])
    pitch = float(np.median(readings.pitches[part]))
    ahead = np.array([np.cos(heading) * np.cos(pitch), np.sin(heading) * np.cos(pitch), np.sin(pitch)])
    times = readings.times[part] - readings.times[part[0]]
    return float(np.polyfit(times, readings.positions[part] @ ahead, 1)[0])


def _estimate_pull_bias(drags: _Drags) -> tuple[float, float]:
    """Return the offset of the pull and its standard deviation [N].

    Two drags in opposite directions on the same ground: ``T_1 - b = mu N_1``, ``T_2 - b = -mu N_2``.
    """
    first = np.flatnonzero((drags.signs[1:] != drags.signs[:-1]) & (drags.runs[1:] == drags.runs[:-1]))
    apart = np.linalg.norm(drags.places[first + 1] - drags.places[first], axis=1)
    first = first[apart < _PAIR_DISTANCE]
    if not len(first):
        return 0.0, _PULL_BIAS
    one, other = 1 / drags.loads[first], 1 / drags.loads[first + 1]
    found = (drags.pulls[first] * one + drags.pulls[first + 1] * other) / (one + other)
    bias = float(np.median(found))
    spread = _GAUSSIAN * float(np.median(np.abs(found - bias)))
    error = max(spread, _NOISE * float(np.median(drags.loads))) * np.sqrt(np.pi / 2 / len(found))
    share = _PULL_BIAS**2 / (_PULL_BIAS**2 + error**2)
    return share * bias, float(np.sqrt(share) * error)


def _estimate_noise(frictions: Float[np.ndarray, " D"], runs: Int[np.ndarray, " D"], least: float) -> float:
    """Return the standard deviation of a drag from the differences of those that follow each other."""
    steps = np.diff(frictions)[np.diff(runs) == 0]
    if not len(steps):
        return max(least, 0.05)
    return max(least, _GAUSSIAN * float(np.median(np.abs(steps))) / np.sqrt(2.0))


def join_slip(
    known: FrictionReadings | None, slip: SlipReadings | None, offset: Float[np.ndarray, " 3"]
) -> FrictionReadings | None:
    """Return friction by place after new slip; the known one where there is none."""
    if slip is None:
        return known
    if not isinstance(slip, SlipReadings):
        raise ReconstructionError(
            f"slip must be SlipReadings, as `ScanLog.slip` is, got {type(slip).__name__}"
        )
    new = find_friction(slip)
    new = new._replace(places=new.places - offset)
    if known is None or not len(new.frictions):
        return new if known is None else known
    from scipy.spatial import cKDTree

    distance = cKDTree(new.places).query(known.places)[0]
    kept = FrictionReadings(*(array[distance > _REPLACED] for array in known))
    shift = int(kept.runs.max()) + 1 if len(kept.runs) else 0
    new = new._replace(runs=new.runs + shift)
    return FrictionReadings(*(np.concatenate(pair) for pair in zip(kept, new, strict=True)))


def read_slip_arrays(arrays: Mapping[str, np.ndarray]) -> FrictionReadings | None:
    """Return friction by place from the arrays `slip_...` of a file; None where there are none."""
    if "slip_places" not in arrays:
        return None
    found = FrictionReadings(*(np.asarray(arrays[f"slip_{name}"]) for name in FrictionReadings._fields))
    count = len(found.places)
    is_right = found.places.shape == (count, 3) and all(array.shape == (count,) for array in found[1:])
    if not is_right or not all(np.isfinite(array).all() for array in found):
        raise ReconstructionError("slip must be finite numbers of one length; restore the file from a copy")
    return found
