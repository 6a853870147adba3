"""Rooms with few things in them, and a scan of each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import trimesh

from benchmarks.material.made_scenes import MadeScan, scan

_WALL = 0.2
"""Thickness of walls, floor and ceiling [m]."""


def make_bare_room(seed: int = 11) -> MadeScan:
    """Make a room of 5 x 4 x 2.6 m with a round column and a box."""
    column = trimesh.creation.cylinder(0.25, 2.7, sections=64).apply_translation((1.2, 0.6, 1.3))
    box = trimesh.creation.box((0.8, 0.6, 0.7)).apply_translation((-1.3, -0.9, 0.3))
    return _scan_inside((5.0, 4.0, 2.6), [column, box], [[-0.5, 0.8, 1.4], [1.6, -1.1, 1.2]], seed)


def make_warehouse(seed: int = 12) -> MadeScan:
    """Make a hall of 9 x 6 x 3.5 m with four round columns and two rows of crates."""
    things = [
        trimesh.creation.cylinder(0.2, 3.6, sections=64).apply_translation((x, y, 1.75))
        for x in (-2.0, 2.0)
        for y in (-1.5, 1.5)
    ]
    things += [
        trimesh.creation.box((1.2, 0.8, 1.0)).apply_translation((x, 2.3, 0.45))
        for x in (-3.2, -0.6, 0.9, 3.4)
    ]
    return _scan_inside((9.0, 6.0, 3.5), things, [[-3.3, -0.4, 1.5], [0.2, 0.1, 1.5], [3.5, -0.2, 1.5]], seed)


def make_office(seed: int = 13) -> MadeScan:
    """Make a room of 6.5 x 4.5 x 2.8 m with three tables, two cupboards and two boxes."""
    things = []
    for x, y in ((-2.0, 0.9), (0.3, 1.1), (2.1, -0.6)):
        things.append(trimesh.creation.box((1.4, 0.7, 0.04)).apply_translation((x, y, 0.72)))
        things += [
            trimesh.creation.box((0.05, 0.05, 0.75)).apply_translation((x + u, y + v, 0.36))
            for u in (-0.65, 0.65)
            for v in (-0.3, 0.3)
        ]
    things += [
        trimesh.creation.box((0.9, 0.5, 1.9)).apply_translation((x, -2.05, 0.93)) for x in (-2.6, -1.6)
    ]
    things += [trimesh.creation.box((0.4, 0.3, 0.5)).apply_translation((x, -1.2, 0.23)) for x in (0.2, 1.0)]
    return _scan_inside((6.5, 4.5, 2.8), things, [[-0.9, -0.4, 1.4], [1.2, 0.2, 1.3]], seed)


def make_corridor(seed: int = 14) -> MadeScan:
    """Make a corridor of 10 x 2.2 x 2.5 m with a pipe along it, a bench and a crate."""
    pipe = trimesh.creation.cylinder(0.1, 10.2, sections=48)
    pipe.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (0, 1, 0), (0, 0, 0)))
    bench = trimesh.creation.box((1.6, 0.4, 0.45)).apply_translation((-2.0, -0.85, 0.2))
    crate = trimesh.creation.box((0.6, 0.6, 0.6)).apply_translation((2.6, 0.6, 0.27))
    things = [pipe.apply_translation((0.0, 0.85, 2.2)), bench, crate]
    return _scan_inside((10.0, 2.2, 2.5), things, [[-3.6, 0.1, 1.4], [0.3, 0.0, 1.4], [3.9, -0.1, 1.4]], seed)


ROOMS: dict[str, Callable[[], MadeScan]] = {
    "bare room": make_bare_room,
    "warehouse": make_warehouse,
    "office": make_office,
    "corridor": make_corridor,
}


def _scan_inside(
    size: tuple[float, float, float], things: list[trimesh.Trimesh], viewpoints: list[list[float]], seed: int
) -> MadeScan:
    """Scan a closed room with things in it."""
    outer = trimesh.creation.box([side + 2 * _WALL for side in size]).apply_translation((0, 0, size[2] / 2))
    inner = trimesh.creation.box(size).apply_translation((0, 0, size[2] / 2))
    shell = trimesh.boolean.difference([outer, inner])
    return scan(trimesh.boolean.union([shell, *things]), viewpoints, 40_000, seed)
