"""What may differ from episode to episode: how it is drawn, and how an episode begins with it."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from reconstruction._src.base.range_checks import check_choice
from symbrion_gym._src.environment.config import RANDOM_OPTIONS, read_random_range
from symbrion_gym._src.environment.world import World
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.scout import compute_surface_velocity

VARIED = ("geom_friction", "actuator_forcerange", "geom_surfacevel")
"""Fields of the model that differ between simulations."""


class Domain(NamedTuple):
    """The circumstances of one episode."""

    friction: float  # sliding friction of the robot on the ground; friction patches scale with it
    torque_scale: float  # factor on the largest hinge torque
    start_offset: float  # displacement of the start along the route [m]
    start_lateral: float  # displacement of the start to the left [m]
    yaw: float  # rotation of the organism about its head [rad]
    track_speed: float  # surface speed of the tracks [m/s]
    # where in their intervals the frictions of all patches lie: 0 in the middle, ±1 at the ends of the 95 %
    # interval
    patch_friction: float = 0.0


def make_nominal_domain(world: World) -> Domain:
    """Return the circumstances of an episode for which nothing else was asked."""
    return Domain(world.friction, 1.0, 0.0, 0.0, 0.0, world.organism.scout.track_speed)


def draw_domain(world: World, options: Mapping[str, Any], rng: np.random.Generator) -> Domain:
    """Return the circumstances of one episode."""
    wanted = {**world.config.randomize, **options}
    for name in wanted:
        check_choice("reset options", name, RANDOM_OPTIONS, OptionError)
    nominal = make_nominal_domain(world)._asdict()
    domain = Domain(*(_draw(name, wanted.get(name, nominal[name]), rng) for name in Domain._fields))
    if domain.patch_friction and not len(world.patch_geoms):
        raise OptionError(
            f"patch_friction is {wanted['patch_friction']!r}, but the arena has no friction patches; leave it out, or "
            "give an arena with a friction_map"
        )
    return domain


def _draw(name: str, value: Any, rng: np.random.Generator) -> float:
    bounds = read_random_range(name, value)
    return float(bounds[0] if len(bounds) == 1 else rng.uniform(bounds[0], bounds[1]))


def begin_episode(
    world: World,
    domain: Domain,
    fields: Any,  # a model, or one simulation's part of the fields `VARIED` of a batch
    qpos: Float[np.ndarray, " nq"],
    control: Float[np.ndarray, " nu"],
) -> None:
    """Write what a simulation begins with under some circumstances: fields of its model, pose and controls."""
    scout, torque = world.organism.scout, world.servo_torque * domain.torque_scale
    fields.geom_friction[world.robot_geoms, 0] = domain.friction
    if len(world.patch_geoms):
        patches = world.compute_patch_friction(domain.friction, domain.patch_friction)
        fields.geom_friction[world.patch_geoms, 0] = patches
    fields.actuator_forcerange[world.hinge_servos] = np.stack([-torque, torque], axis=-1)
    fields.geom_surfacevel[world.track_geoms] = compute_surface_velocity(scout, domain.track_speed)
    qpos[:] = world.lay_down(domain.start_offset, domain.start_lateral, domain.yaw)
    control[world.servos] = qpos[world.hinge_qpos]


def split_reset(
    options: Mapping[str, Any] | None, num: int
) -> tuple[Bool[np.ndarray, " N"], list[dict[str, Any]]]:
    """Return which of `num` simulations are reset, and the reset options of each.

    An array or list with `num` entries gives each its own; a tuple (low, high) and a number go to all.
    """
    given = dict(options or {})
    mask = np.asarray(given.pop("reset_mask", np.ones(num)), dtype=bool)
    if mask.shape != (num,):
        raise OptionError(f"reset_mask has shape {mask.shape}; give one value for each of {num}")
    split: list[dict[str, Any]] = [{} for _ in range(num)]
    for name, value in given.items():
        is_shared = isinstance(value, tuple) or np.ndim(value) == 0
        if not is_shared and len(value) != num:
            raise OptionError(
                f"{name} has {len(value)} values for {num} simulations; give one each or a pair"
            )
        for row, one in enumerate(split):
            one[name] = value if is_shared else value[row]
    return mask, split
