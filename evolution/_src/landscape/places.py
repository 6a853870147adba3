"""Places, each known exactly and as a simulated survey found it: a pit, stairs, rough ground, and a gap for the suite.

The scanned arenas are made as the ready-made ones are: survey, network, convex pieces. Their exact counterparts judge
alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from evolution._src.errors import RunError
from reconstruction._src.base.progress import Progress, silent
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course, StairsCourse
from symbrion_gym._src.assets import find_assets
from symbrion_gym._src.contact.quality import ArenaQuality

PLACES = ("pit", "stairs", "rough")
"""Places of the landscape."""
SUITE_PLACES = ("gap",)
"""Further places, of the benchmark suite."""
HELD_OUT_PLACES = ("gap", "low_stairs", "other_hills")
"""Places on which searches for bodies were not developed before they were searched there once."""
SECOND_HELD_OUT_PLACES = ("one_step", "sill", "steep_hills")
"""The same for the search that was developed on those, too."""
UNITS = 2200
"""Units of the network (GSRM), as of the ready-made arenas."""
SPACING = 0.015
"""One point of the scan in each cube of this edge [m]."""
TIME_LIMIT = 3600.0
"""Far more than the pieces need [s], so that a busy machine makes the same ones."""
PIT = Course(pit=0.18, height=0.25, floor=1.2, ramp=0.8, plateau=0.8)
"""Rows of three and more modules cross it without control, most bodies fall in."""
GAP = Course(pit=0.25, height=0.25, floor=1.2, ramp=0.8, plateau=0.8)
"""A row of five modules crosses it without control, rows of three and four do not."""
STAIRS = StairsCourse(steps=2, rise=0.05, run=0.30, floor=1.2, plateau=1.2)
"""Steps four times the radius of the rollers in a track (0.011 m), which do not roll up a vertical wall."""
LOW_STAIRS = StairsCourse(steps=2, rise=0.04, run=0.35, floor=1.2, plateau=1.2)
ONE_STEP = StairsCourse(steps=1, rise=0.05, run=0.30, floor=1.2, plateau=1.2)
GROUND_LENGTH, GROUND_WIDTH = 3.6, 2.0
"""Size of the rough ground [m]."""
HILLS_FROM, HILLS_TO = -0.6, 1.4
"""x between which there are hills on it [m]."""
_HILLS: dict[str, dict[str, Any]] = {
    "rough": {"seed": 0},
    "other_hills": {"seed": 7},
    "steep_hills": {"seed": 11, "slopes": (0.5, 1.0)},
}
_COURSES = {"pit": PIT, "gap": GAP, "stairs": STAIRS, "low_stairs": LOW_STAIRS, "one_step": ONE_STEP}
_NUM_HILLS = 45
_CORNERS = 7
_RADII = (0.10, 0.30)
"""Smallest and largest radius of a hill [m]."""
_SLOPES = (0.25, 0.6)
"""Smallest and largest slope of its sides."""
_FLOOR = 0.2
"""Thickness of the ground [m]."""
SILL_HEIGHT, SILL_DEPTH = 0.05, 0.10
"""Height of the sill, and the depth of its top, with sides of 45 degrees [m]."""


def make_hills(seed: int = 0, slopes: tuple[float, float] = _SLOPES) -> list[trimesh.Trimesh]:
    """Return the convex solids of the rough ground: a slab, and blunt cones of random size and slope on it."""
    rng = np.random.default_rng(seed)
    solids = [_make_slab()]
    for _ in range(_NUM_HILLS):
        radius = rng.uniform(*_RADII)
        center = rng.uniform(HILLS_FROM, HILLS_TO), rng.uniform(-1.0, 1.0) * (GROUND_WIDTH / 2 - _RADII[1])
        solids.append(_make_hill(rng, center, radius, rng.uniform(*slopes)))
    return solids


def make_sill() -> list[trimesh.Trimesh]:
    """Return the convex solids of a floor with a bar across the way."""
    low = -_FLOOR / 2
    half = SILL_DEPTH / 2
    profile = [(half, SILL_HEIGHT), (half + SILL_HEIGHT - low, low)]
    corners = [
        (sign * x, side * GROUND_WIDTH / 2, z) for x, z in profile for sign in (-1, 1) for side in (-1, 1)
    ]
    return [_make_slab(), trimesh.convex.convex_hull(np.array(corners))]


def _make_slab() -> trimesh.Trimesh:
    slab = trimesh.creation.box((GROUND_LENGTH, GROUND_WIDTH, _FLOOR))
    slab.apply_translation((0.0, 0.0, -_FLOOR / 2))
    return slab


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
    if name in _COURSES:
        return Arena.from_course(_COURSES[name], f"{name}-truth")
    solids = make_hills(**_HILLS[name]) if name in _HILLS else make_sill()
    surface = trimesh.boolean.union(solids, engine="manifold")
    quality = ArenaQuality(mean=0.0, p95=0.0, max=0.0, num_pieces=len(solids))
    return Arena(f"{name}-truth", solids, surface, quality, friction_source="exact")


def make_scanned_arena(name: str, seed: int = 0, progress: Progress = silent) -> Arena:
    """Return a place as a survey found it.

    Args:
        name: one of `PLACES`, `SUITE_PLACES`, `HELD_OUT_PLACES` and `SECOND_HELD_OUT_PLACES`.
        seed: seed of the survey and the network.
        progress: called with what is being done.
    """
    from reconstruction._src.reconstruct import reconstruct
    from reconstruction._src.scans.preprocess import preprocess, thin
    from symbrion_gym._src.arenas.making import make_arena
    from symbrion_gym._src.sensing.survey import survey

    truth = make_true_arena(name)
    source = truth if truth.course is not None else truth.surface
    points = thin(preprocess(survey(source, seed=seed, progress=progress)), SPACING)
    mesh = reconstruct(points, method="gsrm", units=UNITS, seed=seed).mesh
    # 750 patches follow the rough ground as closely as a height field does, and are slower
    kind = "hfield" if name in _HILLS else "auto"
    made = make_arena(mesh, name=name, kind=kind, seed=seed, time_limit=TIME_LIMIT, progress=progress)
    return replace(made, quality=replace(made.quality, seconds=0.0))


def save_places(
    folder: Path, names: Sequence[str] = PLACES, progress: Progress = silent
) -> tuple[dict[str, Path], dict[str, Path]]:
    """Make the arenas that a folder lacks, and return the folders of the scanned and of the exact ones by name.

    Args:
        folder: where the arenas are kept.
        names: some of `PLACES`.
        progress: called with what is being done.
    """
    scanned, exact = ({name: folder / kind / name for name in names} for kind in ("scanned", "truth"))
    for name in names:
        if not (scanned[name] / "arena.json").is_file():
            progress(f"survey and arena of the {name}", 0.0)
            make_scanned_arena(name, progress=progress).save(scanned[name])
        if not (exact[name] / "arena.json").is_file():
            make_true_arena(name).save(exact[name])
    return scanned, exact


def find_published_arena(name: str) -> Path:
    """Return the folder of a scanned arena that ships with the package.

    Args:
        name: one of `PLACES` and `SUITE_PLACES`.

    Raises:
        RunError: there is no such place.
    """
    if name not in (*PLACES, *SUITE_PLACES):
        raise RunError(f"no place {name!r}; there are: {', '.join((*PLACES, *SUITE_PLACES))}")
    return find_assets() / ("landscape" if name in PLACES else "suite") / "arenas" / name
