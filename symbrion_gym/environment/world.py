"""An organism in an arena, compiled: the model, what is where in it, and how the organism is laid on the ground."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from reconstruction.geometry.pose import PlanarPose, make_quaternion
from symbrion_gym.arenas.arena import Arena
from symbrion_gym.arenas.spec import CONTACT_GROUP as ARENA_CONTACT_GROUP
from symbrion_gym.arenas.stretch import stretch_arena
from symbrion_gym.environment.arena_and_organism import find_arena, find_organism
from symbrion_gym.environment.config import SnakePitConfig
from symbrion_gym.environment.rendering import add_scene
from symbrion_gym.errors import ArenaError
from symbrion_gym.robot.organism import Organism, snake
from symbrion_gym.robot.organism_sensors import add_sensors
from symbrion_gym.robot.tracks import find_wheel_radius
from symbrion_gym.tasks.route import find_route
from symbrion_gym.tasks.success_check import SuccessCheck

_LIFT = 0.002
"""Gap between the tracks and the ground at the start [m]: without one, contacts would begin with a push."""
_SAMPLES = 0.005
"""Spacing of the heights along the start line [m], small against a module."""
_LINE_MARGIN = 0.2
"""The line of heights reaches this much farther than the organism at both ends [m]."""
_FOOTPRINT = 0.06 * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0], [0.0, 0.0]])
"""Points of a module over which the highest ground is taken where organisms are no snakes [m]: a little beyond its
sides, which are 0.0525 m from its center."""
_NUM_ITERATIONS = 8
"""Of the fixed-point iteration that puts a module's end on the ground."""
_SMALLEST_STEP = 0.2
"""A module stands no steeper than this share of its length along the ground."""
_STRETCH = 20
"""The ground on a storey is followed over as many samples at a time: a module's length."""
_STOREY_RISE = 0.10
"""Ground that rises by more than this over such a stretch is what hangs above, not ground [m]."""
_SAME = 1e-9
"""Numbers closer than this are equal but for rounding."""


class Physics(NamedTuple):
    """The state of N simulations, as live views or copies.

    Attributes:
        qpos: generalized coordinates.
        qvel: their velocities.
        position: centers of the modules [m], one physics step behind qpos.
        rotation: their rotation matrices, row by row, likewise.
        sensordata: readings of MuJoCo's sensors, likewise.
        actuator_force: forces of the hinges [N m], then of the wheels, likewise.
    """

    qpos: Float[np.ndarray, "N nq"]
    qvel: Float[np.ndarray, "N nv"]
    position: Float[np.ndarray, "N n 3"]
    rotation: Float[np.ndarray, "N n 9"]
    sensordata: Float[np.ndarray, "N S"]
    actuator_force: Float[np.ndarray, "N nu"]


class World:
    """A compiled arena with an organism in it.

    Attributes:
        config: the options.
        arena: arena of the simulation.
        organism: organism in it.
        route: the way to go.
        map_route: the way as the map has it, without `stretch`.
        model: the compiled model; change a copy, as simulations share it.
        friction: sliding friction of the robot on everything.
        modules: ids of the modules' bodies, or of their sites, a slice where they follow each other.
        is_by_site: whether the modules are found by their sites, as some share a body.
        hinge_qpos: addresses of the hinges in qpos, `[h]`.
        hinge_dof: addresses of the hinges in qvel, `[h]`.
        is_sliced: whether `modules` is a slice, so that a view stays live.
        wheel_radius: radius of the driven wheels or spheres [m].
        robot_geoms: ids of the geoms of the robot that touch.
        hinge_servos: ids of the hinges' actuators, `[h]`.
        wheel_servos: ids of the wheels' actuators, module by module; none with sphere tracks.
        track_geoms: `[n, T]` ids of the geoms that drive, per module.
    """

    def __init__(self, config: SnakePitConfig, image_size: tuple[int, int] = (640, 400)) -> None:
        self._image_size = image_size
        self.config = config
        on_map = find_arena(config)
        self.arena = stretch_arena(on_map, config.stretch)
        self.friction = float(self.arena.friction if config.friction is None else config.friction)
        self.organism = find_organism(config, self.friction)
        ends = *config.find_ends(), config.margins, config.pit_search
        self.map_route = find_route(on_map, self.organism, *ends)
        self.route = self.map_route if self.arena is on_map else find_route(self.arena, self.organism, *ends)
        self._poses = self.organism.find_poses()
        self._is_snake = self.organism == snake(self.organism.num_modules, self.organism.scout)
        self.model = self._make_spec().compile()
        self._find_ids()

    def _make_spec(self) -> mujoco.MjSpec:
        spec = self.arena.spec()
        add_scene(spec, *self._image_size)
        self.organism.add_to(spec, spec.worldbody)
        add_sensors(spec, self.organism, self.config.sensors, self.config.dt)
        for geom in spec.worldbody.geoms:
            if geom.group == ARENA_CONTACT_GROUP:
                geom.rgba[3] = 0.0  # rays shall see the exact surface alone
        option = spec.option
        option.timestep = self.config.timestep
        option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        option.solver = mujoco.mjtSolver.mjSOL_NEWTON
        option.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL
        option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        return spec

    def _find_ids(self) -> None:
        model, organism = self.model, self.organism
        sites = [model.site(f"module_{i}") for i in range(organism.num_modules)]
        self.is_by_site = any(np.abs(site.pos).max() > _SAME or abs(site.quat[3]) > _SAME for site in sites)
        ids = [site.id if self.is_by_site else site.bodyid[0] for site in sites]
        follow = ids == list(range(ids[0], ids[0] + len(ids)))
        self.modules = slice(ids[0], ids[0] + len(ids)) if follow else np.array(ids)
        self.is_sliced = follow
        self.wheel_radius = find_wheel_radius(organism.scout)
        hinges = [model.joint(f"hinge_{i}") for i in organism.hinges]
        self.hinge_qpos = np.array([hinge.qposadr[0] for hinge in hinges], dtype=np.int64)
        self.hinge_dof = np.array([hinge.dofadr[0] for hinge in hinges], dtype=np.int64)
        self.hinge_servos = np.array(
            [model.actuator(f"hinge_{i}").id for i in organism.hinges], dtype=np.int64
        )
        self._servos = make_slice(self.hinge_servos)
        self.wheel_servos = np.array(
            [i for i in range(model.nu) if "_wheel_" in model.actuator(i).name], dtype=np.int64
        )
        self.robot_geoms = np.flatnonzero((model.geom_bodyid > 0) & (model.geom_contype > 0))
        names = [model.geom(int(i)).name for i in self.robot_geoms]
        self.track_geoms = np.array(
            [
                [
                    g
                    for g, name in zip(self.robot_geoms, names, strict=True)
                    if name.startswith(f"module_{i}_track")
                ]
                for i in range(organism.num_modules)
            ]
        )

    @property
    def num_modules(self) -> int:
        """Number of modules."""
        return self.organism.num_modules

    @property
    def num_hinges(self) -> int:
        """Number of working hinges."""
        return len(self.hinge_qpos)

    def make_success_check(self) -> SuccessCheck:
        """Return the success check of this arena and organism."""
        config = self.config
        return SuccessCheck(
            self.arena,
            self.organism,
            self.route,
            self.map_route,
            config.dt,
            config.bottomless,
            config.criteria,
        )

    def view(self, fields: Callable[[str], np.ndarray]) -> Physics:
        """Return the physics behind named fields `[N, ...]`, as views where modules follow each other.

        Args:
            fields: from the name of a field of `MjData` to its values in every simulation.
        """
        places = ("site_xpos", "site_xmat") if self.is_by_site else ("xpos", "xmat")
        position, rotation = (fields(name)[:, self.modules] for name in places)
        qpos, qvel, sensordata, force = map(fields, ("qpos", "qvel", "sensordata", "actuator_force"))
        return Physics(qpos, qvel, position, rotation, sensordata, force)

    def write_control(
        self,
        control: Float[np.ndarray, "N nu"],
        target: Float[np.ndarray, "N h"],
        track_speed: Float[np.ndarray, "N tracks"],
    ) -> None:
        """Write the servos' controls.

        Args:
            control: written in place.
            target: target of the hinges [rad].
            track_speed: one per simulation or one per module [m/s]; only wheels with joints read it here.
        """
        control[:, self._servos] = target
        if len(self.wheel_servos):
            rate = np.broadcast_to(track_speed, (len(control), self.num_modules)) / self.wheel_radius
            control[:, self.wheel_servos] = np.repeat(
                rate, len(self.wheel_servos) // self.num_modules, axis=1
            )

    def write_track_speed(
        self, field: Float[np.ndarray, "N ngeom 6"], track_speed: Float[np.ndarray, "N tracks"]
    ) -> None:
        """Write the surface velocity of sphere tracks.

        Args:
            field: values of `geom_surfacevel`, written in place.
            track_speed: one per simulation or one per module [m/s].
        """
        if not len(self.wheel_servos):
            field[:, self.track_geoms, 4] = (track_speed / self.wheel_radius)[:, :, None]

    def lay_down(
        self, offset: float = 0.0, lateral: float = 0.0, yaw: float = 0.0
    ) -> Float[np.ndarray, " nq"]:
        """Return qpos of an organism at rest on the ground at the start, bent as the ground is.

        Args:
            offset: the start moved along the route [m].
            lateral: displacement of the start to its left [m].
            yaw: the organism turned about its head [rad].

        Raises:
            ArenaError: the start lies off the surface.
        """
        route, organism = self.route, self.organism
        head_x, head_y = (float(v) for v in route.place(route.start + offset, lateral))
        heading = route.heading + yaw
        qpos = self.model.qpos0.copy()
        back = np.arange(
            -_LINE_MARGIN, (organism.num_modules + 1) * organism.scout.pitch + _LINE_MARGIN, _SAMPLES
        )
        x, y = head_x - np.cos(heading) * back, head_y - np.sin(heading) * back
        heights = _roll_over(self._find_heights(x, y), organism.scout.size[2] / 2) + _LIFT
        if self._is_snake:
            z, pitch, hinges = _follow_ground(back, heights, organism)
            qpos[self.hinge_qpos] = hinges
        else:
            pitch = 0.0
            head = PlanarPose(head_x, head_y, heading)
            world = [head.compose(pose) for pose in self._poses]
            xy = np.array([(pose.x, pose.y) for pose in world])
            spots = np.concatenate([xy + point for point in _FOOTPRINT])
            z = (
                float(np.max(self._find_heights(spots[:, 0], spots[:, 1])))
                + organism.scout.size[2] / 2
                + _LIFT
            )
        qpos[:3] = head_x, head_y, z
        qpos[3:7] = make_quaternion(heading, -pitch)
        return qpos

    def _find_heights(
        self, x: Float[np.ndarray, " S"], y: Float[np.ndarray, " S"]
    ) -> Float[np.ndarray, " S"]:
        """Return ground heights; beyond the rim, the nearest known one along the line."""
        level = self.route.start_height
        if level is None:
            heights = np.asarray(self.arena.height(x, y), dtype=np.float64)
        else:
            heights = _follow_storey(self.arena, x, y, level)
        known = np.flatnonzero(np.isfinite(heights))
        if not len(known):
            raise ArenaError(
                f"the start ({x[0]:.2f}, {y[0]:.2f}) lies off the surface of arena {self.arena.name!r}"
            )
        return np.interp(np.arange(len(heights)), known, heights[known])


def _follow_storey(
    arena: Arena, x: Float[np.ndarray, " S"], y: Float[np.ndarray, " S"], level: float
) -> Float[np.ndarray, " S"]:
    """Return heights of the ground on the storey of a start, below what hangs above it; nan where there is none."""
    heights = np.full(len(x), np.nan)
    for first in range(0, len(x), _STRETCH):
        some = slice(first, first + _STRETCH)
        heights[some] = arena.elevation.height_below(x[some], y[some], level + _STOREY_RISE)
        known = heights[some][np.isfinite(heights[some])]
        level = float(known[-1]) if len(known) else level
    return heights


def _roll_over(heights: Float[np.ndarray, " S"], radius: float) -> Float[np.ndarray, " S"]:
    """Return how high the center of a disc rolls over ground heights sampled every `_SAMPLES`."""
    from scipy.ndimage import grey_dilation

    reach = int(radius / _SAMPLES)
    shift = np.arange(-reach, reach + 1)
    rise = np.sqrt(np.maximum(radius**2 - (shift * _SAMPLES) ** 2, 0.0))
    return grey_dilation(heights, structure=rise, mode="nearest")


def _follow_ground(
    back: Float[np.ndarray, " S"], heights: Float[np.ndarray, " S"], organism: Organism
) -> tuple[float, float, Float[np.ndarray, " h"]]:
    """Lay a snake on a height line, head at 0; return head height, head pitch and hinge angles."""
    pitch, count = organism.scout.pitch, organism.num_modules
    s, z = np.zeros(count + 1), np.zeros(count + 1)
    z[0] = np.interp(0.0, back, heights)
    for i in range(1, count + 1):
        step = pitch
        for _ in range(_NUM_ITERATIONS):
            z[i] = np.interp(s[i - 1] + step, back, heights)
            step = np.sqrt(max(pitch**2 - (z[i] - z[i - 1]) ** 2, (_SMALLEST_STEP * pitch) ** 2))
        s[i] = s[i - 1] + step
    nose_up = np.arctan2(z[:-1] - z[1:], s[1:] - s[:-1])
    limit = organism.scout.hinge_range
    return float(z[0]), float(nose_up[0]), np.clip(nose_up[:-1] - nose_up[1:], -limit, limit)


def make_slice(ids: np.ndarray) -> slice | np.ndarray:
    """Return ids as a slice where they follow each other: a view costs less than a copy."""
    if len(ids) and (np.diff(ids) == 1).all():
        return slice(int(ids[0]), int(ids[-1]) + 1)
    return ids
