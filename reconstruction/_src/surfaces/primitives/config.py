"""What counts as a primitive."""

from __future__ import annotations

from dataclasses import dataclass

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.base.range_checks import check_all_positive


@dataclass(frozen=True)
class PrimitivesConfig:
    """Which shapes replace triangles.

    Attributes:
        tolerance: largest distance of a replaced vertex from its shape [m]; None: three times the noise of the
            surface, within `tolerance_limits`. Less leaves holes in planes, which rectangles must go around.
        tolerance_limits: of an estimated tolerance [m]. Beams on a shape are off those on the mesh by a quarter of the
            tolerance in the mean.
        normal_angle: largest angle between a face and its shape [rad]: normals of faces of 3 cm with a noise of 1 mm
            deviate by 4 degrees.
        min_area: of the faces of a shape [m²]; smaller ones stay triangles ...
        min_part: ... and those with a smaller share of the surface.
        min_covered: share of a closed shape (box, sphere, cylinder) that faces cover, at least.
        max_exposed: share of a closed shape that may stand where the surface says nothing.
        max_open: share of a rectangle that neither lies on the surface nor behind it, at most. Rectangles grow to the
            corners of a room and behind things that stand before them, so that little is left for the tree of
            triangles, and over ragged rims. More closes narrow openings: 0.02 closed half a doorway.
        min_rectangle: share of the surface that a rectangle of a plane has at least, where the surface is open ground:
            each costs every beam that looks its way, as much as a level or two of the tree of triangles ...
        min_rectangle_hollow: ... and where it is hollow, as a room, of which each beam meets more boxes of the tree.
        hollow: a surface is hollow with more area than this, relative to half that of the box around it.
        min_cover: share of the surface that rectangles and solids have together, or rectangles are left out: where most
            beams go through the tree all the same, they only cost.
        max_rectangles: of one plane, the largest first.
        cell: resolution at which a plane is divided into rectangles [m].
        margin: triangles reach below the rim of a rectangle by this much [m], so that no beam slips through.
        thickness: of the box behind a rectangle [m], away from free space.
        reach: the rest of a hollow surface is divided into what is this near to each plane [m] ...
        apart: ... and all others into groups that are this far apart [m], ...
        fewest: ... each of so many triangles at least.
        max_radius: of spheres and cylinders [m]; larger ones are hardly told from planes.
        candidates: drawn in a round, of each kind.
        sample: faces on which candidates are compared.
        misses: rounds without a shape after which the search ends.
        fits: rounds of fitting a shape to the faces that it explains.

    Raises:
        ReconstructionError: a value is not above 0, or limits are not in order.
    """

    tolerance: float | None = None
    tolerance_limits: tuple[float, float] = (0.004, 0.006)
    normal_angle: float = 0.35
    min_area: float = 0.03
    min_part: float = 0.003
    min_covered: float = 0.3
    max_exposed: float = 0.02
    max_open: float = 0.01
    min_rectangle: float = 0.06
    min_rectangle_hollow: float = 0.02
    hollow: float = 1.5
    min_cover: float = 0.6
    max_rectangles: int = 6
    cell: float = 0.01
    margin: float = 0.003
    thickness: float = 0.004
    reach: float = 0.2
    apart: float = 0.3
    fewest: int = 30
    max_radius: float = 1.0
    candidates: int = 200
    sample: int = 1500
    misses: int = 3
    fits: int = 4

    def __post_init__(self) -> None:
        check_all_positive(self)
        low, high = self.tolerance_limits
        if not 0.0 < low <= high:
            raise ReconstructionError(
                f"PrimitivesConfig.tolerance_limits is {self.tolerance_limits}; two lengths above 0 are needed, the "
                "lower first"
            )
