"""What decides how a trained map learns from new readings."""

from dataclasses import dataclass, field

from reconstruction._src.base.range_checks import check_all_positive


@dataclass(frozen=True)
class MotionConfig:
    """When a contradicted part moves with its faces instead of being grown again. Lengths are in mean edges.

    Attributes:
        max_distance: a part moves where only few readings are farther from it; beyond, its faces would not fit. With an
            edge and more, floor moves up to become the lid of a box that is as high, whose sides have no units.
        max_gone_share: it moves where no larger share of its units is gone without new readings next to them.
        max_edge: an edge that would become longer shows that units are missing there: the part stays and is grown
            again.
        settle_passes: passes in which each unit moves to the mean of the samples it wins.
    """

    max_distance: float = 0.8
    max_gone_share: float = 0.2
    max_edge: float = 3.5
    settle_passes: int = 3

    def __post_init__(self) -> None:
        check_all_positive(self, may_be_zero=("max_gone_share", "settle_passes"))


@dataclass(frozen=True)
class RegrowthConfig:
    """How units are grown again where a map is contradicted. Lengths are in mean edges.

    Attributes:
        reach: samples and units nearer to a new unit than this take part.
        cover: a sample farther than this from all units gets a unit of its own; smaller makes the new part denser
            than the map.
        settle_passes: passes in which each new unit moves to the mean of the samples it wins.
        settle_reach: samples farther from all new units than this take no part in settling.
        samples_per_unit: samples of each new unit that take part in settling.
        topology_samples: samples of each unit that is joined again that witness its faces.
        min_distance: smallest distance of two new units; of two that are closer, one is removed.
        max_repeats: attempts to grow again where units have left a hole.
        min_island: new faces not joined to a kept unit are a surface of their own if they are this many.
        joint_rings: rings of kept units around the new ones that take part in learning the faces.
        min_samples: fewer samples do not determine a surface.
    """

    reach: float = 2.0
    cover: float = 0.75
    settle_passes: int = 3
    settle_reach: float = 1.5
    samples_per_unit: int = 8
    topology_samples: int = 26
    min_distance: float = 0.5
    max_repeats: int = 2
    min_island: int = 24
    joint_rings: int = 2
    min_samples: int = 16

    def __post_init__(self) -> None:
        check_all_positive(self, may_be_zero=("settle_passes", "max_repeats", "joint_rings"))


@dataclass(frozen=True)
class GSRMRefinementConfig:
    """How a trained map learns from new readings.

    Attributes:
        sample_margin: points in the box around the contradicted units, widened by this many mean edges, take part.
        unit_area: surface that a unit stands for, in squared mean edges; of equilateral faces it is 0.87, of those
            of a map less.
        readings_per_unit: largest number of new readings per unit that are all used; of more, only a part is.
        max_extension_rise: readings beyond the boundary that rise by less than this (sine against the surface) extend
            it: the old points at the boundary are still valid.
        min_confirmations: readings that a unit must win on average for their absence to mean that it is gone.
        fit_rounds: of the fit of a changed part: iterations, and samples of each movable unit. Between two rounds
            edges are turned along the creases that have come out.
        unfold_rings: rings of units around the changed ones that may move where faces are folded or intersect; fewer
            leave more of them.
        motion: when a part moves with its faces.
        regrowth: how a part is grown again.
    """

    sample_margin: float = 1.5
    unit_area: float = 0.7
    readings_per_unit: int = 40
    max_extension_rise: float = 0.5
    min_confirmations: float = 4.0
    fit_rounds: tuple[tuple[int, int], ...] = ((2, 12), (2, 28), (2, 28), (2, 40))
    unfold_rings: int = 4
    motion: MotionConfig = field(default_factory=MotionConfig)
    regrowth: RegrowthConfig = field(default_factory=RegrowthConfig)

    def __post_init__(self) -> None:
        check_all_positive(self, may_be_zero=("unfold_rings",))
