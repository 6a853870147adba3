"""Growing self-reconstruction map: units that grow into a cloud and the faces between them.

References:
    Rêgo, Araújo and Lima Neto (2010), "Growing self-reconstruction maps", IEEE Transactions on Neural
    Networks 21(2).

Differs: signals come in batches (`growth`), edges and faces are learned from the three winners of all samples
at once and made a two-manifold (`topology`), and the finished mesh is fitted to the samples by least squares
(`surface_fit`). `mode="paper"` has the literal sequential rules (`paper`).
"""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.geometry.manifold import label_parts, widen
from reconstruction._src.geometry.rows import Faces, Points, Vertices, compute_lengths, sum_rows
from reconstruction._src.networks.gsrm import paper as gsrm_paper
from reconstruction._src.networks.gsrm.growth import Level, grow, make_level
from reconstruction._src.networks.gsrm.support import Units, make_support
from reconstruction._src.networks.gsrm.topology import learn_faces
from reconstruction._src.networks.som.density import Density, find_spread, measure_density
from reconstruction._src.networks.som.winners import Tiles, make_tiles, search_all
from reconstruction._src.networks.surface_fit import fit_surface, mean_edge_length
from reconstruction._src.surfaces.edge_flips import flip_edges
from reconstruction._src.surfaces.unfolding import untangle

_MIN_MAP = 4  # A map of fewer units has no surface
FREE_RINGS = 1  # Units within this many rings of a changed one grow again with it
_COVER = 1.25  # A sample farther than this many spacings of the held units from all old ones is uncovered


_START_SHARE = 0.25  # Share of the units that are drawn among the samples, the others grow; at least three
_START_DISTANCE = 1.4
"""In an uneven cloud no unit starts nearer to another than this many sample spacings; with less, scan lines
get too many units."""
_START_NEIGHBORS = 8  # Nearest units from which a starting unit keeps that distance
_DENSE_FIT = 40  # From this many samples a unit on, the mesh is first fitted to few of them
_COARSE_SAMPLES = 24  # Samples a unit of that first fit: creases need iterations, accuracy needs samples
_COARSE_ITERATIONS = 3  # Iterations of that first fit
_PASSES = 2  # How often the rest is looked for; 0: never
_SPACING_NEIGHBORS = 8  # Samples around a sample that measure its spacing
_COMPLETION_GAP = 2.5
"""A sample farther than this from every face is uncovered. Lower, and what stands off by noise is covered
twice; higher, and strips along the rims of the surface stay bare."""
_EDGE_SHARE = 0.75
"""Nor is it uncovered nearer than this share of the mean edge of the map: faces cut corners."""
_LINK = 3.0  # Uncovered samples nearer to one another than this are one group
_MIN_SAMPLES = 12  # A smaller group is stray: mixed pixels, insects, dust
_FLATNESS = 0.06
"""Least variance over the largest of a sample and its neighbors, below which they are flat; of samples that
fill space it is 0.1 to 0.5."""
_FLAT_SHARE = 0.35  # A group of which a smaller share of the samples is flat fills space: no surface
_REST_SAMPLES = 4.0  # Samples of such a group for each new unit. They are sparse, so fewer than usual.
_MAX_SHARE = 0.25  # The most new units in all, as a share of those wanted


@dataclass(frozen=True)
class GSRMConfig:
    """How a map grows; the scale of the cloud is free.

    Attributes:
        units: units wanted. Where the samples are too sparse for them (units nearer to one another than
            two sample spacings), the map stops growing earlier.
        mode: "batch", or "paper" for the sequential rules.
    """

    units: int = 2200
    mode: Literal["batch", "paper"] = "batch"

    def __post_init__(self) -> None:
        if self.units < 4:
            raise ReconstructionError(f"units must be at least 4, got {self.units}")
        if self.mode not in ("batch", "paper"):
            raise ReconstructionError(f"mode must be 'batch' or 'paper', got {self.mode!r}")


class State(NamedTuple):
    """A trained map."""

    units: Units  # reference vectors [m]; each has a face
    # unit indices: an oriented two-manifold (in paper mode: whatever the rules give)
    faces: Faces


class Old(NamedTuple):
    """Units of a map that is trained again."""

    held: Float[np.ndarray, "H 3"]  # those that stay where they are
    freed: Float[np.ndarray, "G 3"]  # those in whose place others grow
    faces: Int[np.ndarray, "K 3"]  # those between held units


def train(
    points: Points, config: GSRMConfig, seed: int = 0, progress: Progress = silent, old: Old | None = None
) -> State:
    """Grow a map over the points."""
    rng = np.random.default_rng(seed)
    center = points.mean(axis=0)
    scale = float(np.sqrt(sum_rows((points - center) ** 2).mean()))
    scaled = (points - center) / scale
    if config.mode == "paper":
        units, faces = gsrm_paper.train(scaled, config.units, rng, progress)
    else:
        if old is not None:
            held, freed = (((units - center) / scale).astype(np.float32) for units in old[:2])
            old = Old(held, freed, old.faces)
        units, faces = _train_batch(scaled.astype(np.float32), old, config, rng, progress)
    if len(faces) == 0:
        raise ReconstructionError(
            f"{len(points)} points carry no face between {config.units} units; "
            "a surface needs about 20 points a unit"
        )
    progress("done", 1.0)
    return State(units * scale + center, faces.astype(np.int32))


def train_again(
    state: State,
    is_free: Bool[np.ndarray, " U"],
    points: Points,
    config: GSRMConfig,
    seed: int = 0,
    progress: Progress = silent,
) -> State:
    """Train a map on other points: `train`, but the units that are not free stay where they are."""
    place = np.cumsum(~is_free) - 1
    faces = place[state.faces[~is_free[state.faces].any(axis=1)]]
    old = Old(state.units[~is_free], state.units[is_free], faces)
    return train(points, config, seed, progress, old if len(old.held) >= _MIN_MAP else None)


def _train_batch(
    samples: Points, old: Old | None, config: GSRMConfig, rng: np.random.Generator, progress: Progress
) -> tuple[Units, Faces]:
    """Grow, learn the topology, fit; all in units of the cloud's size."""
    progress("sort the samples", 0.0)
    tiles = make_tiles(samples)
    density = measure_density(samples, tiles.tree, rng)
    progress("grow", 0.1)
    units = _grow(tiles, density, old, config.units, rng)
    progress("learn the topology", 0.5)
    level = make_level(tiles, density)
    units, faces = _learn_surface(level, units, old, progress)
    if np.ptp(density.spacing) > 0 and len(faces):
        progress("complete the surface", 0.9)
        units, faces = _complete(samples, units, faces, config, rng)
    return units, faces


def _grow(tiles: Tiles, density: Density, old: Old | None, num_units: int, rng: np.random.Generator) -> Units:
    """Grow a number of units over the samples; between held ones, as many as make the map as dense as these."""
    samples, weights = tiles.tree.data.astype(np.float32), density.weights
    held = samples[:0] if old is None else old.held
    if old is not None:
        spacing = np.median(cKDTree(held).query(held, k=2)[0][:, 1])
        every, winners = np.concatenate(old[:2]), np.empty(len(samples), dtype=np.int64)
        winners[tiles.order] = search_all(tiles, every, 1)[..., 0]
        is_open = (winners >= len(held)) | (compute_lengths(samples - every[winners]) > _COVER * spacing)
        is_open &= weights > 0
        weights = np.where(is_open, weights, 0.0)
        opened, covered = (_count_cells(samples[rows], spacing) for rows in (is_open, ~is_open))
        num_units = round(len(held) * opened / max(covered, 1))
        if num_units == 0:
            return held
    start = _draw_start(samples, density._replace(weights=weights), num_units, rng)
    units = np.concatenate([held, start])
    return grow(make_level(tiles, density), units, len(held) + num_units, rng, num_held=len(held))


def _count_cells(samples: Points, width: float) -> int:
    """Return how many cubes of a width hold a sample: in proportion to the area."""
    index = np.floor(samples / width).astype(np.int64)
    return len(np.unique(index @ np.array([1 << 42, 1 << 21, 1])))


def _complete(
    samples: Points, units: Units, faces: Faces, config: GSRMConfig, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "W 3"], Int[np.ndarray, "G 3"]]:
    """Return the surface with maps beside it that have grown over what it leaves uncovered.

    Samples that are sparse against the rest (a far wall, what is seen through a door) may count as outliers, their
    faces as debris, or their units may be too few to see one another. Such groups are a surface of their own: a map
    grows over them alone, where they are the rule.
    """
    left = int(_MAX_SHARE * config.units)
    for _ in range(_PASSES):
        rest = samples[find_uncovered(samples, units, faces)]
        number = min(left, int(len(rest) / _REST_SAMPLES))
        if number < _MIN_MAP:
            break
        tiles = make_tiles(rest)
        density = measure_density(rest, tiles.tree, rng, has_outliers=False)
        grown = _grow(tiles, density, None, number, rng)
        added, between = _learn_surface(make_level(tiles, density), grown, None, silent)
        if len(between) == 0:
            break
        faces = np.concatenate([faces, between + len(units)])
        units = np.concatenate([units, added])
        left -= len(added)
    return units, faces


def _draw_start(samples: Points, density: Density, num_units: int, rng: np.random.Generator) -> Units:
    """Draw the first units among the samples, fewer than the share of them where samples are too sparse."""
    number = max(3, int(_START_SHARE * num_units))
    usable = np.flatnonzero(density.weights)
    drawn = rng.choice(usable, min(number, len(usable)), replace=False)
    units, apart = samples[drawn], _START_DISTANCE * density.spacing[drawn]
    if np.ptp(density.spacing) == 0 or len(units) <= _START_NEIGHBORS:
        return units
    distances, others = cKDTree(units).query(units, k=[*range(1, _START_NEIGHBORS + 1)])
    is_crowded = ((others < np.arange(len(units))[:, None]) & (distances < apart[:, None])).any(axis=1)
    is_crowded[:3] = False
    return units[~is_crowded]


def _learn_surface(
    level: Level, units: Units, old: Old | None, progress: Progress
) -> tuple[Float[np.ndarray, "W 3"], Faces]:
    """Join finished units by faces and fit these to the samples."""
    winners = search_all(level.tiles, units, 3)
    is_used = level.weights > 0
    support = make_support(level, units, winners[..., 0])
    faces = learn_faces(units, winners[is_used], support, None if old is None else old.faces)
    if len(faces) == 0:
        return units, faces
    used = np.unique(faces)
    place = np.full(len(units), -1, dtype=np.int32)
    place[used] = np.arange(len(used), dtype=np.int32)
    units, faces = units[used].astype(np.float64), place[faces].astype(np.int64)
    progress("fit the surface", 0.8)
    first = place[winners[..., 0]]
    is_used &= first >= 0
    is_movable = None if old is None else used >= len(old.held)
    if is_movable is not None:  # the other samples move nothing
        is_used &= widen(faces, is_movable, 1)[first]
    samples, weights = level.tiles.samples[is_used], level.weights[is_used]
    return _fit(units, faces, samples, first[is_used], weights, is_movable)


def _fit(
    units: Units,
    faces: Faces,
    samples: Points,
    winners: Int[np.ndarray, " N"],
    weights: Float[np.ndarray, " N"],
    is_movable: Bool[np.ndarray, " U"] | None,
) -> tuple[Units, Int[np.ndarray, "G 3"]]:
    """Fit the mesh to the samples; where there are many, to few of them first.

    Creases need iterations, accuracy needs samples; below 20 samples a unit a third iteration would fit
    the noise. Between the iterations edges turn along the creases that have come out.
    """
    per_unit = len(samples) / (len(units) if is_movable is None else len(np.unique(winners)))
    coarse = (_COARSE_ITERATIONS, max(1, int(per_unit / _COARSE_SAMPLES)))
    for iterations, stride in (coarse if per_unit >= _DENSE_FIT else (1, 1), (1, 1)):
        units = fit_surface(
            units,
            faces,
            samples[::stride],
            iterations=iterations,
            winners=winners[::stride],
            weights=weights[::stride],
            is_movable=is_movable,
        )
        faces = flip_edges(units, faces)
    return untangle(units, faces)


def find_uncovered(samples: Points, vertices: Vertices, faces: Faces) -> Bool[np.ndarray, " N"]:
    """Return which samples belong to a group that no face covers."""
    import igl

    vertices, faces = np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.int64)
    squared = np.asarray(igl.point_mesh_squared_distance(samples.astype(np.float64), vertices, faces)[0])
    edge = mean_edge_length(vertices, faces)
    far = np.flatnonzero(squared > (_EDGE_SHARE * edge) ** 2)
    is_uncovered = np.zeros(len(samples), dtype=bool)
    num_neighbors = min(_SPACING_NEIGHBORS, len(samples) - 1)
    if len(far) < _MIN_SAMPLES:
        return is_uncovered
    distances, neighbors = cKDTree(samples).query(samples[far], k=num_neighbors + 1)
    spacing = distances[:, -1] * np.sqrt(np.pi / num_neighbors)
    is_far = squared[far] > (_COMPLETION_GAP * spacing) ** 2
    is_flat = find_spread(samples[neighbors[is_far]])[:, 2] < _FLATNESS
    far = far[is_far]
    is_uncovered[far] = _find_groups(samples[far], spacing[is_far], is_flat)
    return is_uncovered


def _find_groups(
    samples: Points, spacing: Float[np.ndarray, " N"], is_flat: Bool[np.ndarray, " N"]
) -> Bool[np.ndarray, " N"]:
    """Return which samples are in a group that is large and flat enough."""
    if len(samples) < _MIN_SAMPLES:
        return np.zeros(len(samples), dtype=bool)
    distances, others = cKDTree(samples).query(samples, k=_MIN_SAMPLES)
    is_near = distances <= _LINK * spacing[:, None]
    first = np.broadcast_to(np.arange(len(samples))[:, None], others.shape)[is_near]
    group = label_parts(np.stack([first, others[is_near]], axis=1), len(samples))
    size = np.bincount(group)
    is_surface = np.bincount(group, is_flat) >= _FLAT_SHARE * size
    for number in np.flatnonzero((size >= _MIN_SAMPLES) & ~is_surface):
        # Where noise exceeds the spacing, only the whole group shows that it is flat.
        is_surface[number] = find_spread(samples[None, group == number])[0, 2] < _FLATNESS
    return (is_surface & (size >= _MIN_SAMPLES))[group]
