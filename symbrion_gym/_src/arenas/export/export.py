"""Exporting an arena: one folder that the simulators of others load without this package."""

import re
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction._src.base.atomic_write import write_file
from reconstruction._src.base.typed_json import format_json, write_json
from reconstruction._src.geometry.elevation import Elevation
from symbrion_gym._src.arenas.export.formats import FORMATS, Content, make_content
from symbrion_gym._src.arenas.placed_objects import describe_objects
from symbrion_gym._src.arenas.saving import FileOwner, format_arrays, remove_files
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
_LOADERS = {"mjcf": ("load_mjlab.py", "load_playground.py"), "usd": ("load_isaaclab.py",)}
"""Format -> its loaders for other simulators."""
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
    files = FORMATS[to](content) | {
        name: read_template(f"{name}.txt").encode() for name in _LOADERS.get(to, ())
    }
    files["heights.npz"] = format_arrays(_sample_heights(geometry.surface))
    if geometry.objects:
        files["objects.json"] = format_json(describe_objects(geometry.objects))
    generator, friction_map = f"symbrion-gym {version('symbrion-gym')}", geometry.friction_map
    files["README.md"] = _make_readme(content, to, about["offset"]).encode()
    files["NOTICE.txt"] = read_template("NOTICE.txt").format(generator=generator).encode()
    description = {
        "to": to,
        "name": geometry.name,
        "generator": generator,
        "units": "m",
        "up": "z",
        "friction": geometry.friction,
        **({} if friction_map is None else {"friction_map": asdict(friction_map)}),
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


def read_template(name: str) -> str:
    """Return a text that an export comes with, from the folder `templates`."""
    return (Path(__file__).parent / "templates" / name).read_text(encoding="utf-8")


def _make_readme(content: Content, to: str, offset: list[float]) -> str:
    """Return `README.md`: the files of a format, frame, units and friction."""
    deviation = f"within {1e3 * content.deviation:.2f} mm of {len(content.geometry.pieces)} pieces"
    solids = f"{len(content.solids)} convex solids, {deviation}"
    return read_template("README.md").format(
        name=content.geometry.name,
        extent=" x ".join(f"{side:.2f}" for side in content.geometry.surface.extents),
        to=to.upper(),
        use=read_template(f"use_{to}.md").rstrip(),
        contact=solids if content.geometry.height_field is None else "a height field",
        offset=", ".join(f"{value:.3f}" for value in offset),
        friction=content.geometry.friction,
    )
