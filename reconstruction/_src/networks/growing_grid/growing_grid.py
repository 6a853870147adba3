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
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Bool
from scipy.spatial import cKDTree

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.geometry.rows import Faces, Points, Vertices, compute_lengths, sum_rows
from reconstruction._src.networks.growing_grid import paper as grid_paper
from reconstruction._src.networks.growing_grid.growth import (
    choose_lines,
    choose_shape,
    insert_lines,
    score_gaps,
    start_grid,
)
from reconstruction._src.networks.growing_grid.learning import (
    choose_num_samples,
    choose_sigmas,
    compute_capacity,
    fit_grid,
    learn,
)
from reconstruction._src.networks.growing_grid.mesh import (
    Grid,
    find_covered_cells,
    triangulate,
    untangle_sheet,
)
from reconstruction._src.networks.som.density import measure_density
from reconstruction._src.networks.som.winners import MAX_CANDIDATES, Tiles, make_tiles
from reconstruction._src.networks.surface_fit import FitConfig

FREE_RINGS = 2  # Units within this many rings of a changed one learn again with it
_REACH = 2.0  # A point is reached where a unit lies within this many median sides of the grid
_REACHED = 0.99  # A sheet that reaches a smaller share of the points is grown again ...
_PROBES = 8192  # ... as told by so many of them


_GROWTH = 6.0  # Factor on the number of units in a round of the growth phase
_SAMPLES_PER_UNIT = 20  # Points used while growing, for each unit
_ITERATIONS = 3  # Batch steps a round
_FIRST_ITERATIONS = 10  # Batch steps a round while the grid is small: it settles its direction then
_START_SIGMA = 0.3  # Width of the neighborhood of the first four units, in grid steps
_SIGMA = 0.9  # Width of the neighborhood while growing, in grid steps
_MAX_SIGMA_SHARE = 0.2
"""The width is at most this share of the shorter side of the grid, or a small grid would shrink."""
_FIT_SAMPLES_PER_UNIT = 200  # Points used by the final fit, for each unit
_FINAL_FIT = FitConfig(stiffness=0.03, step_limit=0.5, reach=4.0)
"""The final fit; its lengths are in grid steps."""


@dataclass(frozen=True)
class GrowingGridConfig:
    """How a growing grid learns; all lengths are relative to the grid's own spacing.

    Attributes:
        units: units wanted; the grid ends with rows x columns as near to it as whole lines allow.
        triangles: triangles wanted instead: 2 (rows - 1) (columns - 1).
        mode: "batch", or "paper" for the sequential rules.
    """

    units: int = 2200
    triangles: int | None = None
    mode: Literal["batch", "paper"] = "batch"

    def __post_init__(self) -> None:
        if self.triangles is not None and self.triangles < 2:
            raise ReconstructionError(f"triangles must be at least 2, got {self.triangles}")
        if self.units < 4:
            raise ReconstructionError(f"units must be at least 4 (a grid of 2 x 2), got {self.units}")
        if self.mode not in ("batch", "paper"):
            raise ReconstructionError(f"mode must be 'batch' or 'paper', got {self.mode!r}")

    @property
    def wanted_units(self) -> int:
        """Units that the wanted triangles would have in a square grid, or the units asked for."""
        return self.units if self.triangles is None else round((np.sqrt(self.triangles / 2) + 1) ** 2)


class State(NamedTuple):
    """A trained grid."""

    units: Grid  # reference vectors [m]
    has_face: Bool[np.ndarray, "R-1 C-1"]  # whether the cell between four units belongs to the surface

    @property
    def vertices(self) -> Vertices:
        """The units, row after row [m]."""
        return self.units.reshape(-1, 3)

    @property
    def faces(self) -> Faces:
        """Two triangles a cell."""
        return triangulate(self.units, self.has_face)


class _Start(NamedTuple):
    """A grid that has learned already, and which of its units may move."""

    units: Grid
    is_movable: Bool[np.ndarray, "R C"]


def train(
    points: Points,
    config: GrowingGridConfig,
    seed: int = 0,
    progress: Progress = silent,
    start: _Start | None = None,
) -> State:
    """Grow a grid of 2 x 2 units over the points, or go on from one that has learned already."""
    rng = np.random.default_rng(seed)
    center = points.mean(axis=0)
    scale = float(np.sqrt(sum_rows((points - center) ** 2).mean()))
    scaled = ((points - center) / scale).astype(np.float32)[rng.permutation(len(points))]
    is_movable = None if start is None else start.is_movable
    tiles = None
    if config.mode == "paper":
        units = grid_paper.train(scaled, config.wanted_units, config.triangles, rng, progress)
    else:
        begun = None if start is None else start._replace(units=((start.units - center) / scale))
        tiles = make_tiles(scaled)
        units = _train_batch(scaled, tiles, config, rng, progress, begun)
    progress("done", 1.0)
    rows, columns = units.shape[:2]
    has_face = np.ones((rows - 1, columns - 1), dtype=bool)
    if tiles is not None:
        has_face = find_covered_cells(units, tiles.tree)
        units = untangle_sheet(units, has_face, is_movable)
    units = units.astype(np.float64) * scale + center
    if start is not None:
        units = np.where(start.is_movable[..., None], units, start.units)
    return State(units, has_face)


def train_again(
    state: State,
    is_free: Bool[np.ndarray, " V"],
    points: Points,
    config: GrowingGridConfig,
    seed: int = 0,
    progress: Progress = silent,
) -> State:
    """Train a grid on other points: the units that are not free stay where they are.

    Where the sheet cannot reach all points so, and in paper mode, it is grown from 2 x 2 units again.
    """
    if config.mode == "batch":
        start = _Start(state.units, is_free.reshape(state.units.shape[:2]))
        again = train(points, config, seed, progress, start)
        reach = _REACH * float(np.median(compute_lengths(np.diff(state.units, axis=0))))
        probes = points[:: max(1, len(points) // _PROBES)]
        if (cKDTree(again.vertices).query(probes)[0] < reach).mean() > _REACHED:
            return again
    return train(points, config, seed, progress)


def _train_batch(
    points: Points,
    tiles: Tiles,
    config: GrowingGridConfig,
    rng: np.random.Generator,
    progress: Progress,
    start: _Start | None,
) -> Grid:
    """Drop outliers, grow or go on from a start, fit."""
    is_sound = measure_density(points, tiles.tree, rng).weights > 0
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
        samples = sort(choose_num_samples(len(points), _SAMPLES_PER_UNIT * wanted))
        units = learn(samples, units, _SIGMA, _FIRST_ITERATIONS, wanted, is_movable)
    progress("fit", 0.8)
    number = choose_num_samples(len(points), _FIT_SAMPLES_PER_UNIT * wanted)
    sigmas = choose_sigmas(number / wanted)
    return fit_grid(sort(number), units, sigmas, _FINAL_FIT, wanted, is_movable)


def _grow(
    points: Points, sort: Callable[[int], Tiles], config: GrowingGridConfig, progress: Progress
) -> Grid:
    wanted = config.wanted_units
    first = sort(choose_num_samples(len(points), 1))
    units = learn(first, start_grid(points), _START_SIGMA, iterations=1)
    num_rounds = max(1, int(np.ceil(np.log(wanted / 4) / np.log(_GROWTH))))
    for current in range(1, num_rounds + 1):
        progress("grow", 0.8 * (current - 1) / num_rounds)
        goal = round(4 * (wanted / 4) ** (current / num_rounds))
        shape = choose_shape(units, goal, config.triangles, is_last=current == num_rounds)
        down, across = score_gaps(units)
        units = insert_lines(units, choose_lines(down, shape[0] - len(down) - 1))
        columns = choose_lines(across, shape[1] - len(across) - 1)
        units = insert_lines(units.swapaxes(0, 1), columns).swapaxes(0, 1)
        capacity = compute_capacity(goal)
        units = learn(
            sort(choose_num_samples(len(points), _SAMPLES_PER_UNIT * capacity)),
            units,
            sigma=min(_SIGMA, _MAX_SIGMA_SHARE * min(shape)),
            iterations=_FIRST_ITERATIONS if capacity <= MAX_CANDIDATES else _ITERATIONS,
            goal=goal,
        )
    return units
