"""Slabs fitted to rough ground: where planes are not enough, caps are fitted to the heights themselves.

The slab with the largest error is cut along the best of many lines, and a concave cap, a minimum of affine
functions, is fitted to either side, until the ground is met or the number of pieces is used up.

References:
    Magnani, Boyd (2009), Convex piecewise-linear fitting, section 3: assign every point to the plane that is
    lowest there, fit each plane to its points, repeat.
    Breiman et al. (1984), Classification and regression trees: greedy cuts, the worst leaf first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float, Int

from reconstruction.geometry.elevation import Elevation
from reconstruction.geometry.halfspaces import make_prism
from reconstruction.geometry.outlines import cut_outline, find_bounds, is_within
from symbrion_gym.contact.budget import never
from symbrion_gym.contact.slabs import Slab, make_grid

_DAMPING, _SLOPES = 1e-6, np.diag([1e-3, 1e-3, 0.0])
"""Keep the slopes of a plane through points on one line finite; far below the spread of any other points."""


@dataclass(frozen=True)
class SlabFitConfig:
    """How caps are fitted to rough ground.

    Attributes:
        num_points: about how many points of the ground are fitted to.
        enough: fitting ends where the mean distance is below this share of the accuracy that is wanted.
        max_gap: a point counts as no farther than this from its cap [m]: walls must not bend the ground.
        outlier: distance from which on a point loses weight in the fit of a plane [m].
        plane_rounds: number of rounds of the robust fit of a plane.
        cap_counts: numbers of planes tried in one cap.
        cap_rounds: number of rounds of assigning points to planes, and fitting each to its points.
        cap_points: points that a plane of a cap needs to stay.
        cap_start_points: points for each plane that a cap is started with.
        cap_gain: more planes must leave less than this share of the error.
        min_cut_points: a patch with fewer points is not cut ...
        min_side_points: ... nor along a line with fewer of those that are searched on one side.
        search_points: points on which the lines of a cut are compared.
        directions: directions of those lines.
        cut_shares: their places: shares of the points on one side.
        cut_gain: a cut must leave less than this share of the error.
        part_points: points to which the caps of a new part are fitted.
        min_refit_points: a slab with fewer points keeps its cap.
        refit_points: points to which its new cap is fitted.
        refit_gain: a new cap must leave no more than this share of the error.
        refit_lift: ground of other slabs may be lifted by this [m] ...
        refit_lifted: ... at this share of the slab's points.
    """

    num_points: int = 30_000
    enough: float = 0.5
    max_gap: float = 0.05
    outlier: float = 0.01
    plane_rounds: int = 3
    cap_counts: tuple[int, ...] = (2, 3, 6)
    cap_rounds: int = 8
    cap_points: int = 8
    cap_start_points: int = 12
    cap_gain: float = 0.93
    min_cut_points: int = 40
    min_side_points: int = 10
    search_points: int = 300
    directions: int = 8
    cut_shares: tuple[float, ...] = (0.15, 0.3, 0.4, 0.5, 0.6, 0.7, 0.85)
    cut_gain: float = 0.97
    part_points: int = 1000
    min_refit_points: int = 12
    refit_points: int = 2000
    refit_gain: float = 0.8
    refit_lift: float = 0.005
    refit_lifted: float = 0.01


SLAB_FIT_DEFAULTS = SlabFitConfig()


@dataclass(frozen=True)
class Patch:
    """A convex part of the plan with a cap fitted to the ground.

    Attributes:
        outline: `[P, 2]` convex, counter-clockwise [m].
        members: `[M]` the points whose ground it is.
        caps: `[K, 3]` slopes and height: the top is the minimum of a x + b y + c.
        error: sum of the distances of its points from the top [m].
    """

    outline: Float[np.ndarray, "P 2"]
    members: Int[np.ndarray, " M"]
    caps: Float[np.ndarray, "K 3"]
    error: float


def fit_slabs(
    mesh: trimesh.Trimesh,
    elevation: Elevation,
    slabs: list[Slab],
    levels: Float[np.ndarray, "R 3"],
    accuracy: float,
    max_pieces: int,
    thickness: float,
    is_exceeded: Callable[[], bool] = never,
    config: SlabFitConfig = SLAB_FIT_DEFAULTS,
) -> list[trimesh.Trimesh]:
    """Fit slabs to the heights of a mesh and cut them further, the worst first.

    Args:
        mesh: open terrain, normals up.
        elevation: its heights.
        slabs: to start from.
        levels: the planes that the slabs name, (a, b, c) of z = a x + b y + c.
        accuracy: mean distance that is good enough [m].
        max_pieces: no more than these.
        thickness: how far the solids reach below the lowest ground [m].
        is_exceeded: asked now and then; once true, cutting ends.
        config: how they are fitted.
    """
    points, _ = make_grid(mesh, config.num_points)
    heights = elevation.height(points[:, 0], points[:, 1])
    is_there = np.isfinite(heights)
    fit = _SlabFit(np.column_stack([points, heights])[is_there], config)
    patches = [fit.refit(patch) for patch in fit.share_out(slabs, levels)]
    closed: set[int] = set()
    while len(patches) < max_pieces and not is_exceeded():
        if sum(patch.error for patch in patches) < config.enough * accuracy * len(fit.ground):
            break
        candidates = [i for i in range(len(patches)) if id(patches[i]) not in closed]
        if not candidates:
            break
        worst = max(candidates, key=lambda i: patches[i].error)
        parts = fit.cut(patches[worst])
        if parts is None:
            closed.add(id(patches[worst]))
        else:
            patches[worst : worst + 1] = parts
    bottom = float(mesh.vertices[:, 2].min()) - thickness
    solids = [_make_solid(patch, bottom) for patch in patches]
    return [solid for solid in solids if solid is not None]


class _SlabFit:
    """Caps fitted to the points of a ground."""

    def __init__(self, ground: Float[np.ndarray, "N 3"], config: SlabFitConfig) -> None:
        self.ground, self.config = ground, config

    def share_out(self, slabs: list[Slab], levels: Float[np.ndarray, "R 3"]) -> list[Patch]:
        """Give every point to the slab that is the ground there: the highest of those that cover it in plan."""
        tops = np.full((len(slabs), len(self.ground)), -np.inf)
        for i, slab in enumerate(slabs):
            inside = is_within(slab.outline, self.ground[:, :2])
            tops[i, inside] = _find_top(levels[slab.planes], self.ground[inside])
        owner = np.argmax(tops, axis=0)
        owner[np.isneginf(tops.max(axis=0))] = -1
        return [
            self._make_patch(slab.outline, np.flatnonzero(owner == i), levels[slab.planes])
            for i, slab in enumerate(slabs)
        ]

    def refit(self, patch: Patch) -> Patch:
        """Return the patch with a fitted cap, where that is much closer and lifts no other ground."""
        config = self.config
        if len(patch.members) < config.min_refit_points:
            return patch
        fitted = self._make_patch(
            patch.outline, patch.members, self._fit_caps(patch.members, config.refit_points, patch.caps)
        )
        if fitted.error > config.refit_gain * patch.error:
            return patch
        is_other = is_within(patch.outline, self.ground[:, :2])
        is_other[patch.members] = False
        other = self.ground[is_other]
        is_lifted = _find_top(fitted.caps, other) > other[:, 2] + config.refit_lift
        return patch if is_lifted.sum() > config.refit_lifted * len(patch.members) else fitted

    def cut(self, patch: Patch) -> list[Patch] | None:
        """Return the patch in two along the line that leaves the smallest error; None where none helps."""
        if len(patch.members) < self.config.min_cut_points:
            return None
        line = self._find_cut(patch)
        if line is None:
            return None
        is_left = self.ground[patch.members, :2] @ line[:2] <= line[2]
        parts = []
        for side, bound in ((is_left, line), (~is_left, -line)):
            outline = cut_outline(patch.outline, bound)
            if outline is None:
                return None
            members = patch.members[side]
            fitted = self._make_patch(outline, members, self._fit_caps(members, self.config.part_points))
            kept = self._make_patch(outline, members, patch.caps)
            parts.append(fitted if fitted.error < kept.error else kept)
        return parts if parts[0].error + parts[1].error < self.config.cut_gain * patch.error else None

    def _find_cut(self, patch: Patch) -> Float[np.ndarray, " 3"] | None:
        """Return the line (a, b, c) on whose two sides a plane each leaves the smallest error."""
        config = self.config
        sample = self.ground[patch.members][:: max(len(patch.members) // config.search_points, 1)]
        best, least = None, np.inf
        for angle in np.arange(config.directions) * np.pi / config.directions:
            normal = np.array([np.cos(angle), np.sin(angle)])
            along = sample[:, :2] @ normal
            for offset in np.quantile(along, config.cut_shares):
                sides = [sample[along <= offset], sample[along > offset]]
                if min(len(side) for side in sides) < config.min_side_points:
                    continue
                error = sum(self._measure(self._fit_plane(side), side) for side in sides)
                if error < least:
                    best, least = np.append(normal, offset), error
        return best

    def _make_patch(
        self,
        outline: Float[np.ndarray, "P 2"],
        members: Int[np.ndarray, " M"],
        caps: Float[np.ndarray, "K 3"],
    ) -> Patch:
        return Patch(outline, members, caps, self._measure(caps, self.ground[members]))

    def _fit_caps(
        self, members: Int[np.ndarray, " M"], num_points: int, start: Float[np.ndarray, "K 3"] | None = None
    ) -> Float[np.ndarray, "L 3"]:
        """Fit affine functions whose minimum follows some of the points: one, two, then more while that helps."""
        config = self.config
        points = self.ground[members][:: max(len(members) // num_points, 1)]
        best = self._fit_plane(points)
        least = self._measure(best, points)
        starts = [] if start is None else [start]
        for count in config.cap_counts:
            if len(points) >= config.cap_start_points * count:
                starts.append(self._spread_caps(points, count))
        for caps in starts:
            for _ in range(config.cap_rounds):
                owner = np.argmin(points[:, :2] @ caps[:, :2].T + caps[:, 2], axis=1)
                used = [k for k in range(len(caps)) if (owner == k).sum() >= config.cap_points]
                if not used:
                    break
                caps = np.concatenate([self._fit_plane(points[owner == k]) for k in used])
            error = self._measure(caps, points)
            if error < config.cap_gain * least:
                best, least = caps, error
        return best

    def _spread_caps(self, points: Float[np.ndarray, "M 3"], count: int) -> Float[np.ndarray, "count 3"]:
        """Fit planes to parts of about one size, side by side along the longest extent."""
        center = points[:, :2] - points[:, :2].mean(axis=0)
        along = center @ np.linalg.eigh(center.T @ center)[1][:, -1]
        part = np.minimum((np.argsort(np.argsort(along)) * count) // len(points), count - 1)
        return np.concatenate([self._fit_plane(points[part == k]) for k in range(count)])

    def _fit_plane(self, points: Float[np.ndarray, "M 3"]) -> Float[np.ndarray, "1 3"]:
        """Fit an affine function to points, far ones losing weight."""
        center = points.mean(axis=0)
        local = points - center
        weights = np.ones(len(points))
        slope = np.zeros(3)
        for _ in range(self.config.plane_rounds):
            design = np.column_stack([local[:, :2], np.ones(len(points))])
            normal = (design.T * weights) @ design + _DAMPING * len(points) * _SLOPES
            slope = np.linalg.lstsq(normal, (design.T * weights) @ local[:, 2], rcond=None)[0]
            weights = 1.0 / np.maximum(np.abs(local[:, 2] - design @ slope) / self.config.outlier, 1.0)
        return np.array([[slope[0], slope[1], slope[2] + center[2] - slope[:2] @ center[:2]]])

    def _measure(self, caps: Float[np.ndarray, "K 3"], points: Float[np.ndarray, "M 3"]) -> float:
        """Return the sum of the distances of points from their top [m]."""
        if not len(points):
            return 0.0
        return float(np.minimum(np.abs(_find_top(caps, points) - points[:, 2]), self.config.max_gap).sum())


def _find_top(caps: Float[np.ndarray, "K 3"], points: Float[np.ndarray, "M 3"]) -> Float[np.ndarray, " M"]:
    """Return the height of the minimum of affine functions at points [m]."""
    return (points[:, :2] @ caps[:, :2].T + caps[:, 2]).min(axis=1)


def _make_solid(patch: Patch, bottom: float) -> trimesh.Trimesh | None:
    normals = np.column_stack([-patch.caps[:, :2], np.ones(len(patch.caps))])
    size = np.linalg.norm(normals, axis=1)
    tops = np.column_stack([normals / size[:, None], -(patch.caps[:, 2] / size)])
    return make_prism(find_bounds(patch.outline), tops, bottom)
