"""What contact geometry is wanted, and what it is: convex pieces, or a height field; `make_arena` lists the kinds."""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import trimesh
from jaxtyping import Float

from reconstruction._src.base.range_checks import check_choice, check_counts, check_positive
from reconstruction._src.geometry.elevation import Elevation
from symbrion_gym._src.contact.quality import ArenaQuality
from symbrion_gym._src.errors import ArenaError

CONTACT_KINDS = ("convex", "hfield", "prisms", "mixed")  # What an arena can be made of
CONTACT_CHOICES = ("auto", *CONTACT_KINDS)  # What can be asked for
ACCEPTANCE_P95 = 3.0  # 95th percentile of the distance that is good enough, in accuracies
UNCOVERED = 0.008  # Share of the surface without contact within 5 cm that is good enough
FIELD_BASE = 0.2  # How far a height field reaches below its lowest point [m]
_INSIDE = 1e-6  # The grid of a height field begins this far inside the rim [m], so that the rim itself is hit
_SPACING = 0.02  # Distance of its points, unless another is asked for [m]
_MAX_CELLS = 400_000  # They are farther apart where there would be more


@dataclass(frozen=True)
class ContactOptions:
    """What contact geometry is wanted.

    Raises:
        ArenaError: an option is out of range.
    """

    # mean distance between contact and surface that is good enough [m]; None: see `find_accuracy`
    accuracy: float | None = None
    max_pieces: int = 2200  # no more convex pieces than these
    kind: str = "auto"  # one of `CONTACT_CHOICES`
    seed: int = 0  # seed of coacd's search
    reach: float | None = 1.2  # height above ground up to which the accuracy is wanted [m]; None: everywhere
    for_size: float = 0.105  # of the smallest wheel or body that will drive there [m]

    def __post_init__(self) -> None:
        check_choice("kind", self.kind, CONTACT_CHOICES, ArenaError)
        numbers = ("accuracy", "reach", "for_size")
        check_positive(self, [name for name in numbers if getattr(self, name) is not None], ArenaError)
        check_counts(self, ("max_pieces",), ArenaError)


class HeightField(NamedTuple):
    """Heights on a grid."""

    heights: Float[np.ndarray, "R C"]  # rows along y, columns along x; no NaN: beyond the rim, the lowest [m]
    low: Float[np.ndarray, " 2"]  # (x, y) of the first row and column [m]
    high: Float[np.ndarray, " 2"]  # (x, y) of the last [m]

    def find_places(self) -> tuple[Float[np.ndarray, "R C"], Float[np.ndarray, "R C"]]:
        """Return x and y of the heights [m]."""
        rows, columns = self.heights.shape
        x, y = (np.linspace(self.low[i], self.high[i], n) for i, n in ((0, columns), (1, rows)))
        return tuple(np.meshgrid(x, y))

    def as_mesh(self) -> trimesh.Trimesh:
        """Return the surface as MuJoCo splits it: two triangles a cell."""
        rows, columns = self.heights.shape
        vertices = np.stack([*self.find_places(), self.heights], axis=-1).reshape(-1, 3)
        corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
        first = np.stack([corner, corner + 1, corner + columns], axis=1)
        second = np.stack([corner + 1, corner + columns + 1, corner + columns], axis=1)
        return trimesh.Trimesh(vertices, np.concatenate([first, second]), process=False)


def make_height_field(mesh: trimesh.Trimesh, ground: Elevation, spacing: float = _SPACING) -> HeightField:
    """Sample a terrain on a grid."""
    low, high = mesh.bounds[:, :2]
    spacing = max(spacing, float(np.sqrt(np.prod(high - low) / _MAX_CELLS)))
    columns, rows = (max(int(np.ceil(extent / spacing)) + 1, 2) for extent in high - low)
    field = HeightField(np.zeros((rows, columns)), low + _INSIDE, high - _INSIDE)
    heights = ground.height(*field.find_places())
    if np.isnan(heights).all():
        raise ArenaError("a height field needs ground that is seen from above")
    return field._replace(heights=np.where(np.isnan(heights), np.nanmin(heights), heights))


@dataclass(frozen=True)
class Contact:
    """Contact geometry of a surface."""

    pieces: list[trimesh.Trimesh]  # convex solids
    quality: ArenaQuality  # distances from the surface
    height_field: HeightField | None = None  # in place of pieces, for the kind "hfield"
    notes: dict[str, Any] = field(default_factory=dict)  # how it came about, for JSON
