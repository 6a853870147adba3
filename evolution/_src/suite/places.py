"""The places of the suite, each known exactly and as a simulated survey found it: a gap, stairs, rough ground.

The scanned arenas ship with the package, made as the ready-made ones are: survey, network, convex pieces (a height
field of the rough ground). Their exact counterparts judge alone.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from evolution._src.errors import RunError
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course, StairsCourse
from symbrion_gym._src.assets import find_assets
from symbrion_gym._src.contact.quality import ArenaQuality

GAP = Course(pit=0.25, height=0.25, floor=1.2, ramp=0.8, plateau=0.8)
"""A row of five modules crosses it without control, rows of three and four do not."""
STAIRS = StairsCourse(steps=2, rise=0.05, run=0.30, floor=1.2, plateau=1.2)
"""Steps four times the radius of the rollers in a track (0.011 m), which do not roll up a vertical wall."""
COURSES = {"gap": GAP, "stairs": STAIRS}
PLACES = (*COURSES, "rough")
GROUND_LENGTH, GROUND_WIDTH = 3.6, 2.0
"""Size of the rough ground [m]."""
HILLS_FROM, HILLS_TO = -0.6, 1.4
"""x between which there are hills on it [m]."""
_NUM_HILLS, _CORNERS = 45, 7
_RADII = (0.10, 0.30)
"""Smallest and largest radius of a hill [m]."""
_SLOPES = (0.25, 0.6)
"""Smallest and largest slope of its sides."""
_FLOOR = 0.2
"""Thickness of the ground [m]."""


def make_hills() -> list[trimesh.Trimesh]:
    """Return the convex solids of the rough ground: a slab, and blunt cones of random size and slope on it."""
    rng = np.random.default_rng(0)
    slab = trimesh.creation.box((GROUND_LENGTH, GROUND_WIDTH, _FLOOR))
    solids = [slab.apply_translation((0.0, 0.0, -_FLOOR / 2))]
    for _ in range(_NUM_HILLS):
        radius = rng.uniform(*_RADII)
        center = rng.uniform(HILLS_FROM, HILLS_TO), rng.uniform(-1.0, 1.0) * (GROUND_WIDTH / 2 - _RADII[1])
        solids.append(_make_hill(rng, center, radius, rng.uniform(*_SLOPES)))
    return solids


def _make_hill(
    rng: np.random.Generator, center: tuple[float, float], radius: float, slope: float
) -> trimesh.Trimesh:
    """Return a cone with its tip cut off, its foot in the slab."""
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, 2 * _CORNERS))[::2]
    rim = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    top = 0.6 * radius * slope
    levels = ((1.0, 0.0), (0.4, top), (1.0, -_FLOOR / 2))
    corners = [np.column_stack([share * radius * rim, np.full(len(rim), z)]) for share, z in levels]
    return trimesh.convex.convex_hull(np.concatenate(corners) + np.array((*center, 0.0)))


def make_true_arena(name: str) -> Arena:
    """Return a place as it is, which judges alone."""
    if name in COURSES:
        return Arena.from_course(COURSES[name], f"{name}-truth")
    solids = make_hills()
    surface = trimesh.boolean.union(solids, engine="manifold")
    quality = ArenaQuality(mean=0.0, p95=0.0, max=0.0, num_pieces=len(solids))
    return Arena(f"{name}-truth", solids, surface, quality, friction_source="exact")


def find_published_arena(name: str) -> Path:
    """Return the folder of a scanned arena that ships with the package."""
    if name not in PLACES:
        raise RunError(f"no place {name!r}; there are: {', '.join(PLACES)}")
    return find_assets() / "suite" / "arenas" / name
