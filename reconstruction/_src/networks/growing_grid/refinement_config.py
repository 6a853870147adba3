"""What decides how a trained grid learns from new readings."""

from dataclasses import dataclass

from reconstruction._src.base.range_checks import check_all_positive


@dataclass(frozen=True)
class GridRefinementConfig:
    """How a trained grid learns from new readings. Lengths are in usual (median) edges of the grid.

    Attributes:
        sample_margin: points in the box around the contradicted units, widened by this, take part.
        closing: gaps of up to twice this many units between moved units have moved with them.
        stray_share: where no larger share of a unit's new readings disagree, nothing has changed.
        sigma: width of the neighborhood while learning, in grid steps.
        iterations: batch steps a round.
        max_rounds: rounds of learning and inserting lines.
        stretch: a gap gets lines where its active edges are longer than this.
        min_edges: active edges across a gap that gets a line; fewer may be long by chance.
        max_lines: lines that one gap may get in a round.
        samples_per_unit: samples for each unit that takes part; more are slower.
        max_fit_iterations: iterations of the fit: a part has less far to go than a new grid.
        unfold_rings: rings of units around the changed ones that may move where triangles are folded or intersect.
        support_reach: a sample supports the cells around the unit that it is nearest to, up to this distance.
        support_rings: rings of units round those that samples support and that are surface with them.
    """

    sample_margin: float = 2.0
    closing: int = 2
    stray_share: float = 0.1
    sigma: float = 0.9
    iterations: int = 5
    max_rounds: int = 8
    stretch: float = 1.6
    min_edges: int = 2
    max_lines: int = 64
    samples_per_unit: int = 6
    max_fit_iterations: int = 4
    unfold_rings: int = 2
    support_reach: float = 2.0
    support_rings: int = 2

    def __post_init__(self) -> None:
        check_all_positive(self, may_be_zero=("closing", "stray_share", "support_rings", "unfold_rings"))
