"""Growing self-reconstruction map: units that grow into a cloud and the faces between them.

References:
    Rêgo, Araújo and Lima Neto (2010), "Growing self-reconstruction maps", IEEE Transactions on Neural
    Networks 21(2).

Differs: signals come in batches (`growth`), edges and faces are learnt from the three winners of all samples
at once and made a two-manifold (`topology`), and the finished mesh is fitted to the samples by least squares
(`surface_fit`). `mode="paper"` has the literal sequential rules (`gsrm_paper`).
"""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from reconstruction.errors import ReconstructionError
from reconstruction.geometry.rows import sum_rows
from reconstruction.networks.gsrm import paper as gsrm_paper
from reconstruction.networks.gsrm.growth import Level, grow, make_level
from reconstruction.networks.gsrm.support import make_support
from reconstruction.networks.gsrm.topology import learn_faces
from reconstruction.networks.som.density import Density, study_density
from reconstruction.networks.som.winners import make_tiles, search_all
from reconstruction.networks.surface_fit import fit_surface
from reconstruction.progress import Progress, silent
from reconstruction.surfaces.edge_flips import flip_edges
from reconstruction.surfaces.unfolding import unfold_faces

START_DISTANCE = 1.4
"""In an uneven cloud no unit starts nearer to another than so many sample spacings, or scan lines get too many."""
_CROWD = 8
"""Of so many nearest units it must keep away."""


@dataclass(frozen=True)
class GSRMConfig:
    """How a map grows; there are no lengths among the parameters, so that the scale of the cloud is free.

    Attributes:
        units: units wanted. Where the samples are too sparse to carry them (units nearer to one another than
            two sample spacings), the map stops growing earlier.
        mode: "batch", or "paper" for the sequential rules.
        growth: factor on the number of units in one round.
        start_share: share of the units that are drawn among the samples, the others grow; at least three.
        samples_per_unit: samples of a round, for each unit wanted; settling uses twice as many, topology
            and the final fit all.
        settle_passes: passes of all units through their samples once they are complete.
        fit: whether the finished mesh is fitted to the samples by least squares.
    """

    units: int = 2200
    mode: Literal["batch", "paper"] = "batch"
    growth: float = 2.0
    start_share: float = 0.25
    samples_per_unit: int = 8
    settle_passes: int = 4
    fit: bool = True

    def __post_init__(self) -> None:
        if self.units < 4:
            raise ReconstructionError(f"units must be at least 4, got {self.units}")
        if self.mode not in ("batch", "paper"):
            raise ReconstructionError(f"mode must be 'batch' or 'paper', got {self.mode!r}")
        if not self.growth > 1:
            raise ReconstructionError(f"growth must be above 1, got {self.growth}")
        if not 0 <= self.start_share <= 1:
            raise ReconstructionError(f"start_share must lie between 0 and 1, got {self.start_share}")
        if self.samples_per_unit < 1 or self.settle_passes < 1:
            raise ReconstructionError(
                "samples_per_unit and settle_passes must be at least 1, got "
                f"{self.samples_per_unit} and {self.settle_passes}"
            )


class State(NamedTuple):
    """A map that has learnt.

    Attributes:
        units: `[U, 3]` reference vectors [m]; each has a face.
        faces: `[F, 3]` unit indices: an oriented two-manifold (in paper mode: whatever the rules give).
    """

    units: np.ndarray
    faces: np.ndarray


def train(points: np.ndarray, config: GSRMConfig, seed: int = 0, progress: Progress = silent) -> State:
    """Let a map grow over the points.

    Args:
        points: `[N, 3]` finite positions [m], N >= units.
        config: how.
        seed: of all draws; equal seeds give equal maps.
        progress: told how far it is.

    Raises:
        ReconstructionError: the points carry no face.
    """
    rng = np.random.default_rng(seed)
    center = points.mean(axis=0)
    scale = float(np.sqrt(sum_rows((points - center) ** 2).mean()))
    scaled = (points - center) / scale
    if config.mode == "paper":
        units, faces = gsrm_paper.train(scaled, config.units, rng, progress)
    else:
        units, faces = _train_batch(scaled.astype(np.float32), config, rng, progress)
    if len(faces) == 0:
        raise ReconstructionError(
            f"{len(points)} points carry no face between {config.units} units; "
            "a surface needs about 20 points a unit"
        )
    progress("done", 1.0)
    return State(units * scale + center, faces.astype(np.int32))


def _train_batch(
    samples: np.ndarray, config: GSRMConfig, rng: np.random.Generator, progress: Progress
) -> tuple[np.ndarray, np.ndarray]:
    """Grow, learn the topology, fit; all in units of the cloud's size."""
    progress("sort the samples", 0.0)
    tiles = make_tiles(samples)
    density = study_density(samples, tiles.tree, rng)
    level = make_level(tiles, density)
    progress("grow", 0.1)
    units = grow(
        level,
        _draw_start(samples, density, max(3, int(config.start_share * config.units)), rng),
        config.units,
        growth=config.growth,
        samples_per_unit=config.samples_per_unit,
        settle_passes=config.settle_passes,
        rng=rng,
    )
    progress("learn the topology", 0.5)
    return _learn_surface(level, units, config.fit, progress)


def _draw_start(samples: np.ndarray, density: Density, number: int, rng: np.random.Generator) -> np.ndarray:
    """Draw the first units among the samples: `[U, 3]`, fewer than the number where samples are too sparse."""
    usable = np.flatnonzero(density.weights)
    drawn = rng.choice(usable, min(number, len(usable)), replace=False)
    units, apart = samples[drawn], START_DISTANCE * density.spacing[drawn]
    if np.ptp(density.spacing) == 0 or len(units) <= _CROWD:
        return units
    distances, others = cKDTree(units).query(units, k=_CROWD)
    is_crowded = ((others < np.arange(len(units))[:, None]) & (distances < apart[:, None])).any(axis=1)
    is_crowded[:3] = False
    return units[~is_crowded]


def _learn_surface(
    level: Level, units: np.ndarray, is_fitted: bool, progress: Progress
) -> tuple[np.ndarray, np.ndarray]:
    """Join finished units by faces and fit these to the samples."""
    winners = search_all(level.tiles, units, 3)
    is_used = level.weights > 0
    faces = learn_faces(units, winners[is_used], make_support(level, units, winners[..., 0]))
    if len(faces) == 0:
        return units, faces
    used, flat = np.unique(faces, return_inverse=True)
    place = np.full(len(units), -1, dtype=np.int32)
    place[used] = np.arange(len(used), dtype=np.int32)
    units, faces = units[used].astype(np.float64), flat.reshape(-1, 3)
    if is_fitted:
        progress("fit the surface", 0.8)
        first = place[winners[..., 0]]
        is_used &= first >= 0
        samples, weights = level.tiles.samples[is_used], level.weights[is_used]
        units, faces = _fit(units, faces, samples, first[is_used], weights)
    return units, faces


def _fit(
    units: np.ndarray, faces: np.ndarray, samples: np.ndarray, winners: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Fit the mesh to the samples; where there are many, to few of them first.

    Creases need iterations, accuracy needs samples; below 20 samples a unit a third iteration would fit
    the noise. Between the iterations edges turn along the creases that have come out.
    """
    per_unit = len(samples) / len(units)
    schedule = ((3, per_unit / 24), (1, 1)) if per_unit >= 40 else ((1, 1), (1, 1))
    for iterations, stride in schedule:
        chosen = slice(None, None, int(stride))
        units = fit_surface(
            units,
            faces,
            samples[chosen],
            iterations=iterations,
            winners=winners[chosen],
            weights=weights[chosen],
        )
        faces = flip_edges(units, faces)
    return unfold_faces(units, faces), faces


def refine(
    state: State,
    points: np.ndarray,
    new_points: np.ndarray,
    config: GSRMConfig,
    seed: int = 0,
    progress: Progress = silent,
    origins: np.ndarray | None = None,
) -> tuple[State, np.ndarray]:
    """Let the same map learn from new readings: what they contradict moves, grows or goes.

    Args:
        state: the map.
        points: `[N, 3]` what it has learnt from [m].
        new_points: `[M, 3]` what was read since [m].
        config: as it was grown with.
        seed: of all draws.
        progress: told how far it is.
        origins: `[M, 3]` where the new readings were made from: what their rays pass through is gone.

    Returns:
        The new map, and the points that are still true with the new ones.
    """
    from reconstruction.networks.gsrm.refinement import (
        refine_map,
    )  # a fresh process that only reconstructs starts sooner

    progress("refine", 0.0)
    units, faces, known = refine_map(
        state.units, state.faces, points, new_points, config.fit, np.random.default_rng(seed), origins
    )
    progress("refine", 1.0)
    return State(units, faces.astype(np.int32)), known
