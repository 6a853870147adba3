"""OBJ: the contact pieces as objects of one file, and the surface; also the meshes that a URDF names."""

from __future__ import annotations

import numpy as np
import trimesh

from symbrion_gym._src.arenas.export.content import Content
from symbrion_gym._src.arenas.surface_file import format_surface
from symbrion_gym._src.arenas.texture import TEXTURE_FILE, to_png

_DIGITS = 6  # Coordinates to 1 µm, as in a saved arena


def format_obj(content: Content) -> dict[str, bytes]:
    """Return `contact.obj`, one object a piece, and `surface.obj`."""
    lines: list[str] = []
    used = 0
    named = [(solid.name, solid.mesh) for solid in content.solids]
    if content.height_field is not None:
        named.append(("arena_height_field", content.height_field.as_mesh()))
    for name, mesh in named:
        lines += [f"o {name}", *_format_lines(mesh, used)]
        used += len(mesh.vertices)
    return {"contact.obj": _join(lines), **format_colored(content)}


def format_colored(content: Content) -> dict[str, bytes]:
    """Return `surface.obj`; of a colored surface with its vertex colors, and its texture and material as files."""
    if content.texture is None:
        return {"surface.obj": format_mesh(content.surface)}
    head = b"mtllib surface.mtl\nusemtl surface\n"
    return {
        "surface.obj": head + format_surface(content.surface, content.texture, _DIGITS),
        "surface.mtl": f"newmtl surface\nKa 1 1 1\nKd 1 1 1\nmap_Kd {TEXTURE_FILE}\n".encode(),
        TEXTURE_FILE: to_png(content.texture.image),
    }


def format_mesh(mesh: trimesh.Trimesh) -> bytes:
    """Return one mesh as a file."""
    return _join(_format_lines(mesh, 0))


def _format_lines(mesh: trimesh.Trimesh, used: int) -> list[str]:
    """Return vertices and faces; OBJ counts vertices over all objects of a file, from 1."""
    # + 0.0 turns -0.0 into 0.0.
    vertices = np.round(np.asarray(mesh.vertices, dtype=np.float64), _DIGITS) + 0.0
    lines = [f"v {x:.{_DIGITS}f} {y:.{_DIGITS}f} {z:.{_DIGITS}f}" for x, y, z in vertices.tolist()]
    return lines + [f"f {a} {b} {c}" for a, b, c in (np.asarray(mesh.faces) + 1 + used).tolist()]


def _join(lines: list[str]) -> bytes:
    return ("\n".join(lines) + "\n").encode()


_MJLAB = '''"""Load this arena as the ground of a scene in mjlab: SceneCfg of `make_scene(entities={"robot": ...})`."""

from pathlib import Path

import mujoco
from mjlab.scene import SceneCfg

FILE = Path(__file__).with_name("arena.xml")


def add_arena(spec: mujoco.MjSpec) -> None:
    arena = mujoco.MjSpec.from_file(str(FILE))
    ground = spec.worldbody.add_frame().attach_body(arena.body("arena"), "arena/", "")
    ground.name = "terrain"  # by which mjlab's contact sensors know the ground


def make_scene(**options) -> SceneCfg:
    # One arena, shared by all environments: their origins coincide.
    return SceneCfg(terrain=None, env_spacing=0.0, spec_fn=add_arena, **options)
'''

_PLAYGROUND = '''"""Load this arena with a robot for an `MjxEnv` of MuJoCo Playground: `load_model(xml)`."""

from pathlib import Path

import mujoco

FILE = Path(__file__).with_name("contact.xml")  # MJX has no use for the surface


def load_model(xml: str, assets: dict[str, bytes] | None = None) -> mujoco.MjModel:
    spec = mujoco.MjSpec.from_string(xml, assets=assets)
    arena = mujoco.MjSpec.from_file(str(FILE))
    spec.worldbody.add_frame().attach_body(arena.body("arena"), "arena/", "")
    return spec.compile()  # then mjx.put_model(model), impl="warp" where there are many pieces
'''

_ISAACLAB = '''"""Load this arena as the terrain of an InteractiveSceneCfg of Isaac Lab: `terrain = make_terrain()`."""

from pathlib import Path

from isaaclab.terrains import TerrainImporterCfg

FILE = Path(__file__).with_name("arena.usda")


def make_terrain(prim_path: str = "/World/ground") -> TerrainImporterCfg:
    # One arena, shared by all environments: give the InteractiveSceneCfg env_spacing=0.0, too.
    return TerrainImporterCfg(prim_path=prim_path, terrain_type="usd", usd_path=str(FILE), env_spacing=0.0)
'''

LOADERS = {
    "mjcf": {"load_mjlab.py": _MJLAB, "load_playground.py": _PLAYGROUND},
    "urdf": {},
    "usd": {"load_isaaclab.py": _ISAACLAB},
    "obj": {},
}
"""Format -> name -> text of its loaders."""

USES = {
    "mjcf": """MuJoCo: `mujoco.MjModel.from_xml_path("arena.xml")`, or in a model of yours
`<include file="arena.xml"/>`, or `frame.attach_body(mujoco.MjSpec.from_file("arena.xml").body("arena"), "arena/", "")`.
`contact.xml` is the same without the surface. Contact pieces are in geom group 3, the surface in group 2: it is drawn
and hit by rays, and touches nothing. `load_mjlab.py` and `load_playground.py` are for mjlab and MuJoCo Playground.""",
    "urdf": """One link with a collision element for each piece and the surface as its visual; paths are relative to
`arena.urdf`. The link has no inertia: fix it to the world (PyBullet: `loadURDF("arena.urdf", useFixedBase=True)`).
MuJoCo loads it, too: `mujoco.MjModel.from_xml_path("arena.urdf")`. URDF has no friction; there are elements for
PyBullet and Gazebo.""",
    "usd": """`arena.usda` has the physics schema: `/arena/contact` are static colliders (cubes, convex hulls) with the
purpose "guide", which renderers hide, `/arena/surface` is drawn, `/arena/ground` is the physics material.
`load_isaaclab.py` is for Isaac Lab.""",
    "obj": """`contact.obj` has one object (`o`) for each convex piece, `surface.obj` is the exact surface. In Python:
`trimesh.load("contact.obj", split_objects=True)`.""",
}
"""Format -> how it is used, for the README."""
