"""Exporting an arena: one folder that the simulators of others load without this package."""

from __future__ import annotations

import io
import json
import os
import re
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from reconstruction._src.base.atomic_write import find_leftovers, write_atomically
from reconstruction._src.base.typed_json import read_json
from symbrion_gym._src.arenas.export.content import Content, make_content, sample_heights
from symbrion_gym._src.arenas.export.mjcf import format_mjcf
from symbrion_gym._src.arenas.export.obj import LOADERS, USES, format_obj
from symbrion_gym._src.arenas.export.urdf import format_urdf
from symbrion_gym._src.arenas.export.usd import format_usd
from symbrion_gym._src.arenas.placed_objects import format_objects
from symbrion_gym._src.arenas.spec import ArenaGeometry
from symbrion_gym._src.errors import ArenaError

MANIFEST = "export.json"
FORMAT = 1
_OWN = re.compile(
    r"arena\.(?:xml|urdf|usda)|contact\.(?:xml|obj)|objects\.json|surface\.(?:obj|mtl|png)|pieces/\d{3,}\.obj"
    r"|heights\.npz|height_field\.npz"
    rf"|README\.md|NOTICE\.txt|load_(?:mjlab|playground|isaaclab)\.py|{re.escape(MANIFEST)}"
)
"""Every name that a file of an export may have; whatever a manifest says, no other is touched."""


def save_export(folder: Path, files: dict[str, bytes], about: dict[str, Any]) -> None:
    """Write the files of an export, and remove those of the former one that it no longer has."""
    own = find_own_files(folder)
    wanted = {*files, MANIFEST}
    for name in sorted(wanted):
        _refuse_foreign(folder, name, own)
    about = {"format": FORMAT, **about}
    _write(folder / MANIFEST, _to_json({**about, "complete": False, "files": sorted(own | wanted)}))
    for name, content in files.items():
        _write(folder / name, content)
    _remove(folder, own - wanted)
    _write(folder / MANIFEST, _to_json({**about, "complete": True, "files": sorted(wanted)}))


def find_own_files(folder: Path) -> frozenset[str]:
    """Return which files in a folder are an export's; none where there is no folder, or nothing in it."""
    if folder.exists() and not folder.is_dir():
        raise ArenaError(f"{folder} is a file; choose another folder")
    if not (folder / MANIFEST).exists():
        entries = set(folder.iterdir()) if folder.exists() else set()
        if entries - find_leftovers(folder).keys():
            raise ArenaError(f"{folder} is not empty and holds no export; choose another folder")
        return frozenset()
    try:
        about = read_json(folder / MANIFEST)
        version, names = about["format"], about["files"]
        if not isinstance(version, int) or not isinstance(names, list):
            raise ValueError("not an export's")
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise ArenaError(
            f"{folder / MANIFEST} is damaged or of another program, so that nobody knows which files beside it "
            "are an export's; choose another folder"
        ) from error
    if version > FORMAT:
        raise ArenaError(f"{folder / MANIFEST}: written by a newer version; choose another folder")
    return frozenset(name for name in names if isinstance(name, str) and _OWN.fullmatch(name)) | {MANIFEST}


def _refuse_foreign(folder: Path, name: str, own: frozenset[str]) -> None:
    """Refuse to write where something lies that is no file of the export: a file, a folder, a link."""
    path = folder / name
    is_free = not os.path.lexists(path) and (path.parent.is_dir() or not os.path.lexists(path.parent))
    if not _is_inside(folder, name) or not (is_free or (name in own and path.is_file())):
        raise ArenaError(
            f"{path} is in the way and no file of the export in {folder}; move it, or choose another folder"
        )


def _is_inside(folder: Path, name: str) -> bool:
    """Return whether a name leads to that place in the folder, and by no link elsewhere."""
    return (folder / name).resolve() == folder.resolve() / name


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with write_atomically(path) as temporary:
        temporary.write_bytes(content)


def _remove(folder: Path, names: frozenset[str]) -> None:
    """Remove own files, and the folder of pieces that is empty then."""
    for name in names:
        if _is_inside(folder, name) and (folder / name).is_file():
            (folder / name).unlink()
    pieces = folder / "pieces"
    if names and _is_inside(folder, "pieces") and pieces.is_dir() and not any(pieces.iterdir()):
        pieces.rmdir()


def _to_json(about: dict[str, Any]) -> bytes:
    return (json.dumps(about, indent=2, allow_nan=False) + "\n").encode()


_NOTICE = """This folder was generated from a scan by Symbrion Gym {version}.

The geometry is derived from that scan. The terms of the owner of the scan hold for the scan and for this geometry:
check them before you pass the folder on, and name the owner where they ask for it. Symbrion Gym claims no rights in
its output, and the loaders (load_*.py) may be used without any condition.
"""


def describe(content: Content, to: str) -> dict[str, Any]:
    """Return the content of `export.json`, without its format and the names of files."""
    return {
        "to": to,
        "name": content.name,
        "generator": f"symbrion-gym {version('symbrion-gym')}",
        "units": "m",
        "up": "z",
        "offset": list(content.offset),
        "friction": content.friction,
        **({} if content.friction_map is None else {"friction_map": content.friction_map.as_dict()}),
        "num_pieces": content.num_pieces,
        "num_solids": len(content.solids),
        "max_vertices": content.max_vertices,
        "deviation": content.deviation,
        "quality": content.quality,
        "provenance": content.provenance,
    }


def make_notice() -> str:
    """Return the note on licenses, `NOTICE.txt`."""
    return _NOTICE.format(version=version("symbrion-gym"))


def make_readme(content: Content, to: str) -> str:
    """Return `README.md`: the files of a format, frame, units and friction."""
    low, high = content.surface.bounds
    extent = " x ".join(f"{side:.2f}" for side in high - low)
    offset = ", ".join(f"{value:.3f}" for value in content.offset)
    return (
        "\n\n".join(
            [
                f"# Arena {content.name}",
                f"An arena from a scan, {extent} m, written by Symbrion Gym for {to.upper()}.",
                USES[to],
                _describe_contact(content),
                f"""- Units are meters, z points up.
- Coordinates of the scan = coordinates here + ({offset}) m.
- Sliding friction of the ground: {content.friction:g}{_describe_patches(content, to)}.
- `heights.npz`: heights of the surface as seen from above (under a ceiling, the ceiling), rows along y, columns along x
  from `low` to `high`; NaN where there is no surface.
- `export.json`: all of this for programs. `NOTICE.txt`: whose the geometry is.""",
                "Exporting again replaces the files that `export.json` lists and leaves all others.",
            ]
        )
        + "\n"
    )


def _describe_patches(content: Content, to: str) -> str:
    if content.friction_map is None or not content.friction_map.patches:
        return ""
    values = ", ".join(f"{patch.friction:.2f}" for patch in content.friction_map.patches)
    carried = "the pieces there have it" if to in ("mjcf", "usd") else f"{to.upper()} does not carry it"
    return f"; in patches {values} (`friction_map` in `export.json`; {carried})"


def _describe_contact(content: Content) -> str:
    if content.height_field is not None:
        rows, columns = content.height_field.heights.shape
        return f"The contact geometry is a height field of {rows} x {columns} heights."
    text = f"The contact geometry is {len(content.solids)} convex solids"
    if content.max_vertices is not None:
        text += f" of at most {content.max_vertices} vertices"
    if len(content.solids) != content.num_pieces:
        text += f", cut from {content.num_pieces} pieces"
    if content.deviation > 0:
        text += f"; they deviate from the pieces by {1e3 * content.deviation:.2f} mm at most"
    return text + "."


FORMATS: dict[str, Callable[[Content], dict[str, bytes]]] = {
    "mjcf": format_mjcf,
    "urdf": format_urdf,
    "usd": format_usd,
    "obj": format_obj,
}
"""Format -> the function that returns its files: name -> content."""


def export_arena(
    folder: str | Path, geometry: ArenaGeometry, to: str, max_vertices: int | None, **about: Any
) -> dict[str, Any]:
    """Write an arena as a folder for other simulators; of what is there, only a former export is replaced."""
    if to not in FORMATS:
        raise ArenaError(f"to is {to!r}; there are: {', '.join(FORMATS)}")
    folder = Path(folder)
    find_own_files(folder)  # refused before any work
    content = make_content(geometry, max_vertices, **about)
    files = FORMATS[to](content) | {name: text.encode() for name, text in LOADERS[to].items()}
    files["heights.npz"] = _format_arrays(sample_heights(geometry.surface))
    if content.objects:
        files["objects.json"] = format_objects(content.objects)
    files["README.md"] = make_readme(content, to).encode()
    files["NOTICE.txt"] = make_notice().encode()
    description = describe(content, to)
    save_export(folder, files, description)
    return description


def _format_arrays(arrays: dict[str, np.ndarray]) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()
