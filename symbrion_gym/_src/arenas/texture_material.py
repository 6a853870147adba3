"""The texture of an arena's surface in a MuJoCo model."""

from __future__ import annotations

import mujoco
import numpy as np

from symbrion_gym._src.arenas.texture import TEXTURE_FILE, SurfaceTexture

LIT_COLOR = (0.8, 0.8, 0.8, 1.0)
"""Factor on the texture: level ground gets 1.2 times its light from an arena's lamps and the viewer's headlight."""


def add_texture(
    spec: mujoco.MjSpec, geom: mujoco.MjsGeom, texture: SurfaceTexture, use_files: bool = False
) -> None:
    """Give a mesh geom a texture by a material of the name of the geom; without gloss, as a scan shows none."""
    name, image = geom.name, texture.image
    picture = spec.add_texture(name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, nchannel=3)
    if use_files:
        picture.file = TEXTURE_FILE
    else:
        picture.height, picture.width = image.shape[:2]
        picture.data = image.tobytes()
        mesh = spec.mesh(geom.meshname)
        mesh.usertexcoord = (np.array([0.0, 1.0]) + np.array([1.0, -1.0]) * texture.uv).ravel()
        mesh.userfacetexcoord = np.arange(texture.uv.size // 2, dtype=np.int32)
    material = spec.add_material(name=name, specular=0.0, shininess=0.0)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
    geom.material, geom.rgba = name, LIT_COLOR
