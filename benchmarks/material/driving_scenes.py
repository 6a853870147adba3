"""Made arenas that are known exactly, to drive in: a furnished room, two storeys, natural terrain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.contact.kinds import HeightField
from symbrion_gym._src.contact.quality import ArenaQuality

CEILING = 2.4
"""Height of the rooms [m]."""
TABLE = 0.72
"""Height of the table [m]."""
GALLERY = 0.45
"""Height of the upper storey [m]."""
_SHELL = 0.06
"""Thickness of floors, walls and ceilings [m], as contact geometry has it."""
_TERRAIN_FRICTION = 0.7


def make_box(low: Sequence[float], high: Sequence[float]) -> trimesh.Trimesh:
    """Return a box between two corners [m]."""
    box = trimesh.creation.box(np.subtract(high, low))
    box.apply_translation(np.add(low, high) / 2)
    return box


def make_exact_arena(
    name: str, pieces: list[trimesh.Trimesh], surface: Sequence[trimesh.Trimesh], **fields: object
) -> Arena:
    """Return an arena of exact solids and the surfaces that a scanner sees, which look to the free side."""
    joined = trimesh.util.concatenate([trimesh.Trimesh(s.vertices, s.faces, process=False) for s in surface])
    assert isinstance(joined, trimesh.Trimesh)
    return Arena(name, pieces, joined, ArenaQuality(0.0, 0.0, 0.0, len(pieces)), **fields)  # type: ignore[arg-type]


def make_furnished_room(width: float = 4.0, depth: float = 3.0) -> Arena:
    """Return a closed room, seen from inside: with ceiling, a table on four legs, a cupboard and a thin screen."""
    table = [make_box((0.95, 0.95, TABLE - 0.02), (2.2, 1.8, TABLE))]
    table += [
        make_box((x, y, 0.0), (x + 0.04, y + 0.04, TABLE - 0.02)) for x in (1.0, 2.1) for y in (1.0, 1.7)
    ]
    cupboard = make_box((3.0, depth - 0.6, 0.0), (3.8, depth, 1.9))
    screen = make_box((2.8, 0.0, 0.0), (2.82, 1.6, 1.2))
    furniture = [*table, cupboard, screen]
    return make_exact_arena(
        "room", [*_make_shell(width, depth), *furniture], [_make_inside(width, depth), *furniture]
    )


def make_two_storeys(width: float = 5.0, depth: float = 3.0) -> Arena:
    """Return a hall with a gallery above half of it, to which a ramp of 14 degrees leads."""
    gallery = make_box((0.0, 1.5, GALLERY - 0.06), (2.0, depth, GALLERY))
    run, rise = 1.8, GALLERY
    into = 0.06 * np.array([rise, run]) / np.hypot(rise, run)
    line = np.array([(2.0, rise), (2.0 + run, 0.0)])
    corners = [(x, y, z) for y in (2.0, depth) for x, z in np.concatenate([line, line - into])]
    ramp = trimesh.Trimesh(np.array(corners)).convex_hull
    solids = [gallery, ramp]
    return make_exact_arena(
        "storeys", [*_make_shell(width, depth), *solids], [_make_inside(width, depth), *solids]
    )


def make_terrain(seed: int = 0, size: float = 6.0, roughness: float = 0.10, spacing: float = 0.05) -> Arena:
    """Return natural terrain, Gaussian noise with amplitudes that fall with the square of the frequency.

    Args:
        seed: of the noise.
        size: edge of the square [m].
        roughness: standard deviation of the heights [m].
        spacing: spacing of the heights [m].
    """
    count = round(size / spacing) + 1
    rng = np.random.default_rng(seed)
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(count), np.fft.fftfreq(count)))
    frequency[0, 0] = np.inf
    waves = np.fft.fft2(rng.standard_normal((count, count))) / frequency**2
    heights = np.fft.ifft2(waves).real
    heights *= roughness / heights.std()
    field = HeightField(heights, np.zeros(2), np.full(2, size))
    return make_exact_arena(
        "terrain", [], [field.as_mesh()], kind="hfield", height_field=field, friction=_TERRAIN_FRICTION
    )


def _make_shell(width: float, depth: float) -> list[trimesh.Trimesh]:
    """Return floor, ceiling and walls as solids that grow away from the room."""
    t, h = _SHELL, CEILING
    return [
        make_box((0, 0, -t), (width, depth, 0)),
        make_box((0, 0, h), (width, depth, h + t)),
        make_box((-t, 0, 0), (0, depth, h)),
        make_box((width, 0, 0), (width + t, depth, h)),
        make_box((0, -t, 0), (width, 0, h)),
        make_box((0, depth, 0), (width, depth + t, h)),
    ]


def _make_inside(width: float, depth: float) -> trimesh.Trimesh:
    """Return the inner side of a room; its faces look inwards."""
    inside = make_box((0, 0, 0), (width, depth, CEILING))
    inside.invert()
    return inside
