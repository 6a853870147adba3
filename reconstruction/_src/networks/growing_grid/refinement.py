"""How a trained grid learns from new readings: what they contradict moves, grows or is removed.

Only contradicted units and those next to them may move, and only the rows and columns around them take part.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from reconstruction._src.geometry.rows import find_lengths
from reconstruction._src.networks.change.detection import Change
from reconstruction._src.networks.change.refinement import NetworkLearner, Samples, Selection, Surface
from reconstruction._src.networks.growing_grid.growing_grid import GrowingGridConfig, State
from reconstruction._src.networks.growing_grid.learning import choose_sigmas
from reconstruction._src.networks.growing_grid.marks import close_gaps, dilate, find_open_patches
from reconstruction._src.networks.growing_grid.mesh import untangle_sheet
from reconstruction._src.networks.growing_grid.relearning import (
    Sheet,
    draw_samples,
    find_supported,
    find_window,
    relearn,
    span_gone,
)
from reconstruction._src.networks.som.winners import make_tiles

_MIN_SAMPLES = 4
"""Fewer samples span no surface."""


@dataclass(frozen=True, kw_only=True)
class GridSelection(Selection):
    """Which units of a grid learn again.

    Attributes:
        is_movable: units that learn.
        is_spanned: which of these are units that are gone, and replaced by a membrane between the others.
    """

    is_movable: Bool[np.ndarray, "R C"]
    is_spanned: Bool[np.ndarray, "R C"]


class Learner(NetworkLearner[State, GrowingGridConfig, GridSelection]):
    """A trained grid that learns from new readings."""

    def measure(self) -> Surface:
        """Return the grid, with its median edge length."""
        edges = [find_lengths(np.diff(self.state.units, axis=axis)).ravel() for axis in (0, 1)]
        return Surface(self.state.vertices, self.state.faces, float(np.median(np.concatenate(edges))))

    def select(self, change: Change, readings: Float[np.ndarray, "C 3"]) -> GridSelection | None:
        """Return the units that have moved or are gone and those next to them; None where there are none."""
        config, shape = self.config.refinement, self.state.units.shape[:2]
        is_moved, is_strong, is_gone = (
            marks.reshape(shape) for marks in (change.is_moved, change.is_strong, change.is_gone)
        )
        is_moved = is_moved & dilate(is_strong, self.config.change.strong_rings)
        if not (is_moved | is_gone).any():
            return None
        is_moved = close_gaps(is_moved, config.closing)
        is_changed = is_moved | is_gone
        is_cut = find_open_patches(is_gone & ~is_moved)
        is_ring = dilate(is_changed & ~is_cut, 1)
        is_active = is_ring & ~(_find_steady(change, shape, config.stray_share) & ~is_changed) | is_cut
        is_near = find_window(is_active).spread(shape).reshape(-1)
        return GridSelection(
            is_active=is_active.reshape(-1),
            is_searched=is_near,
            is_near=is_near,
            is_refuted=is_changed.reshape(-1),
            is_doubtful=is_active.reshape(-1),
            margin=config.sample_margin * self.surface.spacing,
            is_movable=is_active & ~is_cut,
            is_spanned=is_gone & ~is_cut & ~is_moved,
        )

    def learn(
        self, change: Change, selection: GridSelection, samples: Samples, rng: np.random.Generator
    ) -> tuple[State, Bool[np.ndarray, " O"]]:
        """Train the movable units by the batch rule, with new lines where they are stretched."""
        units, config = self.state.units, self.config
        vertices, _, spacing = self.surface
        spanned = span_gone(units, selection.is_spanned)
        center = vertices[selection.is_active].mean(axis=0)
        is_kept = ~selection.is_active.reshape(units.shape[:2])
        start = ((spanned - center) / spacing).astype(np.float32)
        number = np.arange(len(vertices)).reshape(units.shape[:2])
        sheet = Sheet(start, selection.is_movable, self.state.has_face, is_kept, number)
        per_unit = samples.num_known / len(vertices)
        sigmas = config.fit_sigmas or choose_sigmas(per_unit)[: config.refinement.max_fit_iterations]
        scaled = ((samples.points - center) / spacing).astype(np.float32)
        if selection.is_movable.any() and len(scaled) >= _MIN_SAMPLES:
            num_units = int(selection.is_near.sum())
            drawn = draw_samples(scaled, config.refinement.samples_per_unit * num_units, rng)
            sheet = relearn(sheet, make_tiles(drawn), sigmas, config.fit_config, config.refinement)
        moved = sheet.units.astype(np.float64) * spacing + center
        is_still = (sheet.number >= 0) & ~sheet.is_movable
        moved[is_still] = vertices[sheet.number[is_still]]
        has_face = find_supported(sheet, scaled, config.refinement)
        is_movable = dilate(~sheet.is_kept | sheet.is_movable, config.refinement.unfold_rings)
        return State(untangle_sheet(moved, has_face, is_movable), has_face), np.zeros(
            len(samples.old), dtype=bool
        )


def _find_steady(change: Change, shape: tuple[int, ...], stray_share: float) -> Bool[np.ndarray, "R C"]:
    """Return the units whose new readings agree, but for a share of stray ones."""
    number = int(np.prod(shape))
    against = np.bincount(change.winners[change.disagrees], minlength=number)
    everything = np.bincount(change.winners, minlength=number)
    return ((everything > 0) & (against <= stray_share * everything)).reshape(shape)
