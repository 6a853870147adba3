"""Domain randomization: what may differ from episode to episode, drawn from the environment's generator."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np
from jaxtyping import Float

from symbrion_gym._src.environment.config import RANDOM_LIMITS, RANDOM_OPTIONS
from symbrion_gym._src.environment.world import World
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.tracks import compute_surface_velocity


class ModelFields(Protocol):
    """A model, or one simulation's part of a batch's model fields."""

    geom_friction: Float[np.ndarray, "ngeom 3"]  # friction coefficients of the geoms
    actuator_forcerange: Float[np.ndarray, "nu 2"]  # smallest and largest torque of the actuators [N m]
    # surface velocity of the geoms, linear [m/s] and angular [rad/s]
    geom_surfacevel: Float[np.ndarray, "ngeom 6"]


class Domain(NamedTuple):
    """The circumstances of one episode."""

    friction: float  # sliding friction of the robot on the ground; friction patches scale with it
    torque_scale: float  # factor on the largest hinge torque
    start_offset: float  # displacement of the start along the route [m]
    start_lateral: float  # displacement of the start to the left [m]
    yaw: float  # rotation of the organism about its head [rad]
    track_speed: float  # surface speed of the tracks [m/s]
    roll: float = 0.0  # the organism turned about the axis of its head at the start [rad]
    # where in their intervals the frictions of all patches lie: 0 in the middle, ±1 at the ends of the 95 %
    # interval
    patch_friction: float = 0.0


def draw_domain(
    nominal: Mapping[str, float],
    options: Mapping[str, Any] | None,
    rng: np.random.Generator,
    *,
    has_patches: bool = True,
) -> Domain:
    """Return the circumstances of one episode."""
    options = options or {}
    for name in options:
        if name not in RANDOM_OPTIONS:
            raise OptionError(f"no reset option {name!r}; there are: {', '.join(RANDOM_OPTIONS)}")
    domain = Domain(*(_draw(name, options.get(name, nominal.get(name)), rng) for name in Domain._fields))
    if domain.patch_friction and not has_patches:
        raise OptionError(
            f"patch_friction is {options['patch_friction']!r}, but the arena has no friction patches; leave it out, or "
            "give an arena with a friction_map"
        )
    return domain


def _draw(name: str, value: Any, rng: np.random.Generator) -> float:
    low, high = RANDOM_LIMITS[name]
    try:
        bounds = np.asarray(value, dtype=np.float64).ravel()
    except (TypeError, ValueError):
        bounds = np.zeros(0)
    if len(bounds) not in (1, 2) or not (
        np.isfinite(bounds).all() and low <= bounds.min() and bounds.max() <= high
    ):
        raise OptionError(
            f"{name} must be a number or a pair (low, high) within {low:g} to {high:g}, got {value!r}"
        )
    if len(bounds) == 1:
        return float(bounds[0])
    if bounds[0] > bounds[1]:
        raise OptionError(f"{name}: the range {value!r} is upside down")
    return float(rng.uniform(bounds[0], bounds[1]))


def split_options(options: Mapping[str, Any] | None, num: int) -> list[dict[str, Any]]:
    """Return the reset options of each of `num` simulations.

    An array or list with `num` entries gives each its own; a tuple (low, high) and a number go to all.
    """
    split: list[dict[str, Any]] = [{} for _ in range(num)]
    for name, value in (options or {}).items():
        if isinstance(value, tuple) or np.ndim(value) == 0:
            values = [value] * num
        elif len(value) == num:
            values = list(value)
        else:
            raise OptionError(
                f"{name} has {len(value)} values for {num} simulations; give one each or a pair"
            )
        for options_of_one, one in zip(split, values, strict=True):
            options_of_one[name] = one
    return split


def make_nominal_domain(world: World) -> Domain:
    """Return the circumstances of an episode for which nothing else was asked."""
    return Domain(world.friction, 1.0, 0.0, 0.0, 0.0, world.organism.scout.track_speed)


def apply_domain(world: World, fields: ModelFields, domain: Domain) -> None:
    """Write circumstances into a model, or into one simulation's part of a batch's model fields."""
    scout, torque = world.organism.scout, world.servo_torque * domain.torque_scale
    fields.geom_friction[world.robot_geoms, 0] = domain.friction
    if len(world.patch_geoms):
        fields.geom_friction[world.patch_geoms, 0] = world.compute_patch_friction(
            domain.friction, domain.patch_friction
        )
    fields.actuator_forcerange[world.hinge_servos] = np.stack([-torque, torque], axis=-1)
    if scout.tracks == "spheres":
        fields.geom_surfacevel[world.track_geoms] = compute_surface_velocity(scout, domain.track_speed)
