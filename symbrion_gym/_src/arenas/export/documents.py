"""The texts of an export: what it is, in which frame, and whose it is."""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

from symbrion_gym._src.arenas.export.content import Content
from symbrion_gym._src.arenas.export.loaders import USES

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
