"""Bare worlds for laws of physics: an organism on boxes, with the environment's options and nothing of its code."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float

from symbrion_gym._src.robot.organism import Organism, snake
from symbrion_gym._src.robot.scout import compute_friction_stiffness
from symbrion_gym._src.robot.scout_constants import ScoutConfig

GRAVITY = 9.81
"""[m/s²]."""
_DEPTH = 0.5
"""Half the height of a box of ground [m]."""
_ABOVE = 0.001
"""Height above the ground at which a robot is put down [m]."""

_START_STEPS = 20
_WHEELS = 10  # Of a module


@dataclass(frozen=True)
class World:
    """What a law is measured in.

    Attributes:
        modules: length of the snake.
        friction: sliding friction.
        timestep: physics step [s].
        scout: other constants of the modules, by name.
    """

    modules: int = 1
    friction: float = 0.7
    timestep: float = 0.005
    scout: dict[str, Any] = field(default_factory=dict)

    @property
    def organism(self) -> Organism:
        """The snake."""
        return snake(self.modules, ScoutConfig(friction=self.friction, **self.scout))


Box = tuple[float, float, float]
"""Ground from x to x [m], and the height of its top [m]."""
FLAT: tuple[Box, ...] = ((-20.0, 20.0, 0.0),)


class Bench:
    """A compiled world with one organism laid straight along x, its head's center at x = 0.

    Args:
        world: robot and options.
        boxes: the ground.
        slope: angle by which gravity is turned, so that the ground rises along the heading [rad].
        heading: of the robot on the ground [rad].
        height: of the ground below the robot [m].
    """

    def __init__(
        self,
        world: World,
        boxes: Sequence[Box] = FLAT,
        slope: float = 0.0,
        heading: float = 0.0,
        height: float = 0.0,
    ) -> None:
        self.world, self.organism = world, world.organism
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        for start, end, top in boxes:
            spec.worldbody.add_geom(
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=[(end - start) / 2, 20.0, _DEPTH],
                pos=[(start + end) / 2, 0.0, top - _DEPTH],
                friction=[world.friction, 0.005, 0.0001],
            )
        self.organism.add_to(spec, spec.worldbody)
        _set_options(spec, world)
        self.model = spec.compile()
        self.model.opt.gravity[:] = GRAVITY * np.array(
            [-np.sin(slope) * np.cos(heading), -np.sin(slope) * np.sin(heading), -np.cos(slope)]
        )
        self.data = mujoco.MjData(self.model)
        radius = self.organism.scout.size[2] / 2
        self.data.qpos[:3] = [0.0, 0.0, height + radius + _ABOVE]
        self.data.qpos[3:7] = [np.cos(heading / 2), 0.0, 0.0, np.sin(heading / 2)]
        names = [self.model.geom(i).name for i in range(self.model.ngeom)]
        self.driving = np.array([i for i, name in enumerate(names) if "_track_" in name])
        self.left = np.array([int(names[i].rsplit("_", 1)[1]) < _WHEELS / 2 for i in self.driving])
        self.drive(0.0)

    def drive(self, left: float, right: float | None = None) -> None:
        """Set the surface speed of the tracks [m/s], both alike unless the right is given."""
        speed = np.where(self.left, left, left if right is None else right)
        self.model.geom_surfacevel[self.driving, 4] = speed / self.organism.scout.track_radius

    def start(self, left: float, right: float | None = None, seconds: float = 1.0) -> None:
        """Bring the tracks to their speed evenly, as an abrupt start would tip a module over."""
        for step in range(1, _START_STEPS + 1):
            share = step / _START_STEPS
            self.drive(share * left, None if right is None else share * right)
            self.step(seconds / _START_STEPS)

    def step(self, seconds: float) -> None:
        """Step the physics."""
        mujoco.mj_step(self.model, self.data, nstep=round(seconds / self.model.opt.timestep))

    @property
    def places(self) -> Float[np.ndarray, "modules 3"]:
        """Centers of the modules [m]."""
        mujoco.mj_kinematics(self.model, self.data)
        return np.array([self.data.site(f"module_{i}").xpos for i in range(self.world.modules)])

    @property
    def up(self) -> Float[np.ndarray, " modules"]:
        """Cosine of each module's tilt from the normal of the ground."""
        mujoco.mj_kinematics(self.model, self.data)
        return np.array([self.data.site(f"module_{i}").xmat[8] for i in range(self.world.modules)])


def _set_options(spec: mujoco.MjSpec, world: World) -> None:
    """Set the options that the environment uses."""
    option = spec.option
    option.timestep = world.timestep
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
    option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, compute_friction_stiffness(world.modules)
