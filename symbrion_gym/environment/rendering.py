"""Pictures of a simulation: light, sky and a camera that follows the body."""

from __future__ import annotations

import logging
from typing import Any

import mujoco
import numpy as np

from symbrion_gym.arenas.spec import SURFACE_GROUP
from symbrion_gym.headless import has_display
from symbrion_gym.robot.scout_look import VISUAL_GROUP

RENDER_MODES = ("human", "rgb_array", "depth_array", "rgbd_tuple")
log = logging.getLogger(__name__)
_LAG = 0.5
"""Time after which the camera has gone two thirds of the way to the body [s]."""


def add_stage(spec: mujoco.MjSpec, width: int, height: int) -> None:
    """Add sky, soft light and room for pictures of the given size to a model under construction."""
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.80, 0.88, 0.95],
        rgb2=[0.35, 0.45, 0.58],
        width=256,
        height=256,
    )
    visual = spec.visual
    visual.headlight.ambient = [0.40, 0.40, 0.40]
    visual.headlight.diffuse = [0.35, 0.35, 0.35]
    visual.headlight.specular = [0.10, 0.10, 0.10]
    visual.quality.shadowsize = 4096
    visual.quality.offsamples = 8
    visual.map.znear = 0.005
    getattr(visual, "global").offwidth = max(width, 640)
    getattr(visual, "global").offheight = max(height, 480)


class Pictures:
    """Draws one simulation off screen, or in a window.

    Attributes:
        camera: looks at the body from the side; may be changed between pictures.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        width: int,
        height: int,
        length: float,
        heading: float,
    ) -> None:
        """Prepare; windows and graphics contexts are made at the first picture.

        Args:
            model: what is drawn.
            data: its state.
            width: of a picture [pixel].
            height: of a picture [pixel].
            length: of the body [m]; sets how far away the camera stays.
            heading: of the route [rad]; the camera stands to its right.
        """
        self._model, self._data, self._size = model, data, (width, height)
        self._renderer: mujoco.Renderer | None = None
        self._window: Any = None
        self.camera = mujoco.MjvCamera()
        self.camera.type = mujoco.mjtCamera.mjCAMERA_FREE
        self.camera.distance = 0.75 + 0.95 * length
        self.camera.azimuth = 105.0 + np.degrees(heading)
        self.camera.elevation = -18.0
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = 0
        self._option.geomgroup[[0, VISUAL_GROUP, SURFACE_GROUP]] = 1
        self._option.sitegroup[:] = 0
        self._option.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = 0
        self._middle: np.ndarray | None = None
        self._time = 0.0
        self._has_complained = False

    def follow(self, position: np.ndarray, at_once: bool = False) -> None:
        """Move the camera towards the middle of the modules, `[n, 3]`."""
        middle = np.mean(position, axis=0)
        passed = self._data.time - self._time
        self._time = self._data.time
        if self._middle is None or at_once or passed < 0.0:
            self._middle = middle
        self._middle = self._middle + (1.0 - np.exp(-passed / _LAG)) * (middle - self._middle)
        self.camera.lookat[:] = self._middle

    def draw(self, mode: str) -> Any:
        """Return a picture: `[H, W, 3]` bytes, depth `[H, W]` [m], both, or None for a window."""
        if mode == "human":
            return self._draw_window()
        if self._renderer is None:
            width, height = self._size
            self._renderer = mujoco.Renderer(self._model, height, width, max_geom=4000)
        renderer = self._renderer
        renderer.update_scene(self._data, self.camera, self._option)
        images = []
        if mode in ("rgb_array", "rgbd_tuple"):
            images.append(renderer.render().copy())
        if mode in ("depth_array", "rgbd_tuple"):
            renderer.enable_depth_rendering()
            images.append(renderer.render().copy())
            renderer.disable_depth_rendering()
        return tuple(images) if mode == "rgbd_tuple" else images[0]

    def _draw_window(self) -> None:
        if not has_display():
            self._warn_once("no display: the window is left out; render_mode='rgb_array' works without one")
            return
        if self._window is None:
            from mujoco import viewer

            try:
                self._window = viewer.launch_passive(
                    self._model, self._data, show_left_ui=False, show_right_ui=False
                )
            except RuntimeError as error:  # on macOS the window needs MuJoCo's own interpreter, mjpython
                self._warn_once(
                    f"the window is left out ({error}); render_mode='rgb_array' works without one"
                )
                return
            with self._window.lock():
                self._window.opt.geomgroup[:] = self._option.geomgroup
                for name in ("distance", "azimuth", "elevation"):
                    setattr(self._window.cam, name, getattr(self.camera, name))
        with self._window.lock():
            self._window.cam.lookat[:] = self.camera.lookat
        self._window.sync()

    def _warn_once(self, message: str) -> None:
        if not self._has_complained:
            log.warning(message)
        self._has_complained = True

    def close(self) -> None:
        """Free the graphics context and close the window."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
        if self._window is not None:
            self._window.close()
            self._window = None
