"""Grow units again where a map is contradicted, between the others, which do not move, and join them by faces."""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.geometry.boxes import find_near_box
from reconstruction._src.geometry.manifold import find_loops
from reconstruction._src.geometry.orientation import find_components
from reconstruction._src.geometry.rows import any_corner, sum_by_owner
from reconstruction._src.networks.change.neighborhoods import widen
from reconstruction._src.networks.gsrm.local_fit import Rounds, fit_turning
from reconstruction._src.networks.gsrm.local_topology import is_sound, join_locally
from reconstruction._src.networks.gsrm.refinement_config import RegrowthConfig
from reconstruction._src.networks.gsrm.topology_config import TopologyConfig
from reconstruction._src.networks.least_squares import FitConfig


def regrow(
    units: Float[np.ndarray, "U 3"],
    faces: Int[np.ndarray, "F 3"],
    is_refuted: Bool[np.ndarray, " U"],
    samples: Float[np.ndarray, "N 3"],
    is_open: Bool[np.ndarray, " N"],
    edge: float,
    config: RegrowthConfig,
    topology: TopologyConfig,
    rng: np.random.Generator,
) -> tuple[Float[np.ndarray, "W 3"], Int[np.ndarray, "G 3"], int]:
    """Return the units without the refuted ones and with new ones behind, the faces of all, and how many stayed.

    Args:
        units: positions [m].
        faces: unit indices.
        is_refuted: units that are removed.
        samples: those near what changed [m].
        is_open: samples that new units are to cover.
        edge: mean edge length of the map [m].
        config: how units grow.
        topology: how faces are learned.
        rng: draws where new units start.
    """
    kept = units[~is_refuted]
    place = np.where(is_refuted, -1, np.cumsum(~is_refuted) - 1)
    kept_faces = place[faces[~any_corner(is_refuted, faces)]]
    adjacent = place[widen(faces, is_refuted, 1) & ~is_refuted]

    def fill() -> tuple[Float[np.ndarray, "W 3"], Int[np.ndarray, "G 3"], int]:
        seeds = _grow_between(samples, is_open, kept, edge, config, rng)
        merged, joined = _join_new(samples, kept, seeds, kept_faces, adjacent, edge, config, topology, rng)
        return merged, joined, _count_gaps(merged, joined, len(kept), samples, edge, config, topology)

    merged, joined, num_gaps = fill()
    for _ in range(config.max_repeats):
        # Where a gap is left among samples, units that start elsewhere may close it.
        if num_gaps == 0:
            break
        other = fill()
        if other[2] < num_gaps:
            merged, joined, num_gaps = other
    return merged, drop_islands(joined, len(merged), len(kept), config.min_island), len(kept)


def _count_gaps(
    units: Float[np.ndarray, "U 3"],
    faces: Int[np.ndarray, "F 3"],
    num_kept: int,
    samples: Float[np.ndarray, "N 3"],
    edge: float,
    config: RegrowthConfig,
    topology: TopologyConfig,
) -> int:
    """Return how many holes at new units have samples in their middle."""
    loops = [
        loop
        for loop in find_loops(faces, len(units))
        if len(loop) <= topology.max_hole_edges and max(loop) >= num_kept
    ]
    if not loops:
        return 0
    middles = np.array([units[loop].mean(axis=0) for loop in loops])
    return int((cKDTree(samples).query(middles)[0] < config.min_distance * edge).sum())


def drop_islands(
    faces: Int[np.ndarray, "F 3"], num_units: int, num_kept: int, min_island: int
) -> Int[np.ndarray, "G 3"]:
    """Return the faces without parts of fewer than `min_island` faces that no kept unit belongs to."""
    if len(faces) == 0:
        return faces
    part = find_components(faces, num_units)
    is_island = np.bincount(part, (faces < num_kept).any(axis=1)) == 0
    return faces[~(is_island & (np.bincount(part) < min_island))[part]]


def _join_new(
    samples: Float[np.ndarray, "N 3"],
    kept: Float[np.ndarray, "K 3"],
    grown: Float[np.ndarray, "G 3"],
    kept_faces: Int[np.ndarray, "F 3"],
    adjacent: Int[np.ndarray, " B"],
    edge: float,
    config: RegrowthConfig,
    topology: TopologyConfig,
    rng: np.random.Generator,
) -> tuple[Float[np.ndarray, "U 3"], Int[np.ndarray, "H 3"]]:
    """Return the kept units with the new ones, and the faces of all.

    Args:
        samples: those near what changed [m].
        kept: units that stay [m].
        grown: the new ones [m].
        kept_faces: faces that stay.
        adjacent: kept units that have lost a face.
        edge: mean edge length of the map [m].
        config: how units grow.
        topology: how faces are learned.
        rng: draws the witnesses.
    """
    units = np.concatenate([kept, grown])
    is_cut = np.zeros(len(units), dtype=bool)
    is_cut[adjacent] = True
    is_cut[len(kept) :] = True
    witnesses = samples[rng.permutation(len(samples))[: config.topology_samples * int(is_cut.sum())]]
    faces = join_locally(units, kept_faces, len(kept), is_cut, witnesses, edge, config, topology)
    return units, close_triangles(faces, len(units), len(kept))


def close_triangles(faces: Int[np.ndarray, "F 3"], num_units: int, num_kept: int) -> Int[np.ndarray, "G 3"]:
    """Return the faces with one in every loop of three edges at a new unit: no hole is as small as that.

    Where such a loop lies against the surface, the new unit stands beyond its neighbors, and unfolding the face
    moves it back.
    """
    loops = [loop for loop in find_loops(faces, num_units) if len(loop) == 3 and max(loop) >= num_kept]
    around = faces[np.isin(faces, loops).sum(axis=1) == 3] if loops else faces[:0]
    taken = {frozenset(face) for face in around.tolist()}
    closed = [loop for loop in loops if frozenset(loop) not in taken]
    return np.concatenate([faces, np.array(closed, dtype=faces.dtype)]) if closed else faces


def _grow_between(
    samples: Float[np.ndarray, "N 3"],
    is_open: Bool[np.ndarray, " N"],
    kept: Float[np.ndarray, "K 3"],
    edge: float,
    config: RegrowthConfig,
    rng: np.random.Generator,
) -> Float[np.ndarray, "G 3"]:
    """Return new units that cover the open samples as densely as the map covers the rest.

    A sample that is far from all units becomes one: the error is largest there. Then the new units settle
    by the batch rule among the kept ones, which do not move.
    """
    if not is_open.any():
        return np.empty((0, 3))
    fixed = kept[find_near_box(kept, samples, config.reach * edge)]
    candidates = samples[is_open]
    if len(fixed):
        candidates = candidates[cKDTree(fixed).query(candidates)[0] > config.cover * edge]
    seeds = candidates[_select_apart(candidates, config.cover * edge, rng)]
    if len(seeds) == 0:
        return seeds
    tree = cKDTree(seeds)
    if len(fixed):
        fixed = fixed[np.isfinite(tree.query(fixed, distance_upper_bound=config.reach * edge)[0])]
    samples = samples[rng.permutation(len(samples))[: config.samples_per_unit * (len(seeds) + len(fixed))]]
    samples = samples[np.isfinite(tree.query(samples, distance_upper_bound=config.settle_reach * edge)[0])]
    for _ in range(config.settle_passes):
        winners = np.asarray(cKDTree(np.concatenate([fixed, seeds])).query(samples)[1]) - len(fixed)
        is_won = winners >= 0
        counts = np.bincount(winners[is_won], minlength=len(seeds))
        sums = sum_by_owner(winners[is_won], samples[is_won], len(seeds))
        seeds = (sums / np.maximum(counts, 1)[:, None])[counts > 0]
    everything = np.concatenate([fixed, seeds])
    pairs = cKDTree(everything).query_pairs(config.min_distance * edge, output_type="ndarray")
    crowded = pairs.max(axis=1, initial=-1)
    return np.delete(seeds, crowded[crowded >= len(fixed)] - len(fixed), axis=0)


def _select_apart(
    samples: Float[np.ndarray, "N 3"], distance: float, rng: np.random.Generator
) -> Int[np.ndarray, " S"]:
    """Select samples, none nearer to another than the distance, so that each other one is: their indices."""
    if len(samples) == 0:
        return np.empty(0, dtype=np.int64)
    tree = cKDTree(samples, balanced_tree=False)
    is_left = np.ones(len(samples), dtype=bool)
    selected = []
    for place in rng.permutation(len(samples)).tolist():
        if is_left[place]:
            selected.append(place)
            is_left[tree.query_ball_point(samples[place], distance)] = False
    return np.array(selected)


def fit_new(
    units: Float[np.ndarray, "U 3"],
    faces: Int[np.ndarray, "F 3"],
    num_kept: int,
    samples: Float[np.ndarray, "N 3"],
    config: FitConfig,
    rounds: Rounds,
) -> tuple[Float[np.ndarray, "U 3"], Int[np.ndarray, "F 3"]]:
    """Return the units with the new ones fitted to the samples, and the faces with edges turned between them.

    Args:
        units: positions [m]; the first `num_kept` stay where they are.
        faces: unit indices.
        num_kept: how many units are not new.
        samples: those near the new units [m].
        config: configuration of the fit.
        rounds: see `fit_turning`.
    """
    is_new = np.arange(len(units)) >= num_kept
    is_own = any_corner(is_new, faces)
    is_near = any_corner(widen(faces, is_new, 1), faces)
    if not is_own.any() or len(samples) == 0:
        return units, faces
    used, flat = np.unique(faces[is_near], return_inverse=True)
    near, is_movable = flat.reshape(-1, 3), is_new[used]
    is_won = np.zeros(len(used), dtype=bool)
    is_won[near[is_own[is_near]]] = True
    winners = np.asarray(cKDTree(units[used]).query(samples)[1])
    samples, winners = samples[is_won[winners]], winners[is_won[winners]]
    part, near = fit_turning(units[used], near, is_movable, is_own[is_near], samples, winners, config, rounds)
    turned, moved = faces.copy(), units.copy()
    turned[is_near], moved[used] = used[near], part
    return moved, turned if is_sound(turned, is_new) else faces
