"""Pictures of a swarm whose motion is known: free Scouts in the model of the arena, no physics."""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Float, UInt8

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.environment.rendering import SceneRenderer, add_scene
from symbrion_gym._src.robot.scout import make_scout
from symbrion_gym._src.robot.scout_constants import ScoutConfig

VIEW_LENGTH = 1.8
"""The camera stays as far away as from an organism of this length [m]: it shows most of a swarm."""
ELEVATION = -32.0  # Of the camera [deg]


class SwarmCamera:
    """Draws N Scouts wherever they are told to be.

    Args:
        arena: where they are.
        num_robots: N.
        heading: of the way [rad]; the camera stands to its right.
        width: of an image [pixel].
        height: likewise.
    """

    def __init__(
        self, arena: Arena, num_robots: int, heading: float = 0.0, width: int = 640, height: int = 400
    ) -> None:
        spec = arena.spec()
        add_scene(spec, width, height)
        for robot in range(num_robots):
            part = make_scout(ScoutConfig())
            spec.attach(part, prefix=f"robot_{robot}_", frame=spec.worldbody.add_frame())
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        self._find_addresses(num_robots)
        self._renderer = SceneRenderer(
            self._model, self._data, width, height, VIEW_LENGTH, heading, quality=arena.quality
        )
        self._renderer.camera.elevation = ELEVATION

    def _find_addresses(self, num_robots: int) -> None:
        """Find where root, center and hinge of every robot lie in qpos."""
        model = self._model
        self._roots, self._hinges = [], []
        for robot in range(num_robots):
            joints = [
                joint for joint in range(model.njnt) if model.joint(joint).name.startswith(f"robot_{robot}_")
            ]
            for joint in joints:
                kind = model.jnt_type[joint]
                found = self._roots if kind == mujoco.mjtJoint.mjJNT_FREE else self._hinges
                found.append(int(model.jnt_qposadr[joint]))

    def draw(
        self,
        position: Float[np.ndarray, "N 3"],
        rotation: Float[np.ndarray, "N 3 3"],
        hinge: Float[np.ndarray, " N"],
        time: float,
    ) -> UInt8[np.ndarray, "H W 3"]:
        """Return an image of robots."""
        data = self._data
        quaternion = np.zeros(4)
        for robot, root in enumerate(self._roots):
            mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(rotation[robot]).ravel())
            data.qpos[root : root + 3], data.qpos[root + 3 : root + 7] = position[robot], quaternion
            data.qpos[self._hinges[robot]] = hinge[robot]
        data.time = time
        mujoco.mj_forward(self._model, data)
        self._renderer.follow(position)
        return self._renderer.render("rgb_array")

    def close(self) -> None:
        """Free the graphics context."""
        self._renderer.close()
