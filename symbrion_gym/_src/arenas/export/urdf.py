"""URDF: one link without inertia, thus static, with a collision element a piece and the surface as its visual.

URDF knows no vertices in the file and no two hulls in one mesh file, so each piece that is no box has a file.
"""

from __future__ import annotations

from collections.abc import Iterator
from xml.sax.saxutils import quoteattr

import numpy as np
from jaxtyping import Float

from reconstruction._src.geometry.halfspaces import Box
from symbrion_gym._src.arenas.export.content import Content
from symbrion_gym._src.arenas.export.obj import format_colored, format_mesh
from symbrion_gym._src.errors import ArenaError

_GIMBAL_LOCK = 1e-6  # Cosine of the pitch below which roll and yaw are about one axis


def format_urdf(content: Content) -> dict[str, bytes]:
    """Return `arena.urdf` and the meshes that it names by paths relative to it."""
    if content.height_field is not None:
        raise ArenaError(
            f"arena {content.name!r} is a height field, which URDF does not have; "
            "export it to mjcf, usd or obj, or make it again with kind='convex'"
        )
    files = {_name_file(solid.name): format_mesh(solid.mesh) for solid in content.solids if solid.box is None}
    model = ("\n".join(_format_model(content)) + "\n").encode()
    return {"arena.urdf": model, **format_colored(content), **files}


def _name_file(name: str) -> str:
    return f"pieces/{name.removeprefix('arena_piece_')}.obj"


def _format_model(content: Content) -> Iterator[str]:
    yield '<?xml version="1.0"?>'
    yield f"<robot name={quoteattr('arena ' + content.name)}>"
    # For MuJoCo, whose importer else looks for meshes without their folder and leaves visuals out.
    yield '<mujoco><compiler strippath="false" discardvisual="false"/></mujoco>'
    yield '<link name="arena">'
    # For PyBullet; URDF itself has no friction.
    yield f'<contact><lateral_friction value="{content.friction:g}"/></contact>'
    yield '<visual name="arena_surface"><geometry><mesh filename="surface.obj"/></geometry></visual>'
    for solid in content.solids:
        shape = (
            f'<geometry><mesh filename="{_name_file(solid.name)}"/></geometry>'
            if solid.box is None
            else _format_box(solid.box)
        )
        yield f'<collision name="{solid.name}">{shape}</collision>'
    yield "</link>"
    # For Gazebo.
    yield f'<gazebo reference="arena"><mu1>{content.friction:g}</mu1><mu2>{content.friction:g}</mu2></gazebo>'
    yield "</robot>"


def _format_box(box: Box) -> str:
    center = " ".join(f"{value:.6f}" for value in box.center)
    angles = " ".join(f"{value:.9f}" for value in _find_angles(box.axes))
    size = " ".join(f"{value:.6f}" for value in 2 * np.asarray(box.half_sizes))
    return f'<origin xyz="{center}" rpy="{angles}"/><geometry><box size="{size}"/></geometry>'


def _find_angles(axes: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, " 3"]:
    """Return roll, pitch and yaw of a rotation: about the fixed x, then y, then z [rad]."""
    across = np.hypot(axes[0, 0], axes[1, 0])
    pitch = np.arctan2(-axes[2, 0], across)
    if across < _GIMBAL_LOCK:  # only the sum of roll and yaw counts
        return np.array([np.arctan2(-axes[1, 2], axes[1, 1]), pitch, 0.0])
    return np.array([np.arctan2(axes[2, 1], axes[2, 2]), pitch, np.arctan2(axes[1, 0], axes[0, 0])])
