"""Images of a simulation: light, sky and a camera that follows the organism."""

import copy
import logging
from collections.abc import Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from symbrion_gym._src.arenas.spec import CONTACT_GROUP, SURFACE_GROUP
from symbrion_gym._src.contact.quality import ArenaQuality
from symbrion_gym._src.headless import has_display
from symbrion_gym._src.robot.scout import VISUAL_GROUP

_TURNS = (0.0, 30.0, -30.0, 60.0, -60.0, 90.0, -90.0, 120.0, -120.0, 150.0, -150.0, 180.0)
"""Changes of the azimuth that are tried, the nearest first [deg] ..."""
_LIFTS = (0.0, -20.0, -40.0, -65.0)
"""... at each of these changes of the elevation [deg]: looking down more steeply, up to `_STEEPEST`."""
_STEEPEST = -85.0
_MOST_SHEETS = 8  # Surfaces seen from behind, which are not drawn, that a line of sight passes at most
_STEP = 1e-4  # A line of sight goes on this far behind a surface [m]
_CLEARANCE = 0.9  # Share of the free way that is used where no view is free
_LEAST_DISTANCE = 0.3  # The camera is not nearer to the organism than this [m]
_SEEN_SHARE = 0.5  # Share of the points that a free view shows


class View(NamedTuple):
    """Where a camera stands, seen from what it looks at."""

    azimuth: float  # direction in plan in which it looks [deg]
    elevation: float  # negative looks down [deg]
    distance: float  # [m]


class Sight:
    """Lines of sight in a simulation; only the arena's surface, as it is drawn, ends them."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._model, self._data = model, data
        self._groups = np.zeros(mujoco.mjNGROUP, dtype=np.uint8)
        self._groups[SURFACE_GROUP] = 1

    def find_view(
        self,
        target: Float[np.ndarray, " 3"],
        wanted: View,
        current: View | None = None,
        points: Float[np.ndarray, "P 3"] | None = None,
    ) -> View:
        """Return the wanted view where it is free, else the current one, else the nearest that is free.

        A view is free that shows at least half of the points. Where none does, it is the one that shows most of them;
        where none shows any, the camera comes as near as it must.
        """
        seen = target[None] if points is None else points
        views = [
            View(wanted.azimuth + turn, max(wanted.elevation + lift, _STEEPEST), wanted.distance)
            for lift in _LIFTS
            for turn in _TURNS
        ]
        candidates = [wanted, *([] if current is None else [current]), *views]
        eyes = [target + view.distance * _find_way(view) for view in candidates]
        best, most = wanted, 0.0
        for view, eye in zip(candidates, eyes, strict=True):
            share = float(np.mean([np.isinf(self._find_free_way(point, eye)) for point in seen]))
            if share >= _SEEN_SHARE:
                return view
            if share > most:
                best, most = view, share
        if most > 0.0:
            return best
        free, best = max(zip((self._find_free_way(target, eye) for eye in eyes), candidates, strict=True))
        return best._replace(distance=min(max(_CLEARANCE * free, _LEAST_DISTANCE), best.distance))

    def _find_free_way(self, target: Float[np.ndarray, " 3"], eye: Float[np.ndarray, " 3"]) -> float:
        """Return how far from a target the first surface is that hides it from the camera [m]; inf without one."""
        distance = float(np.linalg.norm(eye - target))
        way = (eye - target) / distance
        passed, geom, normal = 0.0, np.full(1, -1, dtype=np.int32), np.zeros(3)
        for _ in range(_MOST_SHEETS):
            gap = mujoco.mj_ray(
                self._model, self._data, target + passed * way, way, self._groups, 1, -1, geom, normal
            )
            if gap < 0 or passed + gap >= distance:
                return np.inf
            passed += gap + _STEP
            if normal @ way > 0:  # its front is towards the camera: it is drawn, and hides the target
                return passed
        return passed


def _find_way(view: View) -> Float[np.ndarray, " 3"]:
    """Return the direction from what a camera looks at to the camera."""
    azimuth, elevation = np.radians(view.azimuth), np.radians(view.elevation)
    return -np.array(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    )


RENDER_MODES = ("human", "rgb_array", "depth_array", "rgbd_tuple")
logger = logging.getLogger(__name__)
_MAX_GEOMS = 4000  # Geoms that an image can hold, beside those of the model
_LAG = 0.5
"""Time after which the camera has gone two thirds of the way to the organism [s]; longer is smoother."""
_DISTANCE = 0.75  # The camera is this far from the organism [m] ..
_DISTANCE_PER_LENGTH = 0.95  # ... and per meter of its length, so that all of it is seen.
_AZIMUTH = 105.0  # Relative to the heading of the route [deg]; 90 is from its right side, more looks back
_ELEVATION = -18.0  # Negative looks down [deg]
_NEAREST = 0.03  # What is nearer to the camera is not drawn [m]; in large scenes MuJoCo would leave out more
_CONTACT_GAP = 0.02
"""The contact geometry of the arena is drawn over its surface where its 95th percentile is farther off than
this [m], a step that is seen in the image; inf never draws it."""
_CONTACT_UNCOVERED = 0.01  # Likewise where more than this share of the surface has no contact
_CONTACT_OPACITY = 0.35  # How much of the surface contact hides, from 0 to 1
_POLE = 0.012, 0.24  # Radius and height of the poles that show places to be reached [m] ...
_POLE_COLORS = (0.95, 0.8, 0.2, 1.0), (0.9, 0.25, 0.15, 1.0)  # ... in this color, the last in the other


def add_scene(spec: mujoco.MjSpec, width: int, height: int) -> None:
    """Add sky, soft light and room for images of the given size [pixel] to a model under construction."""
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
    visual.quality.shadowsize = 2048
    visual.quality.offsamples = 4
    visual.map.znear = 0.005
    getattr(visual, "global").offwidth = max(width, 640)
    getattr(visual, "global").offheight = max(height, 480)


class SceneRenderer:
    """Renders one simulation off screen, or in a window, from the side; `camera` may be changed between images.

    Where something of the arena hides the organism, an image is taken from the nearest direction that is free. Poles
    stand at `places` that are to be reached.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        width: int,
        height: int,
        length: float,
        heading: float,
        quality: ArenaQuality | None = None,
        places: Sequence[tuple[float, float, float]] = (),
    ) -> None:
        model.vis.map.znear = min(model.vis.map.znear, _NEAREST / max(model.stat.extent, 1e-6))
        self._model, self._data, self._size = model, data, (width, height)
        self._places = places
        self._renderer: mujoco.Renderer | None = None
        self._window: Any = None
        self.camera = mujoco.MjvCamera()
        self.camera.type = mujoco.mjtCamera.mjCAMERA_FREE
        self.camera.distance = _DISTANCE + _DISTANCE_PER_LENGTH * length
        self.camera.azimuth = _AZIMUTH + np.degrees(heading)
        self.camera.elevation = _ELEVATION
        self._sight = Sight(model, data)
        self._view: View | None = None
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = 0
        self._option.geomgroup[[0, VISUAL_GROUP, SURFACE_GROUP]] = 1
        if quality is not None and (quality.p95 > _CONTACT_GAP or quality.uncovered > _CONTACT_UNCOVERED):
            self._option.geomgroup[CONTACT_GROUP] = 1
            model.geom_rgba[model.geom_group == CONTACT_GROUP, 3] = _CONTACT_OPACITY
        self._option.sitegroup[:] = 0
        self._option.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = 0
        self._middle: np.ndarray | None = None
        self._position: np.ndarray | None = None
        self._time = 0.0
        self._has_warned = False

    def follow(self, position: Float[np.ndarray, "n 3"], at_once: bool = False) -> None:
        """Move the camera towards the middle of the modules [m]."""
        middle, self._position = np.mean(position, axis=0), np.array(position)
        passed = self._data.time - self._time
        self._time = self._data.time
        if self._middle is None or at_once or passed < 0.0:
            self._middle = middle
        self._middle = self._middle + (1.0 - np.exp(-passed / _LAG)) * (middle - self._middle)
        self.camera.lookat[:] = self._middle

    def _find_free_camera(self) -> mujoco.MjvCamera:
        """Return the camera, turned to the nearest direction from which nothing hides the organism."""
        wanted = View(self.camera.azimuth, self.camera.elevation, self.camera.distance)
        self._view = self._sight.find_view(self.camera.lookat, wanted, self._view, self._position)
        camera = copy.copy(self.camera)
        camera.azimuth, camera.elevation, camera.distance = self._view
        return camera

    def render(self, mode: str) -> Any:
        """Return an image: `[H, W, 3]` bytes, depth `[H, W]` [m], both, or None for a window."""
        if mode == "human":
            return self._render_window()
        if self._renderer is None:
            width, height = self._size
            self._renderer = mujoco.Renderer(
                self._model, height, width, max_geom=self._model.ngeom + _MAX_GEOMS
            )
        renderer = self._renderer
        renderer.update_scene(self._data, self._find_free_camera(), self._option)
        if mode == "rgb_array":  # depth is that of the scene alone
            self._add_poles(renderer.scene)
        images = []
        if mode in ("rgb_array", "rgbd_tuple"):
            images.append(renderer.render().copy())
        if mode in ("depth_array", "rgbd_tuple"):
            renderer.enable_depth_rendering()
            images.append(renderer.render().copy())
            renderer.disable_depth_rendering()
        return tuple(images) if mode == "rgbd_tuple" else images[0]

    def _add_poles(self, scene: mujoco.MjvScene) -> None:
        """Add a pole at each place that is to be reached."""
        radius, height = _POLE
        for place in self._places:
            geom, middle = scene.geoms[scene.ngeom], np.add(place, [0.0, 0.0, height / 2])
            color = np.array(_POLE_COLORS[place == self._places[-1]], dtype=np.float32)
            size, kind = np.array([radius, height / 2, 0.0]), mujoco.mjtGeom.mjGEOM_CYLINDER
            mujoco.mjv_initGeom(geom, kind, size, middle, np.eye(3).ravel(), color)
            scene.ngeom += 1

    def _render_window(self) -> None:
        if not has_display():
            self._warn_once("no display: the window is left out; images (rgb_array) and films need none")
            return
        if self._window is None:
            from mujoco import viewer

            try:
                self._window = viewer.launch_passive(
                    self._model, self._data, show_left_ui=False, show_right_ui=False
                )
            except RuntimeError as error:  # on macOS the window needs MuJoCo's own interpreter, mjpython
                self._warn_once(f"the window is left out ({error}); images (rgb_array) and films need none")
                return
            with self._window.lock():
                self._window.opt.geomgroup[:] = self._option.geomgroup
                for name in ("distance", "azimuth", "elevation"):
                    setattr(self._window.cam, name, getattr(self.camera, name))
        with self._window.lock():
            self._window.cam.lookat[:] = self.camera.lookat
        self._window.sync()

    def _warn_once(self, message: str) -> None:
        if not self._has_warned:
            logger.warning(message)
        self._has_warned = True

    def close(self) -> None:
        """Free the graphics context and close the window."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
        if self._window is not None:
            self._window.close()
            self._window = None
