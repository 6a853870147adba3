"""Control laws: plain functions from sensed quantities and genotypes to hinge targets.

A population steps as arrays, and the result for one genotype never depends on the others in the batch (element-wise
arithmetic only, to the bit). Hinge i joins module i, counted from the head, to module i + 1 behind it; a positive
angle lifts the part ahead of it.
"""

from collections.abc import Callable, Mapping

import numpy as np
from jaxtyping import Float

from symbrion_gym.robot.scout_constants import ScoutConfig

Sensed = Mapping[str, Float[np.ndarray, "P _"]]
"""Quantities by name, `[P, n]` each, columns from head to tail.

In addition to the sensors of the environment, each 1 or 0: "airborne", a module without ground contact, and
"recent_contact", one whose last contact is recent enough to keep a raised posture (`ControllerConfig`)."""
Law = Callable[[Sensed, Float[np.ndarray, "P G"]], Float[np.ndarray, "P H"]]
"""From quantities and genotypes to hinge targets [rad]."""

SPACING = ScoutConfig().pitch
"""Distance between the modules of a snake [m]."""
NETWORK_INPUTS = ("bias", "pitch_ahead", "pitch_behind", "air_ahead", "air_behind")
NETWORK_INPUTS += ("angle", "place", "head_pitch")
"""Inputs of `network` at each hinge, in the order of its weights."""
REACTIVE_GENES = ("bias", "head_bias", "tail_bias", "pitch_ahead", "pitch_behind")
REACTIVE_GENES += ("front_air", "rear_air", "head_pitch")
"""Genes of `reactive`, in order."""


def reactive(sensed: Sensed, genotype: Float[np.ndarray, "P G"]) -> Float[np.ndarray, "P H"]:
    """Bend each hinge by the pitch of the modules it joins, and lift the ends of the body that are in the air.

    Eight genes whatever the length of the body: a bias for all hinges and one more for the first and
    the last, gains on the pitch ahead and behind, a posture for the modules between the head and the
    first that touches ground and one for those behind the last that does, and a gain from the head's pitch
    to its hinge.
    """
    bias, head_bias, tail_bias, ahead, behind, front_air, rear_air, head_pitch = genotype.T[:, :, None]
    pitch, airborne = sensed["pitch"], sensed["airborne"]
    front = np.multiply.accumulate(airborne, axis=1) * sensed["recent_contact"]
    rear = np.multiply.accumulate(airborne[:, ::-1], axis=1)[:, ::-1] * sensed["recent_contact"]
    target = bias + ahead * pitch[:, :-1]
    target += behind * pitch[:, 1:]
    target += front_air * front[:, :-1]
    target += rear_air * rear[:, 1:]
    target[:, :1] += head_bias + head_pitch * pitch[:, :1]
    target[:, -1:] += tail_bias
    return target


def travelling(
    sensed: Sensed, genotype: Float[np.ndarray, "P G"], knots: Float[np.ndarray, " G"]
) -> Float[np.ndarray, "P H"]:
    """Keep a posture that is fixed to the ground: each hinge takes the angle of the place it passes.

    Whatever angle the head has at a place, every hinge behind it takes there later (follow the leader). Angles are
    joined linearly between knots along the course, 0 beyond them. The position of the head comes from the odometry
    of its tracks (dead reckoning from the start on the map), the positions of the hinges from the pitch of the modules.
    """
    places = sensed["track_odometry"] - np.cumsum(SPACING * np.cos(sensed["pitch"][:, :-1]), axis=1)
    return _interpolate(genotype, places, knots)


def path(
    sensed: Sensed, genotype: Float[np.ndarray, "P G"], knots: Float[np.ndarray, " G"]
) -> Float[np.ndarray, "P H"]:
    """Follow a path over the ground: each module takes the slope that the path has at its place.

    Slopes are joined linearly between knots along the course, 0 beyond them; a hinge takes the difference between the
    slopes of the modules that it joins. In contrast to the angles of `travelling`, a slope bends the body only locally
    and does not rotate distant parts, so that genes act independently. Positions come from track odometry and pitch.
    """
    half = 0.5 * SPACING * np.cos(sensed["pitch"])
    behind = np.cumsum(half[:, :-1] + half[:, 1:], axis=1)
    places = sensed["track_odometry"] - np.pad(behind, ((0, 0), (1, 0)))
    slopes = _interpolate(genotype, places, knots)
    return slopes[:, :-1] - slopes[:, 1:]


def posture(sensed: Sensed, genotype: Float[np.ndarray, "P G"]) -> Float[np.ndarray, "P H"]:
    """Keep one constant angle per hinge, from head to tail (paper, section III-A: the U shape).

    A body shorter than the genotype's reads its first genes.
    """
    return np.array(genotype[:, : sensed["hinge_angle"].shape[1]])


def network(sensed: Sensed, genotype: Float[np.ndarray, "P G"], num_hidden: int) -> Float[np.ndarray, "P H"]:
    """Compute each hinge's angle by a small network with one hidden layer, with the same weights at every hinge."""
    angle, pitch, airborne = sensed["hinge_angle"], sensed["pitch"], sensed["airborne"]
    count = angle.shape[1]
    ones = np.ones_like(angle)
    inputs = (ones, pitch[:, :-1], pitch[:, 1:], airborne[:, :-1], airborne[:, 1:], angle)
    inputs += (ones * np.linspace(-1.0, 1.0, count), ones * pitch[:, :1])
    weights = genotype.T[:, :, None]
    target = weights[-1] * ones
    for unit in range(num_hidden):
        first = unit * len(NETWORK_INPUTS)
        activation = weights[first] * inputs[0]
        for offset in range(1, len(inputs)):
            activation = activation + weights[first + offset] * inputs[offset]
        target = target + weights[num_hidden * len(NETWORK_INPUTS) + unit] * np.tanh(activation)
    return target


def _interpolate(
    genotype: Float[np.ndarray, "P G"], places: Float[np.ndarray, "P n"], knots: Float[np.ndarray, " G"]
) -> Float[np.ndarray, "P n"]:
    """Interpolate linearly between evenly spaced knots at places [m]; 0 beyond them."""
    position = (places - knots[0]) / (knots[1] - knots[0])
    padded = np.pad(genotype, ((0, 0), (1, 1)))
    left = np.clip(np.floor(position), -1, len(knots) - 1).astype(int)
    share = np.clip(position - left, 0.0, 1.0)
    here = np.take_along_axis(padded, left + 1, axis=1)
    there = np.take_along_axis(padded, left + 2, axis=1)
    return here + (there - here) * share
