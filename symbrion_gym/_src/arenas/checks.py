"""Checks of an arena before MuJoCo sees it, wherever it comes from."""

from typing import TYPE_CHECKING

import numpy as np

from symbrion_gym._src.errors import ArenaError

if TYPE_CHECKING:
    import trimesh

    from symbrion_gym._src.contact.kinds import HeightField

FRICTION_LIMITS = (1e-3, 5.0)
"""Sliding friction of ground and robot; MuJoCo's contacts are sound within these."""
FRICTION_SOURCES = ("exact", "given", "assumed", "estimated")
"""Where the friction of an arena comes from: it is made in code, a user gave it, nobody measured it, or robots did, by
their slip."""
_LONGEST_NAME = 200  # Characters of a name
_SMALLEST_AREA = 1e-9  # [m²]; of a surface, of which MuJoCo computes the inertia of a shell
_SMALLEST_PIECE = 1e-12  # [m²]; files keep the vertices of pieces to 1e-6 m


def check_friction(friction: float, what: str = "friction") -> None:
    """Refuse a sliding friction that is no number or out of range."""
    low, high = FRICTION_LIMITS
    is_number = isinstance(friction, int | float | np.number) and not isinstance(friction, bool)
    if not (is_number and low <= friction <= high):
        raise ArenaError(f"{what} is {friction!r}; a number from {low:g} to {high:g} is needed")


def check_names(name: str, friction_source: str) -> None:
    """Refuse a name that would not survive a line of text or an XML file, and a source that there is not."""
    if not (isinstance(name, str) and name.isprintable() and 0 < len(name) <= _LONGEST_NAME):
        short = str(name)[:_LONGEST_NAME]
        raise ArenaError(f"name is {short!r}; 1 to {_LONGEST_NAME} printable characters are needed")
    if friction_source not in FRICTION_SOURCES:
        raise ArenaError(f"friction_source is {friction_source!r}; there are: {', '.join(FRICTION_SOURCES)}")


def check_piece(piece: "trimesh.Trimesh", source: object) -> None:
    """Refuse a contact piece that MuJoCo cannot compile: it takes the hull of the vertices in single precision."""
    from reconstruction._src.geometry.rows import make_hull

    _check_vertices(piece, source)
    if len(piece.vertices) < 4 or not len(piece.faces) or not piece.is_watertight:
        raise ArenaError(f"{source}: not a closed solid; a contact piece is one of 4 or more vertices")
    if make_hull(np.asarray(piece.vertices, dtype=np.float32)) is None:
        raise ArenaError(f"{source}: the piece is flat; a contact piece needs a volume")
    if not piece.area > _SMALLEST_PIECE:
        raise ArenaError(
            f"{source}: the piece has an area of {piece.area:.2g} m²; MuJoCo compiles none so small"
        )


def check_surface(surface: "trimesh.Trimesh", source: object) -> None:
    """Refuse an exact surface that cannot be drawn or hit by rays."""
    _check_vertices(surface, source)
    if not len(surface.faces) or len(surface.vertices) < 4:
        raise ArenaError(f"{source}: a surface needs 4 vertices and a face")
    if not surface.area > _SMALLEST_AREA:
        raise ArenaError(f"{source}: the surface has no area")


def _check_vertices(mesh: "trimesh.Trimesh", source: object) -> None:
    from reconstruction._src.geometry.mesh_repair import LARGEST_COORDINATE

    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    is_wrong = ~(np.abs(vertices) <= LARGEST_COORDINATE).all(axis=1)
    if is_wrong.any():
        index = int(is_wrong.argmax())
        needed = f"finite coordinates up to {LARGEST_COORDINATE:g} m are needed"
        raise ArenaError(f"{source}: vertex {index} is {vertices[index].tolist()}; {needed}")


def check_height_field(field: "HeightField", source: object) -> None:
    """Refuse a height field whose arrays do not fit together."""
    from reconstruction._src.geometry.mesh_repair import LARGEST_COORDINATE

    for name, array in field._asdict().items():
        if not (np.issubdtype(array.dtype, np.floating) and np.isfinite(array).all()):
            raise ArenaError(f"{source}: {name} must be floats, all finite")
        if array.size and np.abs(array).max() > LARGEST_COORDINATE:
            raise ArenaError(f"{source}: {name} reaches beyond {LARGEST_COORDINATE:g} m")
    if field.heights.ndim != 2 or min(field.heights.shape) < 2:
        raise ArenaError(
            f"{source}: heights has shape {field.heights.shape}; 2 rows and 2 columns are the least"
        )
    if field.low.shape != (2,) or field.high.shape != (2,) or not (field.low < field.high).all():
        raise ArenaError(f"{source}: low and high must be x and y, low below high")
