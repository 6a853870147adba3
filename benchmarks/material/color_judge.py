"""An independent judge of colors: from files, at places of the true surface, against formulas written down here.

Nothing of the packages that colors a surface is used: OBJ and PNG are read here, the patterns are stated again.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import igl
import numpy as np
import trimesh
from scipy.spatial import cKDTree

Paint = Callable[[np.ndarray], np.ndarray]
"""Returns the true colors (0 to 1) of positions [m]."""
EDGE = 0.05
"""Samples nearer than this to an edge of the true colors are judged apart [m]."""
_STEP = 0.1
"""A channel that changes by more than this within `EDGE` has an edge there."""
_FARTHEST = 0.05
"""A true place farther than this from the mesh has no surface there, and no color [m]."""
_NUM_SAMPLES = 30_000


class Surface(NamedTuple):
    """A colored surface as the files of an arena have it.

    Attributes:
        vertices: [m].
        faces: of vertices.
        colors: of vertices, 0 to 1.
        uv: place in the picture of each corner of each face.
        picture: rows from the top.
    """

    vertices: np.ndarray
    faces: np.ndarray
    colors: np.ndarray
    uv: np.ndarray
    picture: np.ndarray


def paint_checker(places: np.ndarray) -> np.ndarray:
    """Return the colors of cubes of 0.3 m, shifted by 0.15 m along x and 0.125 m along z."""
    odd = sum(np.floor((places[:, k] - shift) / 0.3) for k, shift in ((0, 0.15), (1, 0.0), (2, 0.125))) % 2
    return np.where(odd[:, None] > 0.5, [0.15, 0.35, 0.65], [0.85, 0.45, 0.20])


def paint_stripes(places: np.ndarray) -> np.ndarray:
    """Return the colors of four stripes across x, each 0.3 m wide."""
    table = np.array([[0.80, 0.25, 0.25], [0.90, 0.80, 0.30], [0.25, 0.60, 0.35], [0.30, 0.40, 0.75]])
    return table[np.floor((places[:, 0] - 0.15) / 0.3).astype(int) % 4]


def paint_gradient(places: np.ndarray) -> np.ndarray:
    """Return colors that change slowly along all axes."""
    x, y, z = places.T
    phases = (0.9 * x + 0.4 * y + 0.5 * z, -0.6 * x + 1.1 * y + 0.7 * z, 0.5 * x - 0.8 * y + 1.3 * z)
    return np.stack([0.5 + 0.35 * np.sin(phase) for phase in phases], axis=1)


PAINTS: dict[str, Paint] = {
    "checker": paint_checker,
    "stripes": paint_stripes,
    "gradient": paint_gradient,
}


def judge(
    folder: Path, truth: trimesh.Trimesh, paint: Paint, seed: int = 0, readings: np.ndarray | None = None
) -> dict[str, float]:
    """Compare the colors in a folder (`surface.obj`, `surface.png`) with the true ones, at places of the true surface.

    Args:
        folder: of an arena, in the frame of the truth.
        truth: the true surface [m].
        paint: its colors.
        seed: of the places.
        readings: `[N, 3]` colored points that the surface was made of [m]: adds `texture_read`, that of the places away
            from edges that have a reading as near as edges may be, and `read`, their share.

    Returns:
        Root mean square errors over red, green and blue, of 1: `vertices` and `texture` away from edges,
        `texture_everywhere`; `away`, the share of the covered places that is away from edges; `covered`.
    """
    surface = read_surface(folder)
    places = sample(truth, _NUM_SAMPLES, seed)
    square, face, nearest = igl.point_mesh_squared_distance(places, surface.vertices, surface.faces)
    covered = square < _FARTHEST**2
    places, face, nearest = places[covered], face[covered], nearest[covered]
    weights = _find_weights(surface.vertices[surface.faces[face]], nearest)
    true, away = paint(places), find_away(places, paint)
    by_vertex = np.einsum("nk,nki->ni", weights, surface.colors[surface.faces[face]])
    by_texture = _look_up(surface, face, weights)
    extra: dict[str, float] = {}
    if readings is not None:
        is_read = away & (cKDTree(readings).query(places)[0] <= EDGE)
        extra = {
            "texture_read": _rms((by_texture - true)[is_read]),
            "read": float(is_read.sum() / away.sum()),
        }
    return extra | {
        "vertices": _rms((by_vertex - true)[away]),
        "texture": _rms((by_texture - true)[away]),
        "texture_everywhere": _rms(by_texture - true),
        "away": float(away.mean()),
        "covered": float(covered.mean()),
    }


def find_away(places: np.ndarray, paint: Paint) -> np.ndarray:
    """Return which places have like colors in all directions as far as `EDGE`."""
    true, away = paint(places), np.ones(len(places), dtype=bool)
    steps = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z])
    for step in EDGE * steps / np.linalg.norm(steps, axis=1, keepdims=True):
        away &= np.abs(paint(places + step) - true).max(axis=1) <= _STEP
    return away


def sample(mesh: trimesh.Trimesh, count: int, seed: int) -> np.ndarray:
    """Return places spread over the area of a mesh."""
    rng = np.random.default_rng(seed)
    corners = np.asarray(mesh.triangles)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    chosen = rng.choice(len(area), count, p=area / area.sum())
    return np.einsum("nk,nki->ni", rng.dirichlet(np.ones(3), count), corners[chosen])


def read_surface(folder: Path) -> Surface:
    """Read the files of a colored surface."""
    from PIL import Image

    vertices, uv, faces, places = [], [], [], []
    for line in (folder / "surface.obj").read_text().splitlines():
        kind, *words = line.split()
        if kind == "v":
            vertices.append([float(word) for word in words])
        elif kind == "vt":
            uv.append([float(word) for word in words])
        elif kind == "f":
            pairs = [word.split("/") for word in words]
            faces.append([int(pair[0]) - 1 for pair in pairs])
            places.append([int(pair[1]) - 1 for pair in pairs])
    rows = np.array(vertices)
    picture = np.asarray(Image.open(folder / "surface.png").convert("RGB")) / 255
    return Surface(rows[:, :3].copy(), np.array(faces), rows[:, 3:], np.array(uv)[np.array(places)], picture)


def _look_up(surface: Surface, face: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the texels that places fall on."""
    height, width = surface.picture.shape[:2]
    uv = np.einsum("nk,nki->ni", weights, surface.uv[face])
    columns = np.clip((uv[:, 0] * width).astype(int), 0, width - 1)
    rows = np.clip(((1 - uv[:, 1]) * height).astype(int), 0, height - 1)
    return surface.picture[rows, columns]


def _find_weights(corners: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return barycentric coordinates by areas."""
    parts = [
        np.linalg.norm(np.cross(corners[:, (k + 1) % 3] - places, corners[:, (k + 2) % 3] - places), axis=1)
        for k in range(3)
    ]
    areas = np.stack(parts, axis=1)
    total = areas.sum(axis=1, keepdims=True)
    return np.where(total > 0, areas / np.maximum(total, 1e-30), 1 / 3)


def _rms(error: np.ndarray) -> float:
    return float(np.sqrt((error**2).mean()))
