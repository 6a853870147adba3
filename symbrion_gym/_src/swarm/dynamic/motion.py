"""How robots move, apart from any model: poses, velocities, momentum and kinetic energy."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from symbrion_gym._src.robot.scout import make_scout
from symbrion_gym._src.robot.scout_constants import ScoutConfig

FOLDED = np.pi / 2  # Angle of the hinge of an arm that is folded up [rad]


class Motion(NamedTuple):
    """Poses and velocities of N robots in the arena."""

    position: Float[np.ndarray, "N 3"]  # centers of the chassis [m]
    rotation: Float[np.ndarray, "N 3 3"]  # from the frames of the chassis to the arena
    velocity: Float[np.ndarray, "N 3"]  # of the centers [m/s]
    spin: Float[np.ndarray, "N 3"]  # rates of rotation in the arena [rad/s]
    hinge: Float[np.ndarray, " N"]  # angles of the hinges [rad]
    hinge_rate: Float[np.ndarray, " N"]  # [rad/s]


class Part(NamedTuple):
    """A rigid part of a Scout: its mass [kg], center of mass [m] and inertia [kg m²] in the frame of the part."""

    mass: float
    center: Float[np.ndarray, " 3"]
    inertia: Float[np.ndarray, "3 3"]


class PartMotion(NamedTuple):
    """One part of each of N robots."""

    mass: float  # of the part [kg]
    center: Float[np.ndarray, "N 3"]  # its centers of mass in the arena [m]
    velocity: Float[np.ndarray, "N 3"]  # of those [m/s]
    spin: Float[np.ndarray, "N 3"]  # [rad/s]
    inertia: Float[np.ndarray, "N 3 3"]  # about those, in the arena [kg m²]


@lru_cache(maxsize=8)
def find_parts(scout: ScoutConfig) -> tuple[Part, Part]:
    """Return chassis and arm of a Scout; the frame of the arm is that of the module, turned by the hinge."""
    model = make_scout(scout).compile()
    parts = []
    for name in ("scout", "arm"):
        body = model.body(name)
        axes = np.empty(9)
        mujoco.mju_quat2Mat(axes, body.iquat)
        axes = axes.reshape(3, 3)
        parts.append(Part(float(body.mass[0]), body.ipos.copy(), axes @ np.diag(body.inertia) @ axes.T))
    return parts[0], parts[1]


def compute_part_motions(motion: Motion, scout: ScoutConfig) -> tuple[PartMotion, PartMotion]:
    """Return how chassis and arms move."""
    frames = motion.rotation
    lift = np.zeros((len(frames), 3, 3))
    cosine, sine = np.cos(motion.hinge), np.sin(motion.hinge)
    lift[:, 0, 0], lift[:, 0, 2], lift[:, 1, 1] = cosine, -sine, 1.0
    lift[:, 2, 0], lift[:, 2, 2] = sine, cosine
    arm_spin = motion.spin - frames[:, :, 1] * motion.hinge_rate[:, None]
    moving = []
    for part, axes, spin in zip(
        find_parts(scout), (frames, frames @ lift), (motion.spin, arm_spin), strict=True
    ):
        lever = axes @ part.center
        inertia = axes @ part.inertia @ np.swapaxes(axes, 1, 2)
        velocity = motion.velocity + np.cross(spin, lever)
        moving.append(PartMotion(part.mass, motion.position + lever, velocity, spin, inertia))
    return moving[0], moving[1]


def compute_momentum(
    motion: Motion, scout: ScoutConfig
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Return the momentum of all robots [kg m/s] and their angular momentum about the origin [kg m²/s]."""
    linear, angular = np.zeros(3), np.zeros(3)
    for part in compute_part_motions(motion, scout):
        push = part.mass * part.velocity
        turning = np.einsum("nij,nj->ni", part.inertia, part.spin)
        linear += push.sum(axis=0)
        angular += (turning + np.cross(part.center, push)).sum(axis=0)
    return linear, angular


def compute_kinetic_energy(motion: Motion, scout: ScoutConfig) -> Float[np.ndarray, " N"]:
    """Return the kinetic energy of each robot [J], that of its motor's inertia included."""
    energy = 0.5 * scout.hinge_armature * motion.hinge_rate**2
    for part in compute_part_motions(motion, scout):
        energy = energy + 0.5 * part.mass * (part.velocity**2).sum(axis=1)
        energy = energy + 0.5 * np.einsum("ni,nij,nj->n", part.spin, part.inertia, part.spin)
    return energy


def compute_jump(before: Motion, after: Motion) -> tuple[float, float, float]:
    """Return the largest jump of a robot: position [m], angle of chassis or arm [rad], velocity [m/s]."""
    position = np.linalg.norm(after.position - before.position, axis=1).max()
    between = np.einsum("nji,njk->nik", before.rotation, after.rotation)
    twist = between - np.swapaxes(between, 1, 2)
    angle = np.arcsin(np.clip(np.linalg.norm(twist, axis=(1, 2)) / np.sqrt(8.0), 0.0, 1.0)).max()
    arm = np.abs(after.hinge - before.hinge).max()
    velocity = np.linalg.norm(after.velocity - before.velocity, axis=1).max()
    return float(position), float(max(angle, arm)), float(velocity)
