"""Rubble: a floor with blunt blocks of random size, heading and tilt, exactly and as a simulated survey finds it.

No search and no configuration was chosen on the rubble of the seed that the benchmark uses.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh

from evolution._src.landscape.places import SPACING, TIME_LIMIT, UNITS
from reconstruction._src.reconstruct import reconstruct
from reconstruction._src.scans.preprocess import preprocess, thin
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.making import make_arena
from symbrion_gym._src.contact.quality import ArenaQuality
from symbrion_gym._src.sensing.survey import survey

LENGTH, WIDTH = 4.4, 2.0
"""Size of the floor [m]: room for twelve modules in a row before the blocks and behind them."""
BLOCKS_FROM, BLOCKS_TO = -0.3, 0.7
"""x between which the centers of the blocks lie [m]."""
NUM_BLOCKS = 14
HEIGHTS = (0.02, 0.05)
"""Lowest and highest top of a block above the floor [m], tilt left out."""
EDGES = (0.15, 0.40)
"""Shortest and longest edge of a block at its top [m]."""
SLOPE = 1.0
"""Height to width of its sides: steeper ones are rounder in a scan than they are."""
MAX_TILT = 0.12
"""Largest tilt of its top [rad]."""
_DEPTH = 0.2
"""How far floor and blocks reach below the floor [m]."""


def make_blocks(seed: int) -> list[trimesh.Trimesh]:
    """Return the convex solids: the floor, and the blocks, whose feet are in it."""
    rng = np.random.default_rng(seed)
    floor = trimesh.creation.box((LENGTH, WIDTH, _DEPTH))
    floor.apply_translation((0.0, 0.0, -_DEPTH / 2))
    solids = [floor]
    for _ in range(NUM_BLOCKS):
        height = rng.uniform(*HEIGHTS)
        length, width = rng.uniform(*EDGES, size=2)
        block = _make_block(length, width, height)
        roll, pitch = rng.uniform(-MAX_TILT, MAX_TILT, size=2)
        turn = trimesh.transformations.euler_matrix(roll, pitch, rng.uniform(0.0, np.pi))
        block.apply_transform(turn)
        place = rng.uniform(BLOCKS_FROM, BLOCKS_TO), rng.uniform(-0.35, 0.35) * WIDTH, 0.0
        block.apply_translation(place)
        solids.append(block)
    return solids


def _make_block(length: float, width: float, height: float) -> trimesh.Trimesh:
    """Return a block with sloped sides that reaches half as deep as the floor."""
    low = -_DEPTH / 2
    spread = (height - low) / SLOPE
    corners = [
        (x * (length / 2 + out), y * (width / 2 + out), z)
        for z, out in ((height, 0.0), (low, spread))
        for x in (-1, 1)
        for y in (-1, 1)
    ]
    return trimesh.convex.convex_hull(np.array(corners))


def make_true_rubble(seed: int) -> Arena:
    """Return the rubble as it is, which judges alone."""
    solids = make_blocks(seed)
    surface = trimesh.boolean.union(solids, engine="manifold")
    quality = ArenaQuality(mean=0.0, p95=0.0, max=0.0, num_pieces=len(solids))
    return Arena(f"rubble-{seed}-truth", solids, surface, quality, friction_source="exact")


def make_scanned_rubble(seed: int) -> Arena:
    """Return the rubble as a survey found it."""
    points = thin(preprocess(survey(make_true_rubble(seed).surface, seed=seed)), SPACING)
    mesh = reconstruct(points, method="gsrm", units=UNITS, seed=seed).mesh
    made = make_arena(mesh, name=f"rubble-{seed}", seed=seed, time_limit=TIME_LIMIT)
    return replace(made, quality=replace(made.quality, seconds=0.0))


def save_rubble(folder: Path, seed: int) -> tuple[Path, Path]:
    """Make what a folder lacks, and return the folders of the scanned and of the exact rubble."""
    scanned, exact = folder / f"rubble-{seed}", folder / f"rubble-{seed}-truth"
    for path, make in ((scanned, make_scanned_rubble), (exact, make_true_rubble)):
        if not (path / "arena.json").is_file():
            make(seed).save(path)
    return scanned, exact
