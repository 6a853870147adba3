"""How a trained map learns from new readings: what they contradict moves, grows or is removed.

Where readings have shifted by less than an edge, the units follow and keep their faces (`motion`). Where more
has changed, the contradicted units are grown again between the others, which do not move (`regrowth`).
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from reconstruction._src.geometry.manifold import find_vertex_normals, group_sides
from reconstruction._src.geometry.rows import any_corner, find_lengths, sum_rows
from reconstruction._src.networks.change.detection import Change
from reconstruction._src.networks.change.neighborhoods import widen
from reconstruction._src.networks.change.refinement import NetworkLearner, Samples, Selection, Surface
from reconstruction._src.networks.gsrm.gsrm import GSRMConfig, State
from reconstruction._src.networks.gsrm.motion import find_movable, move_units
from reconstruction._src.networks.gsrm.regrowth import fit_new, regrow
from reconstruction._src.networks.surface_fit import mean_edge_length
from reconstruction._src.surfaces.unfolding import unfold_part


class Learner(NetworkLearner[State, GSRMConfig, Selection]):
    """A trained map that learns from new readings."""

    def measure(self) -> Surface:
        """Return the map, with its mean edge length."""
        units, faces = self.state.units, self.state.faces.astype(np.int64)
        return Surface(units, faces, mean_edge_length(units, faces))

    def select(self, change: Change, readings: Float[np.ndarray, "C 3"]) -> Selection | None:
        """Return the units that have moved or are gone; None where there are none."""
        (units, faces, spacing), config = self.surface, self.config.refinement
        is_active = _find_changed(faces, change, self.config.change.strong_rings, config.min_confirmations)
        if not is_active.any():
            return None
        is_extended = _find_extended(
            units,
            faces,
            change.winners[change.disagrees],
            readings[change.disagrees],
            config.max_extension_rise,
        )
        per_unit = change.density * config.unit_area * spacing**2
        return Selection(
            is_active=is_active,
            is_searched=is_active,
            is_near=widen(faces, is_active, 1),
            is_refuted=is_active & ~is_extended,
            is_doubtful=np.zeros_like(is_active),
            margin=config.sample_margin * spacing,
            stride=max(1, int(per_unit / config.readings_per_unit)),
        )

    def learn(
        self, change: Change, selection: Selection, samples: Samples, rng: np.random.Generator
    ) -> tuple[State, Bool[np.ndarray, " O"]]:
        """Move the units whose readings are near, grow the others again."""
        units, faces, edge = self.surface
        points, winners, config = samples.points, samples.winners, self.config.refinement
        fit = self.config.surface_fit, config.fit_rounds
        is_changed = find_movable(
            faces, selection.is_active, change, edge, config.motion, self.config.change.min_readings
        )
        if is_changed.any():
            own = points[is_changed[winners]]
            units, faces, is_changed = move_units(units, faces, is_changed, own, edge, config.motion, *fit)
        is_open = selection.is_active & ~is_changed
        if is_open.any():
            is_out = selection.is_refuted & is_open
            is_part = widen(faces, is_open, 1)[winners]
            own, is_uncovered = points[is_part], is_open[winners[is_part]]
            units, faces, num_kept = regrow(
                units, faces, is_out, own, is_uncovered, edge, config.regrowth, self.config.topology, rng
            )
            if self.config.fit:
                units, faces = fit_new(units, faces, num_kept, own, *fit)
            is_changed = np.append(is_changed[~is_out], np.ones(len(units) - num_kept, dtype=bool))
        tolerance = self.config.change.strong_ratio * change.tolerance
        has_left = _find_left(units, faces, is_changed, points[: len(samples.old)], tolerance)
        is_movable = widen(faces, is_changed, config.unfold_rings)
        used, flat = np.unique(faces, return_inverse=True)
        faces = flat.reshape(-1, 3)
        return State(unfold_part(units[used], faces, is_movable[used]), faces.astype(np.int32)), has_left


def _find_left(
    units: Float[np.ndarray, "U 3"],
    faces: Int[np.ndarray, "F 3"],
    is_changed: Bool[np.ndarray, " U"],
    points: Float[np.ndarray, "P 3"],
    tolerance: float,
) -> Bool[np.ndarray, " P"]:
    """Return which points near the changed units the surface has left."""
    import igl

    about = np.ascontiguousarray(faces[any_corner(widen(faces, is_changed, 2), faces)])
    if len(about) == 0 or len(points) == 0:
        return np.zeros(len(points), dtype=bool)
    surface = igl.AABB()
    surface.init(units, about)
    squared = np.asarray(surface.squared_distance(units, about, points)[0])
    return squared > tolerance**2


def _find_changed(
    faces: Int[np.ndarray, "F 3"], change: Change, strong_rings: int, min_confirmations: float
) -> Bool[np.ndarray, " U"]:
    """Return the units that have moved or are gone."""
    is_gone = change.is_gone
    is_moved = change.is_moved & widen(faces, change.is_strong, strong_rings)
    if is_gone.any():
        confirmations = np.bincount(change.winners[~change.disagrees], minlength=len(is_gone))
        is_gone = _spread_gone(faces, is_gone, confirmations, change.is_read, min_confirmations)
    return is_moved | is_gone


def _spread_gone(
    faces: Int[np.ndarray, "F 3"],
    is_gone: Bool[np.ndarray, " U"],
    confirmations: Int[np.ndarray, " U"],
    is_read: Bool[np.ndarray, " U"],
    min_confirmations: float,
) -> Bool[np.ndarray, " U"]:
    """Return the gone units with those next to them that new readings pass close by but never confirm.

    Where readings are so few that a unit may miss its own by chance, nothing is added.
    """
    has_any = confirmations > 0
    if not has_any.any() or confirmations[has_any].mean() < min_confirmations:
        return is_gone
    unconfirmed = is_read & ~has_any
    while True:
        wider = is_gone | widen(faces, is_gone, 1) & unconfirmed
        if (wider == is_gone).all():
            return is_gone
        is_gone = wider


def _find_extended(
    units: Float[np.ndarray, "U 3"],
    faces: Int[np.ndarray, "F 3"],
    winner: Int[np.ndarray, " D"],
    distant: Float[np.ndarray, "D 3"],
    max_rise: float,
) -> Bool[np.ndarray, " U"]:
    """Return the units at the boundary beyond which the surface continues: old readings stay true there.

    Args:
        units: positions [m].
        faces: unit indices.
        winner: the unit nearest to each reading.
        distant: readings that disagree with the map [m].
        max_rise: see `GSRMRefinementConfig.max_extension_rise`.
    """
    if len(distant) == 0:
        return np.zeros(len(units), dtype=bool)
    sides = group_sides(faces, len(units))
    slots = sides.slots[sides.starts[sides.counts == 1]]
    is_boundary = np.zeros(len(units), dtype=bool)
    is_boundary[faces.ravel()[slots]] = True
    normals = find_vertex_normals(units, faces)
    normals /= np.maximum(find_lengths(normals)[..., None], 1e-300)
    offset = distant - units[winner]
    rise = np.abs(sum_rows(offset * normals[winner])) / np.maximum(find_lengths(offset), 1e-300)
    count = np.bincount(winner, minlength=len(units))
    flat = np.bincount(winner, rise < max_rise, minlength=len(units))
    return is_boundary & (flat > count / 2)
