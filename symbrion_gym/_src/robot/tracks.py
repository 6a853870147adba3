"""How a module touches the ground: wheels of its tracks, which are spheres with a surface velocity, and contacts."""

from collections.abc import Sequence

import mujoco
import numpy as np

from symbrion_gym._src.robot.scout_constants import CONTACT_GROUP, ScoutConfig

_FRICTION_STIFFNESS = (12.0, 1.5)
"""Of friction against that of contacts, over the number of modules, and the least: at rest on 20° they creep by less
than 0.1 mm/s, a few modules faster than many if it were the same for all. More of it costs more time."""
CONTACT_TIME = 0.01
"""Time in which a contact of the robot gives way, of MuJoCo's `solref` [s]: twice the usual physics step, the stiffest
that stays stable. With twice as much, robots sink by more than 10 mm where friction is high."""
MIDDLE_RISE = 0.002  # Of the middle wheel of a track above the outer ones [m] (estimate)
_OTHER_FRICTION = (0.005, 0.0001)
"""Torsional and rolling friction: MuJoCo's defaults, without effect in contacts of three dimensions."""
_CONTACT_COLOR = (0.9, 0.4, 0.1, 0.0)  # Transparent, so that rays pass


def compute_friction_stiffness(num_modules: int) -> float:
    """Return how much stiffer friction is than contacts for a body: MuJoCo's `impratio`."""
    few, least = _FRICTION_STIFFNESS
    return max(few / num_modules, least)


def set_physics(option: mujoco.MjOption, timestep: float, num_modules: int = 1) -> None:
    """Set how robots are simulated: friction alike in all directions, a dense Newton solver.

    Sparse matrices are factored wrongly by MuJoCo 4.0.0 from 60 degrees of freedom on.
    """
    option.timestep = timestep
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, compute_friction_stiffness(num_modules)
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)


def find_road_wheels(config: ScoutConfig) -> list[tuple[float, float, float]]:
    """Return the centers of the wheels of both tracks in the frame of the module, the left side before the right [m].

    Five a side: three below and two above, so that the envelope is the chassis with rounded edges. The middle one
    does not reach level ground, as in the authors' simulator a track stands on two wheels (danfis/sim); it drives where
    an edge is between them.
    """
    half_x, half_y, half_z = (edge / 2 - config.track_radius for edge in config.size)
    middle = (0.0, MIDDLE_RISE - half_z)
    places = [(half_x, -half_z), middle, (-half_x, -half_z), (half_x, half_z), (-half_x, half_z)]
    return [(x, y, z) for y in (half_y, -half_y) for x, z in places]


def compute_surface_velocity(config: ScoutConfig, speed: float) -> tuple[float, ...]:
    """Return the surface velocity of a road wheel that drives forward: linear [m/s], then angular [rad/s].

    It turns about its own y axis: at the ground the surface runs backwards, at a wall ahead it runs down.
    """
    return (0.0, 0.0, 0.0, 0.0, speed / config.track_radius, 0.0)


def add_tracks(frame: mujoco.MjsFrame, body: mujoco.MjsBody, prefix: str, config: ScoutConfig) -> None:
    """Add both tracks of a module to a body; `frame` is that of the module."""
    for i, place in enumerate(find_road_wheels(config)):
        name, size = f"{prefix}track_{i}", [config.track_radius]
        geom = add_contact(frame, body, name, mujoco.mjtGeom.mjGEOM_SPHERE, size, config, pos=place)
        geom.surfacevel = compute_surface_velocity(config, config.track_speed)


def add_contact(
    frame: mujoco.MjsFrame,
    body: mujoco.MjsBody,
    name: str,
    kind: int,
    size: Sequence[float] | np.ndarray,
    config: ScoutConfig,
    pos: Sequence[float] = (0.0, 0.0, 0.0),
    mass: float = 0.0,
) -> mujoco.MjsGeom:
    """Add a geom that touches, is not drawn and is not seen by rays; its friction replaces the ground's."""
    geom = body.add_geom(
        name=name,
        type=kind,
        size=[*size, 0.0, 0.0][:3],
        pos=pos,
        mass=mass,
        group=CONTACT_GROUP,
        condim=3,
        priority=1,
        friction=[config.friction, *_OTHER_FRICTION],
        rgba=_CONTACT_COLOR,
        solref=[CONTACT_TIME, 1.0],
    )
    geom.set_frame(frame)
    return geom
