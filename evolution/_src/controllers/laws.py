"""Control laws: plain functions from sensed quantities and genotypes to hinge targets, on any tree of modules.

A population steps as arrays, and the result for one genotype never depends on the others in the batch (element-wise
arithmetic only). Each hinge joins its own module to the one ahead, docked to its front; a positive angle
lifts what is ahead. In a snake, hinge i joins module i, counted from the head, to module i + 1 behind it.
"""

from collections.abc import Callable, Mapping
from typing import Any

from jaxtyping import Float

from evolution._src.controllers.joints import Joints, find_namespace

Sensed = Mapping[str, Float[Any, "P _"]]
"""Quantities by name, one column for each module or hinge.

In addition to the sensors of the environment: "inclination_ahead", see `Joints`, and each 1 or 0: "airborne", a module
without ground contact, and "recent_contact", one whose last contact is recent enough to keep a raised posture."""
Law = Callable[[Sensed, Float[Any, "P G"], Joints], Float[Any, "P H"]]
"""From quantities and genotypes to hinge targets [rad]."""

REACTIVE_GENES = ("bias", "head_bias", "tail_bias", "pitch_ahead", "pitch_behind")
REACTIVE_GENES += ("front_air", "rear_air", "head_pitch")
"""Genes of `reactive`, in order."""


def reactive(sensed: Sensed, genotype: Float[Any, "P G"], joints: Joints) -> Float[Any, "P H"]:
    """Bend each hinge by the pitch of the modules it joins, and lift the parts of the body that are in the air.

    Eight genes whatever the body: a bias for all hinges, one more for those of the head and one for those of the ends
    of the tree, gains on the pitch ahead and behind, a posture for a hinge whose part ahead hangs in the air as a
    whole and one where the part behind does, and a gain from the head's pitch to its hinges. In a snake, these parts
    are the modules before the first and behind the last that touches ground.
    """
    bias, head_bias, tail_bias, ahead, behind, front_air, rear_air, head_pitch = genotype.T[:, :, None]
    pitch, touches = sensed["pitch"], 1.0 - sensed["airborne"]
    front = (touches @ joints.ahead_part.T == 0) * sensed["recent_contact"][:, joints.ahead]
    rear = (touches @ ~joints.ahead_part.T == 0) * sensed["recent_contact"][:, joints.own]
    xp = find_namespace(genotype)
    at_head = xp.where(joints.own == 0, pitch[:, :1], sensed["inclination_ahead"])
    target = bias + ahead * sensed["inclination_ahead"]
    target = target + behind * pitch[:, joints.own]
    target = target + front_air * front
    target = target + rear_air * rear
    target = xp.where(joints.is_head, target + (head_bias + head_pitch * at_head), target)
    return xp.where(joints.is_tail, target + tail_bias, target)


def path(
    sensed: Sensed, genotype: Float[Any, "P G"], joints: Joints, knots: Float[Any, " G"], spacing: float
) -> Float[Any, "P H"]:
    """Follow a path over the ground: each module takes the slope that the path has at its place.

    Slopes are joined linearly between knots along the course, 0 beyond them; a hinge takes the difference between the
    slopes of the modules that it joins, as far as it bends along the course. A slope bends the body only locally and
    does not rotate distant parts, so that genes act independently. Positions come from track odometry and pitch.
    """
    xp = find_namespace(genotype)
    half = (0.5 * spacing * xp.cos(sensed["pitch"])).T
    behind = [xp.zeros_like(half[0])] * len(half)
    for module in joints.order:
        parent = joints.parents[module]
        behind[module] = behind[parent] + joints.steps[module] * (half[parent] + half[module])
    slopes = _interpolate(genotype, sensed["track_odometry"] - xp.stack(behind).T, knots)
    return (slopes[:, joints.ahead] - slopes[:, joints.own]) * joints.along


def posture(sensed: Sensed, genotype: Float[Any, "P G"], joints: Joints) -> Float[Any, "P H"]:
    """Keep one constant angle per hinge, in the order of the modules (paper, section III-A: the U shape).

    A body shorter than the genotype's reads its first genes.
    """
    return genotype[:, : len(joints.own)].copy()


def _interpolate(
    genotype: Float[Any, "P G"], places: Float[Any, "P n"], knots: Float[Any, " G"]
) -> Float[Any, "P n"]:
    """Interpolate linearly between evenly spaced knots at places [m]; 0 beyond them."""
    position = (places - knots[0]) / (knots[1] - knots[0])
    xp = find_namespace(genotype)
    padded = xp.pad(genotype, ((0, 0), (1, 1)))
    left = xp.clip(xp.floor(position), -1, len(knots) - 1).astype(int)
    share = xp.clip(position - left, 0.0, 1.0)
    here = xp.take_along_axis(padded, left + 1, axis=1)
    there = xp.take_along_axis(padded, left + 2, axis=1)
    return here + (there - here) * share
