"""Exporting an arena: one folder that the simulators of others load without this package."""

import re
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction._src.geometry.elevation import Elevation
from symbrion_gym._src.arenas.export.content import Content, make_content
from symbrion_gym._src.arenas.export.formats import FORMATS
from symbrion_gym._src.arenas.owned_files import (
    FileOwner,
    format_arrays,
    format_json,
    remove_files,
    write_file,
    write_json,
)
from symbrion_gym._src.arenas.placed_objects import describe_objects
from symbrion_gym._src.arenas.spec import ArenaGeometry
from symbrion_gym._src.errors import ArenaError

MANIFEST = "export.json"
FORMAT = 1
_PATTERN = (
    r"arena\.(?:xml|urdf|usda)|contact\.(?:xml|obj)|objects\.json|surface\.(?:obj|mtl|png)|pieces/\d{3,}\.obj"
    r"|heights\.npz|height_field\.npz"
    rf"|README\.md|NOTICE\.txt|load_(?:mjlab|playground|isaaclab)\.py|{re.escape(MANIFEST)}"
)
_OWNER = FileOwner("export", MANIFEST, FORMAT, re.compile(_PATTERN))
_HEIGHT_SPACING = 0.02
"""Spacing of the grid of heights [m]: about that of a scan indoors; half of it takes four times the memory."""
_MOST_HEIGHTS = 400_000  # Cells of that grid; it is wider where it would have more


def find_own_files(folder: Path) -> frozenset[str]:
    """Return which files in a folder are an export's; none where there is no folder, or nothing in it."""
    return _OWNER.list_files(_OWNER.read_manifest(folder))


def export_arena(
    folder: str | Path, geometry: ArenaGeometry, to: str, max_vertices: int | None, about: dict[str, Any]
) -> dict[str, Any]:
    """Write an arena as a folder for other simulators; of what is there, only a former export is replaced."""
    if to not in FORMATS:
        raise ArenaError(f"to is {to!r}; there are: {', '.join(FORMATS)}")
    folder = Path(folder)
    own = find_own_files(folder)  # refused before any work
    content = make_content(geometry, max_vertices)
    files = FORMATS[to](content) | {name: text.encode() for name, text in LOADERS[to].items()}
    files["heights.npz"] = format_arrays(_sample_heights(geometry.surface))
    if geometry.objects:
        files["objects.json"] = format_json(describe_objects(geometry.objects))
    generator, friction_map = f"symbrion-gym {version('symbrion-gym')}", geometry.friction_map
    files["README.md"] = _make_readme(content, to, about["offset"]).encode()
    files["NOTICE.txt"] = _NOTICE.format(generator=generator).encode()
    description = {
        "to": to,
        "name": geometry.name,
        "generator": generator,
        "units": "m",
        "up": "z",
        "friction": geometry.friction,
        **({} if friction_map is None else {"friction_map": friction_map.as_dict()}),
        "num_pieces": len(geometry.pieces),
        "num_solids": len(content.solids),
        "max_vertices": max_vertices,
        "deviation": content.deviation,
        **about,
    }
    wanted = {*files, MANIFEST}
    _OWNER.refuse_foreign(folder, wanted, own)
    manifest = {"format": FORMAT, **description}
    write_json(folder / MANIFEST, manifest | {"complete": False, "files": sorted(own | wanted)})
    for name, data in files.items():
        write_file(folder / name, data)
    remove_files(folder, own, ("pieces/",), keep=wanted)
    write_json(folder / MANIFEST, manifest | {"complete": True, "files": sorted(wanted)})
    return description


def _sample_heights(surface: trimesh.Trimesh) -> dict[str, Float[np.ndarray, " ..."]]:
    """Return the heights of a surface as seen from above, on a grid."""
    low, high = np.asarray(surface.bounds, dtype=np.float64)[:, :2]
    spacing = max(_HEIGHT_SPACING, float(np.sqrt(np.prod(high - low) / _MOST_HEIGHTS)))
    columns, rows = (max(int(np.ceil(extent / spacing)) + 1, 2) for extent in high - low)
    x, y = np.meshgrid(np.linspace(low[0], high[0], columns), np.linspace(low[1], high[1], rows))
    return {"heights": Elevation(surface).height(x, y).astype(np.float32), "low": low, "high": high}


_NOTICE = """This folder was generated from a scan by {generator}.

The geometry is derived from that scan. The terms of the owner of the scan hold for the scan and for this geometry:
check them before you pass the folder on, and name the owner where they ask for it. Symbrion Gym claims no rights in
its output, and the loaders (load_*.py) may be used without any condition.
"""


_README = """# Arena {name}

An arena from a scan, {extent} m, written by Symbrion Gym for {to}.

{use}

The contact geometry is {contact}.

- Units are meters, z points up.
- Coordinates of the scan = coordinates here + ({offset}) m.
- Sliding friction of the ground: {friction:g}. Patches with another one are listed as `friction_map` in `export.json`;
  in MJCF and USD the pieces there have it.
- `heights.npz`: heights of the surface as seen from above (under a ceiling, the ceiling), rows along y, columns along x
  from `low` to `high`; NaN where there is no surface.
- `export.json`: all of this for programs. `NOTICE.txt`: whose the geometry is.

Exporting again replaces the files that `export.json` lists and leaves all others.
"""


def _make_readme(content: Content, to: str, offset: list[float]) -> str:
    """Return `README.md`: the files of a format, frame, units and friction."""
    deviation = f"within {1e3 * content.deviation:.2f} mm of {len(content.geometry.pieces)} pieces"
    solids = f"{len(content.solids)} convex solids, {deviation}"
    return _README.format(
        name=content.geometry.name,
        extent=" x ".join(f"{side:.2f}" for side in content.geometry.surface.extents),
        to=to.upper(),
        use=USES[to],
        contact=solids if content.geometry.height_field is None else "a height field",
        offset=", ".join(f"{value:.3f}" for value in offset),
        friction=content.geometry.friction,
    )


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
