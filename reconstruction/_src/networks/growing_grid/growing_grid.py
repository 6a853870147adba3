"""Growing grid: a sheet of units that unfolds over the points and grows by whole rows and columns.

References:
    Fritzke (1995), "Growing grid: a self-organizing network with constant neighborhood range and adaptation
    strength"; Kohonen (1993), "Things you haven't heard about the self-organizing map" (the batch rule).

Differs: winners are found for all signals at once and the units move to kernel-weighted means (the batch
rule); several lines are inserted a round; instead of the literal fine-tuning the sheet is fitted to the
samples by least squares (`surface_fit`) with the moments smoothed over the grid, so that neither the boundary nor
the edges shrink. `mode="paper"` has the sequential rules (`paper`).
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.base.range_checks import check_all_positive
from reconstruction._src.changes.free_space import widen
from reconstruction._src.geometry.rows import find_lengths, sum_rows
from reconstruction._src.networks.growing_grid import paper as grid_paper
from reconstruction._src.networks.growing_grid.growth import (
    Insertion,
    choose_lines,
    choose_shape,
    insert_lines,
    score_gaps,
    start_grid,
)
from reconstruction._src.networks.growing_grid.learning import (
    MAX_ITERATIONS,
    choose_num_samples,
    choose_sigmas,
    find_capacity,
    fit_grid,
    learn,
)
from reconstruction._src.networks.growing_grid.mesh import (
    find_covered_cells,
    triangulate,
    untangle_sheet,
)
from reconstruction._src.networks.least_squares import FitConfig
from reconstruction._src.networks.som.density import DensityConfig, measure_density
from reconstruction._src.networks.som.winners import MAX_CANDIDATES, Tiles, make_tiles

_FREE_RINGS = 2
"""Units within this many rings of a changed one learn again with it."""
_REACH = 2.0
"""A point is reached where a unit lies within this many median sides of the grid."""
_REACHED = 0.99
"""A sheet that reaches a smaller share of the points is grown again."""


@dataclass(frozen=True)
class GrowingGridConfig:
    """How a growing grid learns; all lengths are relative to the grid's own spacing.

    Attributes:
        units: units wanted; the grid ends with rows x columns as near to it as whole lines allow.
        triangles: triangles wanted instead: 2 (rows - 1) (columns - 1).
        insertion: where a line goes; None: "longest" in batches, "counter" in paper mode. "longest": where
            the mean edge across is longest; "counter": between the unit that won most and its neighbor that
            won most (the paper's); "distant": between the unit that won most and its farthest neighbor
            (Fritzke's, and what "longest" means in paper mode).
        mode: "batch", or "paper" for the sequential rules.
        growth: factor on the number of units in a round of the growth phase.
        samples_per_unit: points used while growing, for each unit.
        iterations: batch steps a round.
        first_iterations: batch steps a round while the grid is small: it settles its direction then.
        start_sigma: width of the neighborhood of the first four units, in grid steps.
        sigma: width of the neighborhood while growing, in grid steps.
        max_sigma_share: the width is at most this share of the shorter side of the grid, or a small grid would shrink.
        fit_sigmas: width of the neighborhood in each iteration of the final fit, by default selected by the
            number of samples a unit; below 0.5 the sheet folds.
        fit_samples_per_unit: points used by the final fit, for each unit.
        stiffness: unwillingness to slide within the surface in the final fit.
        step_limit: longest step of a unit in one iteration of the final fit, in grid steps.
        reach: points farther from the sheet than this, in grid steps, do not belong to it.
        signals_per_unit: signals between two insertions, for each unit (paper mode; lambda_g).
        fine_signals_per_unit: signals of the fine-tuning, for each unit (paper mode; lambda_f).
        density: how outliers are found.
        cover: which cells lie over a hole.
    """

    units: int = 2200
    triangles: int | None = None
    insertion: Insertion | None = None
    mode: Literal["batch", "paper"] = "batch"
    growth: float = 6.0
    samples_per_unit: int = 20
    iterations: int = 3
    first_iterations: int = 10
    start_sigma: float = 0.3
    sigma: float = 0.9
    max_sigma_share: float = 0.2
    fit_sigmas: tuple[float, ...] | None = None
    fit_samples_per_unit: int = 200
    stiffness: float = 0.03
    step_limit: float = 0.5
    reach: float = 4.0
    signals_per_unit: int = 30
    fine_signals_per_unit: int = 100
    density: DensityConfig = field(default_factory=DensityConfig)

    def __post_init__(self) -> None:
        if self.triangles is not None and self.triangles < 2:
            raise ReconstructionError(f"triangles must be at least 2, got {self.triangles}")
        if self.units < 4:
            raise ReconstructionError(f"units must be at least 4 (a grid of 2 x 2), got {self.units}")
        if self.insertion not in (None, "longest", "counter", "distant"):
            raise ReconstructionError(
                f"insertion must be 'longest', 'counter' or 'distant', got {self.insertion!r}"
            )
        if self.mode not in ("batch", "paper"):
            raise ReconstructionError(f"mode must be 'batch' or 'paper', got {self.mode!r}")
        if self.fit_sigmas is not None and not 0 < len(self.fit_sigmas) <= MAX_ITERATIONS:
            raise ReconstructionError(
                f"fit_sigmas must be 1 to {MAX_ITERATIONS} widths, got {len(self.fit_sigmas)}"
            )
        if not self.growth > 1:
            raise ReconstructionError(f"growth must be above 1, got {self.growth}")
        check_all_positive(self, may_be_zero=("stiffness", "fine_signals_per_unit"))

    @property
    def rule(self) -> Insertion:
        """The insertion rule: the one asked for, or the mode's own."""
        return self.insertion or ("longest" if self.mode == "batch" else "counter")

    @property
    def fit_config(self) -> FitConfig:
        """The final fit; its lengths are in grid steps."""
        return FitConfig(stiffness=self.stiffness, step_limit=self.step_limit, reach=self.reach)

    @property
    def wanted_units(self) -> int:
        """Units that the wanted triangles would have in a square grid, or the units asked for."""
        return self.units if self.triangles is None else round((np.sqrt(self.triangles / 2) + 1) ** 2)


class State(NamedTuple):
    """A trained grid.

    Attributes:
        units: reference vectors [m].
        has_face: whether the cell between four units belongs to the surface.
    """

    units: Float[np.ndarray, "R C 3"]
    has_face: Bool[np.ndarray, "R-1 C-1"]

    @property
    def vertices(self) -> Float[np.ndarray, "V 3"]:
        """The units, row after row [m]."""
        return self.units.reshape(-1, 3)

    @property
    def faces(self) -> Int[np.ndarray, "F 3"]:
        """Two triangles a cell."""
        return triangulate(self.units, self.has_face)


def train(
    points: Float[np.ndarray, "N 3"], config: GrowingGridConfig, seed: int = 0, progress: Progress = silent
) -> State:
    """Grow a grid of 2 x 2 units over the points."""
    return _train(points, config, seed, progress, None)


def train_again(
    state: State,
    is_changed: Bool[np.ndarray, " V"],
    points: Float[np.ndarray, "N 3"],
    config: GrowingGridConfig,
    seed: int = 0,
    progress: Progress = silent,
) -> State:
    """Train a grid on other points: the units that have not changed stay where they are.

    Where the sheet cannot reach all points so, and in paper mode, it is grown from 2 x 2 units again.
    """
    is_free = widen(state.faces, is_changed, _FREE_RINGS).reshape(state.units.shape[:2])
    if config.mode == "batch":
        again = _train(points, config, seed, progress, _Start(state.units, is_free))
        reach = _REACH * float(np.median(find_lengths(np.diff(state.units, axis=0))))
        if (cKDTree(again.vertices).query(points)[0] < reach).mean() > _REACHED:
            return again
    return train(points, config, seed, progress)


class _Start(NamedTuple):
    """A grid that has learned already, and which of its units may move."""

    units: Float[np.ndarray, "R C 3"]
    is_movable: Bool[np.ndarray, "R C"]


def _train(
    points: Float[np.ndarray, "N 3"],
    config: GrowingGridConfig,
    seed: int,
    progress: Progress,
    start: _Start | None,
) -> State:
    """Do what `train` and `train_again` do."""
    rng = np.random.default_rng(seed)
    center = points.mean(axis=0)
    scale = float(np.sqrt(sum_rows((points - center) ** 2).mean()))
    scaled = ((points - center) / scale).astype(np.float32)[rng.permutation(len(points))]
    is_movable = None if start is None else start.is_movable
    if config.mode == "paper":
        units = grid_paper.train(
            scaled,
            config.wanted_units,
            config.triangles,
            config.rule,
            config.signals_per_unit,
            config.fine_signals_per_unit,
            rng,
            progress,
        )
    else:
        begun = None if start is None else start._replace(units=((start.units - center) / scale))
        units = _train_batch(scaled, config, rng, progress, begun)
    progress("done", 1.0)
    rows, columns = units.shape[:2]
    has_face = np.ones((rows - 1, columns - 1), dtype=bool)
    if config.mode == "batch":
        has_face = find_covered_cells(units, scaled)
        units = untangle_sheet(units, has_face, is_movable)
    units = units.astype(np.float64) * scale + center
    if start is not None:
        units = np.where(start.is_movable[..., None], units, start.units)
    return State(units, has_face)


def _train_batch(
    points: Float[np.ndarray, "N 3"],
    config: GrowingGridConfig,
    rng: np.random.Generator,
    progress: Progress,
    start: _Start | None,
) -> Float[np.ndarray, "R C 3"]:
    """Drop outliers, grow or go on from a start, fit."""
    tiles = make_tiles(points)
    is_sound = measure_density(points, tiles.tree, rng, config.density).weights > 0
    if not is_sound.all():
        points = points[is_sound]
        tiles = make_tiles(points)
    sort = functools.cache(lambda number: tiles if number == len(points) else make_tiles(points[:number]))
    wanted = config.wanted_units
    if start is None:
        units, is_movable = _grow(points, sort, config, progress), None
    else:
        units, is_movable = start.units.astype(np.float32), start.is_movable
        wanted = units.shape[0] * units.shape[1]
        samples = sort(choose_num_samples(len(points), config.samples_per_unit * wanted))
        units, _ = learn(samples, units, config.sigma, config.first_iterations, wanted, is_movable)
    progress("fit", 0.8)
    number = choose_num_samples(len(points), config.fit_samples_per_unit * wanted)
    sigmas = config.fit_sigmas or choose_sigmas(number / wanted)
    return fit_grid(sort(number), units, sigmas, config.fit_config, wanted, is_movable)[0]


def _grow(
    points: Float[np.ndarray, "N 3"],
    sort: Callable[[int], Tiles],
    config: GrowingGridConfig,
    progress: Progress,
) -> Float[np.ndarray, "R C 3"]:
    """Grow from 2 x 2 to the wanted number of units."""
    wanted = config.wanted_units
    first = sort(choose_num_samples(len(points), 1))
    units, counts = learn(first, start_grid(points), config.start_sigma, iterations=1)
    num_rounds = max(1, int(np.ceil(np.log(wanted / 4) / np.log(config.growth))))
    for current in range(1, num_rounds + 1):
        progress("grow", 0.8 * (current - 1) / num_rounds)
        goal = round(4 * (wanted / 4) ** (current / num_rounds))
        shape = choose_shape(
            units, counts, goal, config.rule, config.triangles, is_last=current == num_rounds
        )
        down, across = score_gaps(units, counts, config.rule)
        units = insert_lines(units, choose_lines(down, shape[0] - len(down) - 1, config.rule))
        columns = choose_lines(across, shape[1] - len(across) - 1, config.rule)
        units = insert_lines(units.swapaxes(0, 1), columns).swapaxes(0, 1)
        capacity = find_capacity(goal)
        units, counts = learn(
            sort(choose_num_samples(len(points), config.samples_per_unit * capacity)),
            units,
            sigma=min(config.sigma, config.max_sigma_share * min(shape)),
            iterations=config.first_iterations if capacity <= MAX_CANDIDATES else config.iterations,
            goal=goal,
        )
    return units
