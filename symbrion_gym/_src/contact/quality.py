"""How well the contact of an arena follows its surface, as numbers."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float, Int
from scipy.ndimage import maximum_filter, minimum_filter

from reconstruction._src.base.typed_json import JsonError, as_type
from reconstruction._src.geometry.elevation import Elevation
from reconstruction._src.geometry.sampling import sample_cells
from symbrion_gym._src.errors import ArenaError

Vectors = Float[np.ndarray, "R 3"]  # Of each ray: its origin [m], or its direction

_SPACING = 0.01  # Distance of vertical lines [m]
_MAX_RAYS = 400_000  # They are farther apart where there would be more: bounds time and memory
_MARGIN = 0.02
"""Ground that rises by twice as much within this distance is a step, beside which nothing counts [m]."""
_ROUNDING = 1e-6  # Keeps a radius of a whole number of cells from becoming one more [cells]

_DISTANCES = (
    "mean",
    "p95",
    "max",
    "seconds",
    "protrusion_mean",
    "protrusion_p95",
    "protrusion_max",
    "readings",
)
_SHARES = ("uncovered", "beams_contact", "beams_surface", "free_space", "dropped")


@dataclass(frozen=True)
class ArenaQuality:
    """Distances between contact geometry and the surface, of points all over both: walls and overhangs included.

    Raises:
        ArenaError: a field is out of range.
    """

    # mean distance of the surface from contact [m]; inf where there is nothing to measure on, as are the next
    # two and the bias
    mean: float
    p95: float  # 95th percentile [m]
    max: float  # largest [m]
    num_pieces: int  # number of contact pieces
    # mean distance, above 0 where contact stands in front of the surface, below where behind [m]
    bias: float = 0.0
    uncovered: float = 0.0  # share of the surface without contact geometry within 5 cm
    seconds: float = 0.0  # time that the decomposition took [s]
    # mean distance of points on the exposed side of the contact geometry from the surface: how far contact
    # stands in front of it [m]. None where not measured, as are all below.
    protrusion_mean: float | None = None
    protrusion_p95: float | None = None  # 95th percentile [m]
    protrusion_max: float | None = None  # largest [m]
    # share of the scanner's beams that end on contact geometry within 5 cm of their reading
    beams_contact: float | None = None
    beams_surface: float | None = None  # the same share on the surface, which bounds what contact can reach
    # share of the space that the scanner saw to be free that is inside contact geometry
    free_space: float | None = None
    dropped: float | None = None  # share of the readings that pre-processing dropped
    readings: float | None = None  # median distance of the readings of level ground from the surface [m]

    def __post_init__(self) -> None:
        for name in (*_DISTANCES, "num_pieces", *_SHARES):
            value, most = getattr(self, name), 1 if name in _SHARES else np.inf
            if value is not None and not 0 <= value <= most:
                raise ArenaError(f"{name} is {value}; a number from 0 to {most} is needed")

    def as_dict(self) -> dict[str, Any]:
        """Return the fields, for JSON: without those not measured, None where there was nothing to measure on."""
        measured = {name: value for name, value in asdict(self).items() if value is not None}
        return {name: value if np.isfinite(value) else None for name, value in measured.items()}

    @classmethod
    def from_dict(cls, fields: dict[str, Any]) -> "ArenaQuality":
        """Return what `as_dict` was made of."""
        known = {name: np.inf if value is None else value for name, value in fields.items()}
        try:
            return as_type(known, cls, "quality")
        except JsonError as error:
            raise ArenaError(str(error)) from error

    @classmethod
    def of_gaps(
        cls,
        gaps: Float[np.ndarray, " N"],
        uncovered: float,
        num_pieces: int,
        seconds: float = 0.0,
        protrusions: Float[np.ndarray, " M"] | None = None,
    ) -> "ArenaQuality":
        """Summarize signed distances of contact from the surface [m], above 0 where contact stands in front of it."""
        if not len(gaps) or not np.isfinite(gaps).all():
            return cls(np.inf, np.inf, np.inf, num_pieces, np.inf, 1.0, seconds)
        figures = _summarize(np.abs(gaps))
        exposed = (None,) * 3 if protrusions is None or not len(protrusions) else _summarize(protrusions)
        return cls(*figures, num_pieces, float(gaps.mean()), uncovered, seconds, *exposed)


def _summarize(distances: Float[np.ndarray, " N"]) -> tuple[float, float, float]:
    """Return mean, 95th percentile and maximum."""
    return float(distances.mean()), float(np.percentile(distances, 95)), float(distances.max())


def measure_arena(
    pieces: list[trimesh.Trimesh], surface: trimesh.Trimesh, *, region: trimesh.Trimesh | None = None
) -> ArenaQuality:
    """Compare the top of pieces with a surface along vertical lines, away from steps; `region` bounds where."""
    low, high = (region or surface).bounds[:, :2]
    spacing = max(_SPACING, float(np.sqrt(np.prod(high - low) / _MAX_RAYS)))
    x, y = np.moveaxis(sample_cells(low, high, spacing), -1, 0)
    wanted, touched = Elevation(surface).height(x, y), Elevation(*pieces).height(x, y)
    is_there, is_touched = np.isfinite(wanted), np.isfinite(touched)
    if region is not None:
        is_there &= np.isfinite(Elevation(region).height(x, y))
    is_open = is_there & (_compute_relief(wanted, _MARGIN / spacing) < 2.0 * _MARGIN)
    gaps = (touched - wanted)[is_open & is_touched]
    uncovered = float(1.0 - is_touched[is_there].mean()) if len(gaps) else 1.0
    return ArenaQuality.of_gaps(gaps, uncovered, len(pieces))


def _compute_relief(heights: Float[np.ndarray, "X Y"], radius: float) -> Float[np.ndarray, "X Y"]:
    """Return the difference of the highest and lowest point within a radius (in cells) on a grid with gaps (NaN)."""
    reach = max(int(np.ceil(radius - _ROUNDING)), 1)
    steps = np.arange(-reach, reach + 1)
    disc = np.hypot(*np.meshgrid(steps, steps)) <= max(radius, 1.0) + _ROUNDING
    is_gap = np.isnan(heights)
    highest = maximum_filter(np.where(is_gap, -np.inf, heights), footprint=disc, mode="nearest")
    lowest = minimum_filter(np.where(is_gap, np.inf, heights), footprint=disc, mode="nearest")
    return highest - lowest


def join_meshes(meshes: Sequence[trimesh.Trimesh]) -> tuple[Float[np.ndarray, "V 3"], Int[np.ndarray, "F 3"]]:
    """Return vertices and faces of several meshes as those of one; each keeps its own vertices."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = np.concatenate([np.zeros((0, 3)), *(np.asarray(mesh.vertices) for mesh in meshes)])
    faces = [np.asarray(mesh.faces) + start for mesh, start in zip(meshes, starts[:-1], strict=True)]
    return vertices, np.concatenate([np.zeros((0, 3), dtype=np.int64), *faces])


class RayMesh:
    """Casts rays on the triangles of meshes, from both sides; the first triangle along a ray counts."""

    def __init__(self, meshes: Sequence[trimesh.Trimesh]) -> None:
        """Build the tree."""
        import igl

        self._mesh, self._tree = join_meshes(meshes), igl.AABB()
        if len(self._mesh[1]):
            self._tree.init(*self._mesh)

    def cast(self, origins: Vectors, directions: Vectors, reach: float = np.inf) -> Float[np.ndarray, " R"]:
        """Return the distance of the first triangle along each ray, in lengths of its direction; inf: none in reach."""
        if not len(self._mesh[1]) or not len(origins):
            return np.full(len(origins), np.inf)
        triangles, distances, _ = self._tree.intersect_ray_first(*self._mesh, origins, directions, reach)
        return np.where(np.asarray(triangles) < 0, np.inf, distances)
