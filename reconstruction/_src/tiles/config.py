"""How a large scan is divided into tiles."""

from __future__ import annotations

from dataclasses import dataclass

from reconstruction._src.base.errors import ReconstructionError


@dataclass(frozen=True)
class TilesConfig:
    """How a large scan is divided, and how finely its tiles are reconstructed.

    Attributes:
        tile: edge of a square tile [m]. A tile and its halo are reconstructed at once: memory grows with their
            points, and each tile costs a fixed second or so. 50 m of an aerial scan are 10^5 to 10^6 points.
        halo: how far a tile's points reach into its neighbors [m]; None: a tenth of the tile. In it, the surfaces of
            two neighbors are blended. It must span several units of the network; wider costs time.
        units_per_area: units of the network in a square meter; None: one for each `points_per_unit` points.
        points_per_unit: points for each unit at least: with fewer, a network learns the noise.
        max_units: most units of a tile; bounds time and memory of a tile.
        min_units: a tile with points for fewer is left out, and counted: a rim that hardly has points.
        max_gap: seams are joined where the surfaces of both tiles are at most this far from each other, as a share
            of the halo. Further apart they are different surfaces, such as a roof and the ground.
    """

    tile: float = 50.0
    halo: float | None = None
    units_per_area: float | None = None
    points_per_unit: float = 20.0
    max_units: int = 20_000
    min_units: int = 25
    max_gap: float = 0.5

    def __post_init__(self) -> None:
        for name in ("tile", "points_per_unit", "max_units", "max_gap"):
            if not getattr(self, name) > 0:
                raise ReconstructionError(f"{name} is {getattr(self, name)}; a number above 0 is needed")
        if self.min_units < 4:
            raise ReconstructionError(f"min_units is {self.min_units}; a network begins with 4 units")
        if self.units_per_area is not None and not self.units_per_area > 0:
            raise ReconstructionError(
                f"units_per_area is {self.units_per_area}; a number above 0 is needed, or None"
            )
        if self.halo is not None and not 0 < self.halo <= self.tile / 2:
            raise ReconstructionError(
                f"halo is {self.halo}; above 0 and up to half of the tile ({self.tile / 2:g} m)"
            )

    @property
    def width(self) -> float:
        """Width of the halo [m]."""
        return self.tile / 10 if self.halo is None else self.halo
