"""How known objects are searched for."""

from __future__ import annotations

from dataclasses import dataclass

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.base.range_checks import check_counts, check_positive


@dataclass(frozen=True)
class ObjectsConfig:
    """How known objects are searched for, and what counts as found.

    Attributes:
        spacing: readings are averaged in cells of this width for the search [m]. Wider: faster, and small parts of an
            object are lost. The verification uses every beam.
        noise: standard deviation of the ranges [m]; None to measure it on the large planes of the scan.
        min_noise: noise that is measured counts as no less [m]: the mesh of an object is not exact either.
        tolerance: a beam agrees with the object within this many standard deviations of the noise.
        min_score: share of the beams that agree, of those that say something; lower: more false finds.
        min_coverage: share of the beams at the object that end on it; lower: objects that are hidden for a larger
            part are found, and more that are none.
        min_beams: fewest beams that must end on an object.
        plane_area: a plane of this many times the largest side of the object's box is wall, floor or table top. It
            is not searched.
        num_hypotheses: as many poses of the library are refined in each region.
        sampling: distance of the points of the object in the library's matching, as a share of its diameter.

    Raises:
        ReconstructionError: a number is out of range.
    """

    spacing: float = 0.008
    noise: float | None = None
    min_noise: float = 0.002
    tolerance: float = 3.0
    min_score: float = 0.94
    min_coverage: float = 0.3
    min_beams: int = 40
    plane_area: float = 2.5
    num_hypotheses: int = 12
    sampling: float = 0.07

    def __post_init__(self) -> None:
        names = ["spacing", "min_noise", "tolerance", "min_score", "min_coverage", "plane_area", "sampling"]
        check_positive(self, names + (["noise"] if self.noise is not None else []), ReconstructionError)
        check_counts(self, ("min_beams", "num_hypotheses"), ReconstructionError)
        for name in ("min_score", "min_coverage", "sampling"):
            if getattr(self, name) > 1.0:
                raise ReconstructionError(
                    f"ObjectsConfig.{name} is a share, at most 1, got {getattr(self, name)!r}"
                )
