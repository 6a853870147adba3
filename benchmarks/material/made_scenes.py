"""Made scenes with known truth: solid bodies, and scans of them by a simulated laser scanner.

`python -m benchmarks.material.made_scenes FOLDER` writes every scene as FOLDER/NAME.npz with points,
viewpoints, seen_from, truth_vertices and truth_faces.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh

from benchmarks.material.array_files import save_arrays
from benchmarks.material.ray_casts import make_embree_cast

RANGE_NOISE = 0.005
"""Standard deviation of the range, as of a scanner of the middle class [m]."""
MAX_RANGE = 40.0
"""Longest range [m]."""


class MadeScan(NamedTuple):
    """A scan of a body that is known.

    Attributes:
        truth: the solid body, closed [m].
        points: `[N, 3]` readings [m].
        viewpoints: `[K, 3]` places of the scanner [m].
        seen_from: `[N]` row of the viewpoint of each reading.
    """

    truth: trimesh.Trimesh
    points: np.ndarray
    viewpoints: np.ndarray
    seen_from: np.ndarray


def scan(
    truth: trimesh.Trimesh, viewpoints: list[list[float]], num_beams: int, seed: int, lowest: float = -80.0
) -> MadeScan:
    """Scan a body from every viewpoint by a grid of equal steps in azimuth and elevation.

    Args:
        truth: the body.
        viewpoints: places of the scanner [m].
        num_beams: beams of each viewpoint, about; those that hit nothing give no reading.
        seed: of the noise and of the heading of the scanner.
        lowest: elevation of the lowest beam; the highest looks straight up [deg].
    """
    rng, cast = np.random.default_rng(seed), make_embree_cast(truth)
    num_rows = round(np.sqrt(num_beams * (90 - lowest) / 360))
    elevation = np.radians(np.linspace(lowest, 90, num_rows))
    points, seen_from = [], []
    for row, viewpoint in enumerate(np.asarray(viewpoints, float)):
        azimuth = (
            rng.uniform(0, 2 * np.pi)
            + 2 * np.pi * np.arange(round(num_beams / num_rows)) * num_rows / num_beams
        )
        tilt, heading = (grid.ravel() for grid in np.meshgrid(elevation, azimuth, indexing="ij"))
        directions = np.stack(
            [np.cos(tilt) * np.cos(heading), np.cos(tilt) * np.sin(heading), np.sin(tilt)], axis=1
        )
        ranges = cast(viewpoint, directions)
        is_hit = ranges < MAX_RANGE
        ranges = ranges[is_hit] + rng.normal(0, RANGE_NOISE, is_hit.sum())
        points.append(viewpoint + directions[is_hit] * ranges[:, None])
        seen_from.append(np.full(len(ranges), row))
    return MadeScan(truth, np.concatenate(points), np.asarray(viewpoints, float), np.concatenate(seen_from))


def make_room(seed: int = 0) -> MadeScan:
    """Make a room of 6 x 5 x 2.7 m with a doorway, a table, a shelf of five boards, and two boxes."""
    parts = [
        *_make_walls(6.0, 5.0, 2.7),
        *_make_table(1.0, 0.8, (1.6, 0.8)),
        _place_box((-2.3, 2.32, 0.0), (1.2, 0.36, 0.04)),
        *(_place_box((-2.3, 2.32, height), (1.2, 0.36, 0.025)) for height in (0.45, 0.9, 1.35, 1.8)),
        *(_place_box((x, 2.32, 0.0), (0.03, 0.36, 1.85)) for x in (-2.9, -1.7)),
        _place_box((-1.2, -1.4, 0.0), (0.6, 0.5, 0.4), yaw=25),
        _place_box((2.3, -1.9, 0.0), (0.35, 0.35, 0.3), yaw=-10),
    ]
    return scan(_unite(parts), [[-0.4, 0.3, 1.4], [2.2, 1.9, 1.2]], 32_000, seed)


def make_spiral_stairs(seed: int = 1) -> MadeScan:
    """Make a flight of 15 wedge-shaped steps around a column, each 0.17 m high, open below."""
    parts = [_place_box((0, 0, -0.2), (5.0, 5.0, 0.2)), _place_cylinder((0, 0, -0.1), 0.12, 3.6)]
    angle = np.radians(22.5)
    for step in range(15):
        turns = (step + np.linspace(-0.05, 1.05, 5)) * angle
        rim = 1.25 * np.stack([np.cos(turns), np.sin(turns)], axis=1)
        outline = np.concatenate([[[0.0, 0.0]], rim])
        top = 0.17 * (step + 1)
        corners = [np.column_stack([outline, np.full(len(outline), z)]) for z in (top - 0.22, top)]
        parts.append(trimesh.convex.convex_hull(np.concatenate(corners)))
    viewpoints = [[2.1, -0.9, 1.5], [-1.9, 1.2, 1.5], [-0.8, -2.1, 2.9], [1.2, 2.0, 3.3]]
    return scan(_unite(parts), viewpoints, 45_000, seed)


def make_rubble(seed: int = 2) -> MadeScan:
    """Make 200 rocks and blocks of 0.15 to 0.75 m, tilted and partly buried, on 6 x 6 m."""
    rng = np.random.default_rng(seed)
    parts = [_place_box((0, 0, -0.3), (6.0, 6.0, 0.3))]
    for number in range(200):
        size = 0.15 * 5 ** rng.uniform(0, 1)
        if number % 2:
            part = trimesh.creation.box(size * rng.uniform(0.4, 1.0, 3))
        else:
            cloud = rng.normal(size=(14, 3))
            cloud *= rng.uniform(0.8, 1.0, (14, 1)) / np.linalg.norm(cloud, axis=1, keepdims=True)
            part = trimesh.convex.convex_hull(size / 2 * cloud * rng.uniform(0.6, 1.0, 3))
        part.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
        part.apply_translation([*rng.uniform(-2.6, 2.6, 2), rng.uniform(-0.1, 0.3) * size])
        parts.append(part)
    viewpoints = [[2.6, 2.4, 1.5], [-2.5, 2.6, 1.6], [-2.4, -2.6, 1.4], [2.5, -2.3, 1.7]]
    return scan(_unite(parts), viewpoints, 50_000, seed)


def make_terrain(seed: int = 3) -> MadeScan:
    """Make 20 x 20 m of 1/f terrain, 0.6 m root mean square, scanned from four places 1.8 m above ground."""
    return _scan_terrain(seed, size=20.0, relief=0.6, height=1.8, smallest=0.25)


def make_rough_ground(seed: int = 4) -> MadeScan:
    """Make 3 x 3 m of 1/f ground, 0.12 m root mean square, scanned from four places 1.3 m above ground."""
    return _scan_terrain(seed, size=3.0, relief=0.12, height=1.3, smallest=0.06)


def make_thin_walls(seed: int = 5) -> MadeScan:
    """Make five panels 2 to 5 cm thick and 1.2 m high on a floor of 5 x 4 m, seen from both sides."""
    parts = [
        _place_box((0, 0, -0.2), (5.0, 4.0, 0.2)),
        _place_box((-1.2, 0.6, -0.05), (1.6, 0.02, 1.25)),
        _place_box((0.9, -0.4, -0.05), (0.03, 1.8, 1.25)),
        _place_box((-0.6, -1.1, -0.05), (1.4, 0.05, 1.25), yaw=30),
        _place_box((1.7, 1.1, -0.05), (1.0, 0.04, 1.25), yaw=-50),
        _place_box((-1.99, -0.3, -0.05), (0.02, 1.4, 0.85)),
    ]
    viewpoints = [[-0.3, 1.5, 1.0], [2.1, -1.0, 1.5], [-1.4, -0.4, 1.0], [0.2, -0.3, 1.6]]
    return scan(_unite(parts), viewpoints, 30_000, seed)


def make_table(seed: int = 6) -> MadeScan:
    """Make a table with four legs on a floor of 3 x 3 m, seen from above and from below its top."""
    parts = [_place_box((0, 0, -0.2), (3.0, 3.0, 0.2)), *_make_table(0.0, 0.0, (1.2, 0.7))]
    return scan(_unite(parts), [[1.2, 1.0, 1.5], [-1.3, 0.7, 0.45], [0.2, -1.3, 1.2]], 45_000, seed)


SCENES: dict[str, Callable[[], MadeScan]] = {
    "room": make_room,
    "spiral stairs": make_spiral_stairs,
    "rubble": make_rubble,
    "terrain": make_terrain,
    "rough ground": make_rough_ground,
    "thin walls": make_thin_walls,
    "table": make_table,
}


def make_noise_heights(rng: np.random.Generator, num: int, size: float, smallest: float) -> np.ndarray:
    """Return heights of 1/f noise with root mean square 1, `[num, num]`.

    The amplitude of a wave grows with its length, down to the smallest one, below which there is nothing.
    """
    rate = np.hypot(
        *np.meshgrid(np.fft.fftfreq(num, size / num), np.fft.rfftfreq(num, size / num), indexing="ij")
    )
    rate[0, 0] = np.inf
    # A power of 1/f^3.6 is that of natural terrain: a fractal dimension of 2.2.
    amplitude = np.where(rate < 1 / smallest, rate**-1.8, 0.0)
    wave = amplitude * np.exp(2j * np.pi * rng.random(rate.shape))
    heights = np.fft.irfft2(wave, (num, num))
    return heights / heights.std()


def _scan_terrain(seed: int, size: float, relief: float, height: float, smallest: float) -> MadeScan:
    rng, num = np.random.default_rng(seed), 321
    # A part of a larger field: the noise itself repeats at its rim.
    heights = relief * make_noise_heights(rng, 2 * num, 2 * size, smallest)[:num, :num]
    heights -= heights.mean()
    side = np.linspace(-size / 2, size / 2, num)
    quarter = [round(num * share) for share in (0.22, 0.78)]
    places = [(i, j) for i in quarter for j in quarter]
    viewpoints = [[side[i], side[j], heights[i, j] + height] for i, j in places]
    return scan(_close_downwards(side, heights, size / 5), viewpoints, 40_000, seed, lowest=-85)


def _close_downwards(side: np.ndarray, heights: np.ndarray, depth: float) -> trimesh.Trimesh:
    num = len(side)
    x, y = np.meshgrid(side, side, indexing="ij")
    top = np.stack([x, y, heights], axis=2).reshape(-1, 3)
    corner = (np.arange(num - 1)[:, None] * num + np.arange(num - 1)).ravel()
    faces = np.concatenate(
        [
            np.stack([corner, corner + num, corner + num + 1], axis=1),
            np.stack([corner, corner + num + 1, corner + 1], axis=1),
        ]
    )
    index = np.arange(num * num).reshape(num, num)
    rim = np.concatenate([index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]])
    low = np.column_stack([top[rim, :2], np.full(len(rim), heights.min() - depth)])
    here, below = np.arange(len(rim)), len(top) + np.arange(len(rim))
    after, after_below = np.roll(rim, -1), np.roll(below, -1)
    center = len(top) + len(rim)
    skirt = [
        [rim, below, after_below],
        [rim, after_below, after],
        [below, np.full(len(here), center), after_below],
    ]
    vertices = np.concatenate([top, low, [[0, 0, low[0, 2]]]])
    triangles = np.concatenate([faces, *(np.stack(three, axis=1) for three in skirt)])
    return trimesh.Trimesh(vertices, triangles, process=False)


def _make_walls(length: float, width: float, height: float, thick: float = 0.15) -> list[trimesh.Trimesh]:
    """Make floor, ceiling and walls around the origin, with a doorway of 0.9 x 2 m in the wall at -x."""
    x, y = length / 2 + thick / 2, width / 2 + thick / 2
    outer = (length + 2 * thick, width + 2 * thick)
    jamb = (width - 0.9) / 2
    return [
        _place_box((0, 0, -thick), (*outer, thick)),
        _place_box((0, 0, height), (*outer, thick)),
        _place_box((0, y, -0.01), (outer[0], thick, height + 0.02)),
        _place_box((0, -y, -0.01), (outer[0], thick, height + 0.02)),
        _place_box((x, 0, -0.01), (thick, width + 0.02, height + 0.02)),
        *(
            _place_box((-x, s * (0.45 + jamb / 2), -0.01), (thick, jamb + 0.02, height + 0.02))
            for s in (-1, 1)
        ),
        _place_box((-x, 0, 2.0), (thick, width, height - 1.99)),
    ]


def _make_table(x: float, y: float, size: tuple[float, float], height: float = 0.75) -> list[trimesh.Trimesh]:
    legs = [(x + s * (size[0] / 2 - 0.06), y + t * (size[1] / 2 - 0.06)) for s in (-1, 1) for t in (-1, 1)]
    return [
        _place_box((x, y, height - 0.03), (*size, 0.03)),
        *(_place_box((*leg, -0.01), (0.05, 0.05, height)) for leg in legs),
    ]


def _place_box(foot: tuple, size: tuple, yaw: float = 0.0) -> trimesh.Trimesh:
    """Make a box that stands on the point `foot` [m], turned about the vertical [deg]."""
    turn = trimesh.transformations.rotation_matrix(np.radians(yaw), [0, 0, 1])
    turn[:3, 3] = np.add(foot, [0, 0, size[2] / 2])
    return trimesh.creation.box(size, turn)


def _place_cylinder(foot: tuple, radius: float, height: float) -> trimesh.Trimesh:
    place = trimesh.transformations.translation_matrix(np.add(foot, [0, 0, height / 2]))
    return trimesh.creation.cylinder(radius, height, sections=32, transform=place)


def _unite(parts: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    return trimesh.boolean.union(parts, engine="manifold")


def save(path: Path, made: MadeScan) -> None:
    """Write a scan and its truth as one file."""
    held = {
        "points": made.points,
        "viewpoints": made.viewpoints,
        "seen_from": made.seen_from,
        "truth_vertices": np.asarray(made.truth.vertices),
        "truth_faces": np.asarray(made.truth.faces),
    }
    save_arrays(path, held)


def main() -> None:
    """Read the command line and write every scene."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    for name, make in SCENES.items():
        made = make()
        print(
            f"{name:14s}{len(made.points):8d} points {len(made.viewpoints)} viewpoints "
            f"{len(made.truth.faces):7d} faces, closed {made.truth.is_watertight}, "
            f"{made.truth.volume:.3f} m3, extents {np.round(made.truth.extents, 2)}"
        )
        save(folder / f"{name.replace(' ', '_')}.npz", made)


if __name__ == "__main__":
    main()
