"""Pictures of a swarm whose motion is known: free Scouts in the model of the arena, no physics."""

import mujoco
import numpy as np
from jaxtyping import Float, UInt8

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.environment.rendering import SceneRenderer, add_scene
from symbrion_gym._src.robot.scout import make_scout
from symbrion_gym._src.robot.scout_constants import ScoutConfig

WIDTH, HEIGHT = 640, 400  # Of an image [pixel]
VIEW_LENGTH = 1.8
"""The camera stays as far away as from an organism of this length [m]: it shows most of a swarm."""
ELEVATION = -32.0  # Of the camera [deg]


class SwarmCamera:
    """Draws N Scouts wherever they are told to be, from the right of a heading [rad]."""

    def __init__(self, arena: Arena, num_robots: int, heading: float) -> None:
        spec = arena.spec()
        add_scene(spec, WIDTH, HEIGHT)
        for robot in range(num_robots):
            part = make_scout(ScoutConfig())
            spec.attach(part, prefix=f"robot_{robot}_", frame=spec.worldbody.add_frame())
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        self._roots, self._hinges = (
            [int(self._model.joint(f"robot_{robot}_{name}").qposadr[0]) for robot in range(num_robots)]
            for name in ("root", "hinge_0")
        )
        self._renderer = SceneRenderer(
            self._model, self._data, WIDTH, HEIGHT, VIEW_LENGTH, heading, quality=arena.quality
        )
        self._renderer.camera.elevation = ELEVATION

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
