"""An organism on its tracks in an arena, with one speed a side."""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Float

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.spec import SURFACE_GROUP
from symbrion_gym._src.environment.config import SnakePitConfig
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.traversability.footprint import Footprint

_SETTLING = 100
"""Physics steps at rest after a robot has been put down."""


class TrackedRobot:
    """An organism on its tracks in an arena: both sides of all modules have one speed each; hinges stay straight.

    Attributes:
        model: the arena with the organism.
        data: its state.
        organism: what drives.
        half_length: half of its length when it is straight [m].
    """

    def __init__(self, arena: Arena, organism: Organism) -> None:
        """Compile the arena with the organism; the exact surface, which nothing touches, is left out."""
        spec = arena.spec()
        for geom in [geom for geom in spec.worldbody.geoms if geom.group == SURFACE_GROUP]:
            spec.delete(geom)
        organism.add_to(spec, spec.worldbody)
        spec.option.timestep = SnakePitConfig().timestep
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.organism = organism
        self.half_length = Footprint.of(organism).length / 2
        self._sites = [self.model.site(f"module_{i}").id for i in range(organism.num_modules)]
        tracks = [i for i in range(self.model.ngeom) if "_track_" in self.model.geom(i).name]
        is_left = [int(self.model.geom(i).name.rsplit("_", 1)[1]) < 5 for i in tracks]
        self._left = [i for i, left in zip(tracks, is_left, strict=True) if left]
        self._right = [i for i, left in zip(tracks, is_left, strict=True) if not left]
        poses = np.array([(pose.x, pose.y) for pose in organism.find_poses()])
        self._middle = poses.mean(axis=0)

    @property
    def center(self) -> Float[np.ndarray, " 3"]:
        """Mean of the centers of the modules [m]."""
        return self.data.site_xpos[self._sites].mean(axis=0)

    @property
    def heading(self) -> float:
        """Direction of the first module in plan [rad]."""
        matrix = self.data.site_xmat[self._sites[0]]
        return float(np.arctan2(matrix[3], matrix[0]))

    @property
    def tilt(self) -> float:
        """Angle between the vertical and the upper side of the module that leans most [rad]; above pi/2 it lies."""
        return float(np.arccos(np.clip(self.data.site_xmat[self._sites, 8].min(), -1.0, 1.0)))

    def put_down(
        self, heading: float, point: Float[np.ndarray, " 3"], normal: Float[np.ndarray, " 3"]
    ) -> None:
        """Put the robot on the ground, and let it come to rest.

        Args:
            heading: direction in plan [rad].
            point: where the middle of the robot touches the ground [m].
            normal: unit normal of the ground there.
        """
        mujoco.mj_resetData(self.model, self.data)
        ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
        ahead -= normal * (ahead @ normal)
        ahead /= np.linalg.norm(ahead)
        axes = np.column_stack([ahead, np.cross(normal, ahead), normal])
        middle = np.append(self._middle, -self.organism.scout.size[2] / 2)
        self.data.qpos[:3] = point - axes @ middle
        mujoco.mju_mat2Quat(self.data.qpos[3:7], axes.ravel())
        self.step(0.0, 0.0, _SETTLING)

    def step(self, left: float, right: float, steps: int) -> None:
        """Drive with a speed of the tracks on either side [m/s] for a number of physics steps."""
        radius = self.organism.scout.track_radius
        self.model.geom_surfacevel[self._left, 4] = left / radius
        self.model.geom_surfacevel[self._right, 4] = right / radius
        mujoco.mj_step(self.model, self.data, nstep=steps)
