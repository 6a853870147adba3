"""What decides which faces a map gets."""

from dataclasses import dataclass

from reconstruction._src.base.range_checks import check_all_positive


@dataclass(frozen=True)
class TopologyConfig:
    """How faces are learned, and which holes are closed. Lengths are in sample spacings.

    Attributes:
        gap: a place farther than this from all samples is void, that is, no surface was seen there: a hole wider than
            four spacings. Lower, and gaps of uneven sampling become holes; higher, and small holes of the surface are
            closed.
        max_void: a face or patch whose void is larger spans a hole, in squared sample spacings; half a disc of the
            radius `gap`.
        min_cover: a face over which this share of the expected samples lies cuts a corner of the surface and has
            no void.
        min_patch_cover: likewise for the patches of `max_tip_edges`, which may reach far: with less, a hole in
            the data would be covered.
        few_samples: a unit that wins fewer samples may not see all its edges; places between it and its neighbors
            then count as samples where there are samples near them.
        num_neighbors: nearest units to which such a unit may be joined; six in a regular map.
        rim_neighbors: likewise at the boundary (the rim) of a component, between components.
        max_hole_edges: longer boundary loops are the boundary of the surface, not holes.
        max_tip_edges: longer loops are not tested for sharp tips and ridges.
        rim_cosine: a loop whose area vector lies against the normals next to it by more than this cosine runs
            around a piece of surface and not around a gap in it.
        max_folded: a patch of which a larger share of the faces is folded back is a second layer of the surface.
        reversed_cost: cost of a face that lies against the surface around it; well-shaped faces cost 0.5, slivers 1.
        min_component: components of fewer faces are debris, where another is `debris_ratio` times as large.
        debris_ratio: see `min_component`.
        max_repairs: rounds in which faces around a hole that cannot be closed are removed to close a larger one.
    """

    gap: float = 2.0
    max_void: float = 6.0
    min_cover: float = 0.2
    min_patch_cover: float = 0.75
    few_samples: int = 10
    num_neighbors: int = 6
    rim_neighbors: int = 24
    max_hole_edges: int = 24
    max_tip_edges: int = 64
    rim_cosine: float = -0.5
    max_folded: float = 0.3
    reversed_cost: float = 10.0
    min_component: int = 6
    debris_ratio: int = 50
    max_repairs: int = 6

    def __post_init__(self) -> None:
        check_all_positive(self, any_sign=("rim_cosine",))
