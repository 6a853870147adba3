"""Depth images of made rooms with known objects, as a depth camera takes them: files, and the poses of the camera."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh

from benchmarks.material.object_rooms import PlacedObject, RoomSurvey, make_room, place_mesh
from benchmarks.material.ray_casts import make_embree_cast
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.scans.depth_image import Intrinsics, load_depth_image

CAMERA = Intrinsics(525.0, 525.0, 319.5, 239.5)
"""Of the first Kinect, 640 x 480 pixels, as its drivers have them."""
WIDTH, HEIGHT = 640, 480
NOISE = (0.0012, 0.0019, 0.4)
"""Standard deviation of depth z [m]: a + b (z - c)² (Nguyen, Izadi, Lovell 2012, for surfaces that face the camera)."""
_MILLIMETER = 1000.0


class DepthView(NamedTuple):
    """A camera: `position` [3] [m], and `rotation` [3, 3], camera to room; x right, y down, z ahead."""

    position: np.ndarray
    rotation: np.ndarray


def make_depth_survey(
    meshes: dict[str, trimesh.Trimesh], seed: int, folder: Path, distance: float, has_object: bool
) -> RoomSurvey:
    """Make a room, take a depth image of it, and read the file as a cloud.

    Args:
        meshes: name -> object.
        seed: of everything.
        folder: where the image is written.
        distance: of the camera from the object [m].
        has_object: whether the room has an object; else the camera looks at a place on a wall.
    """
    rng = np.random.default_rng(seed)
    parts, placed, _ = make_room(meshes, rng, 1, 1)
    target = placed[0]
    bodies = [*parts, place_mesh(meshes[target.name], target)] if has_object else parts
    view = _look_at(target, distance, rng)
    directions = _list_directions()
    cast = make_embree_cast(trimesh.util.concatenate(bodies))
    depth = cast(
        view.position, directions @ view.rotation.T / np.linalg.norm(directions, axis=1, keepdims=True)
    )
    depth = depth / np.linalg.norm(directions, axis=1)
    base, growth, nearest = NOISE
    depth = depth + rng.normal(size=len(depth)) * (base + growth * (depth - nearest) ** 2)
    path = folder / "depth.png"
    _write(path, np.nan_to_num(depth).reshape(HEIGHT, WIDTH))
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = view.rotation, view.position
    cloud = load_depth_image(path, CAMERA, pose=pose)
    return RoomSurvey(cloud, [target._replace(readings=WIDTH)] if has_object else [])


def _look_at(target: PlacedObject, distance: float, rng: np.random.Generator) -> DepthView:
    """Return a camera before an object, up to 30 degrees to the side or above, that looks nearly at it."""
    yaw, pitch = rng.uniform(-0.5, 0.5), rng.uniform(-0.1, 0.4)
    out = target.rotation[:, 0]
    side = np.cross([0.0, 0.0, 1.0], out)
    away = np.cos(pitch) * (np.cos(yaw) * out + np.sin(yaw) * side) + np.sin(pitch) * np.array(
        [0.0, 0.0, 1.0]
    )
    position = target.position + distance * away
    ahead = target.position + rng.uniform(-0.15, 0.15, 3) - position
    ahead = ahead / np.linalg.norm(ahead)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right = right / np.linalg.norm(right)
    return DepthView(position, np.column_stack([right, np.cross(ahead, right), ahead]))


def _list_directions() -> np.ndarray:
    """Return the directions of the pixels in the camera, 1 along its axis `[H * W, 3]`."""
    column, row = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    flat = [(column - CAMERA.cx) / CAMERA.fx, (row - CAMERA.cy) / CAMERA.fy, np.ones(column.shape)]
    return np.stack(flat, axis=-1).reshape(-1, 3)


def _write(path: Path, depth: np.ndarray) -> None:
    """Write depth [m] as millimeters in 16 bits, as depth cameras do."""
    from PIL import Image

    with write_atomically(path) as beside:
        Image.fromarray(np.clip(np.round(_MILLIMETER * depth), 0, 65535).astype(np.uint16)).save(
            beside, format="PNG"
        )
