"""An organism in an arena, compiled: the model, and what is where in it."""

import logging
from collections.abc import Callable
from dataclasses import asdict, fields
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from reconstruction._src.geometry.pose import PlanarPose
from symbrion_gym._src.arenas.arena import Arena, stretch_arena
from symbrion_gym._src.arenas.checks import FRICTION_LIMITS
from symbrion_gym._src.arenas.course import COURSES, make_course
from symbrion_gym._src.arenas.friction_map import find_piece_patches
from symbrion_gym._src.arenas.making import load_arena
from symbrion_gym._src.arenas.spec import CONTACT_GROUP as ARENA_CONTACT_GROUP
from symbrion_gym._src.arenas.spec import PATCH_PRIORITY
from symbrion_gym._src.environment.config import (
    MAX_MODULES,
    SCOUT_OPTIONS,
    EnvironmentConfig,
    apply_options,
    check_count,
)
from symbrion_gym._src.environment.laying import LIFT, GroundPlacement, Settler, compute_depth
from symbrion_gym._src.environment.rendering import add_scene
from symbrion_gym._src.errors import ArenaError, OrganismError
from symbrion_gym._src.robot.body_plans import load_organism
from symbrion_gym._src.robot.organism import Organism, add_sensors
from symbrion_gym._src.robot.scout import find_road_wheels, set_physics
from symbrion_gym._src.robot.scout_constants import ScoutConfig
from symbrion_gym._src.tasks.state import Scene

logger = logging.getLogger(__name__)
_MADE_IN_CODE = ("truth", "simple", "stairs")


def find_arena(config: EnvironmentConfig) -> Arena:
    """Return the arena of the options; `pit` resizes the arenas made in code."""
    arena = config.arena
    if not isinstance(arena, Arena | str | Path):
        raise ArenaError(f"arena must be a name, a path or an Arena, got {arena!r}")
    if arena in _MADE_IN_CODE:
        return _make_course_arena(str(arena), config)
    if config.course:
        raise ArenaError(
            f"sizes of a course go with an arena made in code, {', '.join(_MADE_IN_CODE)}, not with {str(arena)!r}"
        )
    progress = config.progress or _log_progress
    found = arena if isinstance(arena, Arena) else load_arena(arena, progress=progress)
    if config.pit is not None and getattr(found.course, "pit", None) != config.pit:
        raise ArenaError(
            f"the pit of arena {found.name!r} cannot be set to {config.pit}, as it has its own pit; {config.pit} works "
            "with the courses made in code: truth, simple"
        )
    return found


def _make_course_arena(name: str, config: EnvironmentConfig) -> Arena:
    """Return an arena made in code in other sizes; those that are not given are the course's own."""
    kind = "stairs" if name == "stairs" else "pit"
    pit = config.default_pit if config.pit is None else config.pit
    if kind == "stairs" and config.pit is not None:
        raise ArenaError(f"arena 'stairs' has no pit; leave out the option pit, {config.pit}")
    sizes = {"kind": kind, **asdict(COURSES[kind]()), **config.default_course.get(name, {}), **config.course}
    if kind == "pit" and pit is not None:
        sizes["pit"] = pit
    return load_arena(name, course=make_course(sizes))


def _log_progress(message: str, fraction: float) -> None:
    logger.info("%3.0f %% %s", 100 * fraction, message)


def find_organism(config: EnvironmentConfig, friction: float) -> Organism:
    """Return the organism of the options, with the constants of its modules that they name."""
    if isinstance(config.modules, str | Path):
        raise OrganismError(
            f"modules must be a number or an Organism, got {config.modules!r}; names go to organism"
        )
    organism = load_organism(config.modules if config.organism is None else config.organism)
    if organism.num_modules > MAX_MODULES:
        raise OrganismError(
            f"{organism.num_modules} modules are too many; at most {MAX_MODULES} are possible"
        )
    usual = {entry.name: entry.default for entry in fields(EnvironmentConfig)}
    wanted = {name: value for name in SCOUT_OPTIONS if (value := getattr(config, name)) != usual[name]}
    if organism.scout.friction == ScoutConfig.friction:
        wanted = {"friction": friction} | wanted
    return apply_options(organism, wanted)


_SUNK = 0.005
"""A snake that follows a line on the ground may reach this deep into what rises beside the line; else it is settled as
other bodies are [m]."""
_TIPPED = 0.1
"""A lone module that turns by more as it settles was not at rest on its line, but about to tip over an edge [rad]."""
_SAME = 1e-9  # Numbers closer than this are equal but for rounding
_MANY_PIECES = 300
"""From so many on, the poses of static geoms take a third of a step. To leave them out, MuJoCo wants an `MjData` of
each simulation's own, which costs more than it saves where pieces are few."""


class Physics(NamedTuple):
    """The state of N simulations, as live views or copies."""

    qpos: Float[np.ndarray, "N nq"]  # generalized coordinates
    qvel: Float[np.ndarray, "N nv"]  # their velocities
    position: Float[np.ndarray, "N n 3"]  # centers of the modules [m], one physics step behind qpos
    rotation: Float[np.ndarray, "N n 9"]  # their rotation matrices, row by row, likewise
    sensordata: Float[np.ndarray, "N S"]  # readings of MuJoCo's sensors, likewise
    actuator_force: Float[np.ndarray, "N nu"]  # forces of the hinges [N m], likewise


class World:
    """A compiled arena with an organism in it."""

    def __init__(self, config: EnvironmentConfig, image_size: tuple[int, int] = (640, 400)) -> None:
        self.config = config
        width, height = (check_count(*pair) for pair in zip(("width", "height"), image_size, strict=True))
        on_map = find_arena(config)
        self.task = config.find_task()
        place = self.task.start.place
        self.arena = stretch_arena(on_map, config.stretch, 0.0 if isinstance(place, str) else float(place[0]))
        self.organism = find_organism(config, float(self.arena.friction))
        self.friction = float(self.organism.scout.friction)  # of the robot on the ground, outside of patches
        self.map_route = self.task.find_route(on_map, self.organism)  # as the map has it, without `stretch`
        self.route = (
            self.map_route if self.arena is on_map else self.task.find_route(self.arena, self.organism)
        )
        self.scene = Scene(self.arena, self.organism, self.route, self.map_route)
        self._placement = GroundPlacement(self.arena, self.organism, self.route.start_height)
        self.model = self.make_spec(width, height).compile()  # change a copy, as simulations share it
        self._find_ids()

    def make_spec(self, width: int = 640, height: int = 400) -> mujoco.MjSpec:
        """Return a new spec of the arena with the organism in it; images have a size in pixels."""
        spec = self.arena.spec()
        add_scene(spec, width, height)
        root = self.organism.add_to(spec, spec.worldbody)
        add_sensors(spec, self.organism, self.config.sensor_names, self.config.dt)
        for geom in spec.worldbody.geoms:
            if geom.group == ARENA_CONTACT_GROUP:
                geom.rgba[3] = 0.0  # rays shall see the exact surface alone
        set_physics(spec.option, self.config.timestep, self.organism.num_modules)
        # One tree of bodies is one island: looking for more takes 5 % of a step.
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
        if len(self.arena.pieces) > _MANY_PIECES:  # with sleep, static geoms stay where they were put
            spec.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)
            root.sleep = mujoco.mjtSleepPolicy.mjSLEEP_NEVER
        return spec

    def _find_ids(self) -> None:
        model, organism = self.model, self.organism
        self.num_modules, scout = organism.num_modules, organism.scout
        sites = [model.site(f"module_{i}") for i in range(self.num_modules)]
        # Modules are found by their sites where some share a body; as a slice, so that views of them stay live.
        self.is_by_site = any(np.abs(site.pos).max() > _SAME or abs(site.quat[3]) > _SAME for site in sites)
        self.modules = make_slice(
            np.array([site.id if self.is_by_site else site.bodyid[0] for site in sites])
        )
        self.is_sliced = isinstance(self.modules, slice)
        # Joints with a servo: hinges, then rotations of arms if modules have two joints.
        joints = [model.joint(name) for name in organism.servos]
        self.num_hinges = len(joints)
        self.hinge_qpos = np.array([joint.qposadr[0] for joint in joints], dtype=np.int64)
        self.hinge_dof = np.array([joint.dofadr[0] for joint in joints], dtype=np.int64)
        self.hinge_servos = np.array([model.actuator(name).id for name in organism.servos], dtype=np.int64)
        self.servos = make_slice(self.hinge_servos)
        self.servo_range = model.actuator_ctrlrange[self.hinge_servos, 1].copy()  # largest angles [rad]
        self.servo_torque = model.actuator_forcerange[self.hinge_servos, 1].copy()  # [N m]
        # What drives the tracks, module by module, left before right.
        modules, wheels = range(self.num_modules), range(len(find_road_wheels(scout)))
        self.track_geoms = np.array(
            [[model.geom(f"module_{i}_track_{k}").id for k in wheels] for i in modules]
        )
        self.robot_geoms = np.flatnonzero((model.geom_bodyid > 0) & (model.geom_contype > 0))
        self.patch_geoms = np.flatnonzero((model.geom_bodyid == 0) & (model.geom_priority == PATCH_PRIORITY))
        self._patches = self._find_patches()

    def _find_patches(self) -> tuple[Float[np.ndarray, " P"], Float[np.ndarray, " P"]]:
        """Return friction and half-width of the interval of the patch of every piece that lies in one."""
        found = self.arena.friction_map
        if found is None:
            return np.zeros(0), np.zeros(0)
        numbers = [number for number in find_piece_patches(self.arena.pieces, found) if number >= 0]
        patches = [found.patches[number] for number in numbers]
        return np.array([each.friction for each in patches]), np.array([each.half_width for each in patches])

    def compute_patch_friction(self, friction: float, place: float = 0.0) -> Float[np.ndarray, " P"]:
        """Return the friction of the pieces in patches.

        Rubber that holds better holds better everywhere: patches keep their ratio to the friction of the ground.
        """
        middle, half_width = self._patches
        ratio = friction / self.arena.friction
        return np.clip((middle + place * half_width) * ratio, *FRICTION_LIMITS)

    def view(self, fields: Callable[[str], np.ndarray]) -> Physics:
        """Return the physics behind named fields `[N, ...]`, as views where modules follow each other."""
        places = ("site_xpos", "site_xmat") if self.is_by_site else ("xpos", "xmat")
        position, rotation = (fields(name)[:, self.modules] for name in places)
        qpos, qvel, sensordata, force = map(fields, ("qpos", "qvel", "sensordata", "actuator_force"))
        return Physics(qpos, qvel, position, rotation, sensordata, force)

    def write_track_speed(
        self, field: Float[np.ndarray, "N ngeom 6"], track_speed: Float[np.ndarray, "N tracks"]
    ) -> None:
        """Write the surface velocity of the tracks: their rate about the lateral axis."""
        rates = self.compute_rates(track_speed, np)
        field[:, self.track_geoms, 4] = rates.reshape(-1, *self.track_geoms.shape)

    def compute_rates(self, track_speed: Float[Any, "N tracks"], xp: Any) -> Float[Any, "N T"]:
        """Return the rates of what drives [rad/s]: alike in a body, a module, or a side of a module."""
        (modules, wheels), speed = self.track_geoms.shape, track_speed[:, :, None]
        if track_speed.shape[1] == 2 * modules:
            speed = track_speed.reshape(-1, modules, 2).repeat(wheels // 2, axis=2)
        speed = xp.broadcast_to(speed, (len(track_speed), modules, wheels))
        return speed.reshape(len(speed), -1) / self.organism.scout.track_radius

    def lay_down(
        self, offset: float = 0.0, lateral: float = 0.0, yaw: float = 0.0
    ) -> Float[np.ndarray, " nq"]:
        """Return qpos of an organism at rest on the ground at the start, bent as the ground is."""
        route = self.route
        x, y = (float(v) for v in route.place(route.start + offset, lateral))
        qpos = self.model.qpos0.copy()
        qpos[:7], hinges = self._placement.lay(PlanarPose(x, y, route.heading + yaw))
        qpos[self.hinge_qpos[: len(hinges)]] = hinges
        has_sunk = compute_depth(self.model, self._probe, qpos) > _SUNK
        if self._placement.is_snake and self.num_modules > 1 and not has_sunk:
            return qpos
        settled = self._settler.settle(qpos, LIFT)
        has_tipped = abs(settled[3:7] @ qpos[3:7]) < np.cos(_TIPPED / 2)
        return settled if has_tipped or has_sunk or not self._placement.is_snake else qpos

    @cached_property
    def _probe(self) -> mujoco.MjData:
        return mujoco.MjData(self.model)

    @cached_property
    def _settler(self) -> Settler:
        sites = np.array([self.model.site(f"module_{i}").id for i in range(self.num_modules)])
        return Settler(self.model, sites, self.hinge_dof, self.organism.scout.size[2] / 2)


def make_slice(ids: np.ndarray) -> slice | np.ndarray:
    """Return ids as a slice where they follow each other: a view costs less than a copy."""
    if len(ids) and (np.diff(ids) == 1).all():
        return slice(int(ids[0]), int(ids[-1]) + 1)
    return ids
