"""A course that changes after it was scanned: the surfaces before and after, and the readings of both."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import igl
import numpy as np
import trimesh
from scipy.spatial import KDTree

from reconstruction._src.geometry.sampling import sample_area
from reconstruction._src.surfaces.quality import find_distances
from symbrion_gym._src.arenas.course import Course

NUM_POINTS = 60_000
NOISE = 0.005
BOX = (-2.7, -2.3, -0.1, 0.3, 0.25)
"""A box on the floor: x from, to, y from, to, and height [m]."""
SCANNERS = np.array([[x, y, 1.2] for x in (-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0) for y in (-0.8, 0.8)])
"""Positions of the virtual scanner [m]."""
_CHANGED = 0.001


@dataclass(frozen=True)
class Change:
    """One scenario.

    Attributes:
        old: the surface when it was first scanned.
        new: the surface now.
        points: `[N, 3]` the first scan.
        new_points: `[M, 3]` the new readings.
        origins: `[M, 3]` scanner position of each, or None if unknown.
    """

    old: trimesh.Trimesh
    new: trimesh.Trimesh
    points: np.ndarray
    new_points: np.ndarray
    origins: np.ndarray | None = None

    def measure_remoteness(self, places: np.ndarray) -> np.ndarray:
        """Return the distance of places from everything that changed, `[Q]` [m]; infinite if nothing did."""
        changed = np.concatenate([_find_changed(self.old, self.new), _find_changed(self.new, self.old)])
        if len(changed) == 0:
            return np.full(len(places), np.inf)
        tree = KDTree(changed)
        return np.asarray(tree.query(places)[0])


def make_surface(
    course: Course, *, box: tuple[float, ...] | None = None, end: float = np.inf, widening: float = 0.0
) -> trimesh.Trimesh:
    """Return the course's surface, open and normals up.

    Args:
        course: the course.
        box: a box on its first floor.
        end: x at which it is cut off.
        widening: by how much the far wall of the pit has moved away [m].
    """
    profile = course.profile()
    profile[profile[:, 0] == course.pit / 2, 0] += widening
    quads = []
    for (x, z), (next_x, next_z) in itertools.pairwise(profile):
        if x >= end:
            break
        if next_x > end:
            next_x, next_z = end, z + (next_z - z) * (end - x) / (next_x - x)
        y = course.width / 2
        quads.append([(x, -y, z), (next_x, -y, next_z), (next_x, y, next_z), (x, y, z)])
    if box is not None:
        quads = _stand_on(quads[0], box) + quads[1:]
    vertices = np.array(quads).reshape(-1, 3)
    first = 4 * np.arange(len(quads))[:, None]
    faces = np.concatenate([first + np.array(corners) for corners in ((0, 1, 2), (0, 2, 3))])
    return trimesh.Trimesh(vertices, faces, process=False)


def draw(
    surface: trimesh.Trimesh,
    number: int,
    seed: int,
    is_selected: Callable | None = None,
    noise: float = NOISE,
) -> np.ndarray:
    """Return readings distributed over the surface, or over the selected part, `[number, 3]`."""
    rng = np.random.default_rng([seed, 1])
    wanted = number if is_selected is None else 16 * number
    points = sample_area(np.asarray(surface.vertices), np.asarray(surface.faces), wanted, seed)
    if is_selected is not None:
        points = points[is_selected(points)]
        points = points[np.sort(rng.permutation(len(points))[:number])]
    return points + rng.normal(0, noise, points.shape)


def scan(
    surface: trimesh.Trimesh, number: int, seed: int, is_selected: Callable | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return readings `[M, 3]` of the surface visible to the scanners, and the scanner position of each."""
    rng = np.random.default_rng([seed, 2])
    places = draw(surface, 3 * number, seed, is_selected, noise=0.0)
    origins = SCANNERS[rng.integers(len(SCANNERS), size=len(places))]
    vertices, faces = np.asarray(surface.vertices), np.asarray(surface.faces, dtype=np.int64)
    tree = igl.AABB()
    tree.init(vertices, faces)
    _, share, _ = tree.intersect_ray_first(vertices, faces, origins, places - origins)
    seen = rng.permutation(np.flatnonzero(np.abs(np.asarray(share) - 1) < 1e-6))[:number]
    return places[seen] + rng.normal(0, NOISE, (len(seen), 3)), origins[seen]


def make_changes(
    seed: int = 0, course: Course | None = None, box: tuple[float, ...] = BOX
) -> dict[str, Change]:
    """Return all scenarios; most have a tenth as many new readings as old ones.

    Args:
        seed: seed of the readings.
        course: the course; None for the default.
        box: the box that is new or gone.
    """
    course = course or Course()
    plain, boxed = make_surface(course), make_surface(course, box=box)
    wider = make_surface(course, widening=0.05)
    shorter = make_surface(course, end=2.7)
    points, with_box = draw(plain, NUM_POINTS, seed), draw(boxed, NUM_POINTS, seed)
    few, other = NUM_POINTS // 10, seed + 100
    around_pit, around_box = (lambda p: np.abs(p[:, 0]) < 0.45), _near_box(box, 0.25)
    seen, origins = scan(plain, few, other, around_box)
    stopped = draw(boxed, NUM_POINTS, other)
    stopped = stopped[~_near_box(box, 0.02)(stopped)]
    beyond = draw(plain, few, other, lambda p: p[:, 0] > 2.6)
    return {
        "agreeing": Change(plain, plain, points, draw(plain, few, other)),
        "wall moved": Change(plain, wider, points, draw(wider, few, other, around_pit)),
        "wall moved, thin scan of all": Change(plain, wider, points, draw(wider, few, other)),
        "box new": Change(plain, boxed, points, draw(boxed, few, other, around_box)),
        "box gone, rays": Change(boxed, plain, with_box, seen, origins),
        "box gone, readings": Change(boxed, plain, with_box, draw(plain, few, other, around_box)),
        "box gone, readings stopped": Change(boxed, plain, with_box, stopped),
        "extended": Change(shorter, plain, draw(shorter, NUM_POINTS, seed), beyond),
    }


def _near_box(box: tuple[float, ...], margin: float) -> Callable:
    def is_near(points: np.ndarray) -> np.ndarray:
        low = np.array([box[0], box[2]]) - margin
        high = np.array([box[1], box[3]]) + margin
        return np.asarray(((points[:, :2] > low) & (points[:, :2] < high)).all(axis=1))

    return is_near


def _stand_on(floor: list, box: tuple[float, ...]) -> list:
    """Return the quads of a level floor with a box on it: eight around the box, four sides, the top."""
    x0, x1, y0, y1, height = box
    low, high, z = floor[0][:2], floor[2][:2], floor[0][2]
    xs, ys = (low[0], x0, x1, high[0]), (low[1], y0, y1, high[1])
    quads = []
    for i in range(3):
        for j in range(3):
            up = z + height if (i, j) == (1, 1) else z
            quads.append(
                [
                    (xs[i], ys[j], up),
                    (xs[i + 1], ys[j], up),
                    (xs[i + 1], ys[j + 1], up),
                    (xs[i], ys[j + 1], up),
                ]
            )
    ring = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    for a, b in zip(ring, [*ring[1:], ring[0]], strict=True):
        quads.append([(*a, z), (*b, z), (*b, z + height), (*a, z + height)])
    return quads


def _find_changed(one: trimesh.Trimesh, other: trimesh.Trimesh) -> np.ndarray:
    """Return points of one surface that are not on the other."""
    places = sample_area(np.asarray(one.vertices), np.asarray(one.faces), 100_000)
    return places[find_distances(places, np.asarray(other.vertices), np.asarray(other.faces)) > _CHANGED]
