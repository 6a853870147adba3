"""Find known objects in a scan: the library proposes poses, the beams decide."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.objects.background import find_background, find_planes, measure_noise
from reconstruction._src.objects.matching import align, make_detector, propose_poses, require_library
from reconstruction._src.objects.model import (
    MIN_BEAMS,
    MIN_COVERAGE,
    MIN_NOISE,
    NUM_HYPOTHESES,
    PLANE_AREA,
    SAMPLING,
    SPACING,
    ObjectModel,
    ObjectsConfig,
    choose_equivalent,
    make_model,
)
from reconstruction._src.objects.readings import Cells, Region, find_regions, make_cells, read_scan
from reconstruction._src.objects.verification import (
    BeamIndex,
    Beams,
    Verdict,
    find_reach,
    verify_by_beams,
    verify_by_distance,
)
from reconstruction._src.scans.cloud import Cloud

if TYPE_CHECKING:
    import trimesh

logger = logging.getLogger(__name__)
_NUM_NEIGHBORS = 14  # Cells whose plane gives a normal
_CERTAIN = 0.96  # With this score no further pose is tried in a region
_PROMISING = 0.4  # With a lower score a region is given up
_NUM_VERIFIED = 8  # Of the poses that were fitted, so many are verified
_ROUGH_BEAMS = 250  # Beams that choose between poses; all of them decide about a find
_THINNING = 1.25  # Points of a region are farther apart than the samples of the object by this factor
_WORTH_TURNING = (_PROMISING, 0.65)
"""An object is turned about the best pose of a region twice, each time where the score is at least this."""
_TAKEN = 0.5
"""A region is left out where an object was found whose center is nearer than this share of the radius."""
_MAX_POINTS = 150  # More points of a region are not matched: the time grows with their square
_FINAL_REACHES = (0.1, 0.08, 0.07, 0.07, 0.07)  # Of the last fit, to all cells of a region; see `align`
_BLURRED = 0.25
"""An object is not searched where readings may be off it by more than this share of its radius: all would fit."""
_APART = 0.8
"""Objects are farther apart than this share of the sum of their inner radii: two cannot be at one place."""


class FoundObject(NamedTuple):
    """An object that was found.

    Attributes:
        name: which object.
        position: `[3]` of the origin of its mesh, in the coordinates of the scan [m].
        rotation: `[3, 3]` mesh to scan; of those that look the same, the one that turns least.
        score: share of the beams about it that agree with it, 0 to 1.
        coverage: share of the beams at it that end on it, 0 to 1; the rest is hidden.
        num_beams: beams that end on it.
    """

    name: str
    position: Float[np.ndarray, " 3"]
    rotation: Float[np.ndarray, "3 3"]
    score: float
    coverage: float
    num_beams: int


class _Scene(NamedTuple):
    """What all objects share."""

    cloud: Cloud
    is_background: np.ndarray
    cells: Cells
    normals: np.ndarray
    beams: BeamIndex | None
    noise: float


class _Candidate(NamedTuple):
    model: ObjectModel
    pose: np.ndarray
    verdict: Verdict


def find_objects(
    scan: Any,
    objects: Mapping[str, trimesh.Trimesh],
    config: ObjectsConfig | None = None,
    *,
    seed: int = 0,
    progress: Progress = silent,
) -> list[FoundObject]:
    """Find the instances of known objects in a scan.

    Large planes are set aside; in what is left OpenCV's surface matching proposes poses, which are fitted to the
    readings and verified: beams must end where the object is, none may pass through it, and it must not be a part of
    something larger. Equal seeds give equal results.

    Args:
        scan: a `Cloud`, points `[N, 3]` [m], a `ScanLog`, a `Reconstruction` (its readings are searched) or a mesh.
            With viewpoints beams decide; without, distances alone, with more false finds.
        objects: name -> mesh in meters, normals outwards.
        config: how is searched and what counts; None for the defaults.
        seed: of the planes that are tried, and of the samples of a mesh.
        progress: called with the object that is searched and the share of the work that is done.

    Returns:
        What was found, the best score first, in the coordinates of the scan.

    Raises:
        ReconstructionError: there is no object, an object or the scan is unusable.
        MissingExtraError: the extra `objects` is not installed.

    References:
        Drost, Ulrich, Navab, Ilic (2010), CVPR: point pair features, as in OpenCV's `ppf_match_3d`.
    """
    require_library()
    config = config or ObjectsConfig()
    if not objects:
        raise ReconstructionError("objects is empty; give name -> mesh of at least one object")
    models = [make_model(name, mesh) for name, mesh in objects.items()]
    cloud, surface_normals = read_scan(scan, SPACING, seed)
    found: list[_Candidate] = []
    for number, model in enumerate(models):
        scene = _prepare(cloud, surface_normals, model, config, seed)
        if config.tolerance * scene.noise > _BLURRED * model.radius:
            logger.warning(
                "%s is not searched: with a noise of %.0f mm its shape cannot be told from others",
                model.name,
                1000 * scene.noise,
            )
            continue
        regions = find_regions(scene.cells.points, model)
        detector = make_detector(model)
        mine: list[_Candidate] = []
        for done, region in enumerate(regions):
            is_taken = any(
                np.linalg.norm(region.center - _find_body(each)[0]) < _TAKEN * model.radius for each in mine
            )
            best = None if is_taken else _search(scene, model, detector, region, config)
            if best is not None:
                mine.append(best)
            progress(f"search for {model.name}", (number + (done + 1) / len(regions)) / len(models))
        found += mine
    return [_report(each, cloud.offset) for each in suppress(found)]


def _prepare(
    cloud: Cloud, surface_normals: np.ndarray | None, model: ObjectModel, config: ObjectsConfig, seed: int
) -> _Scene:
    """Set the planes aside that are large for this object."""
    rng = np.random.default_rng(seed)
    planes = find_planes(cloud.points, PLANE_AREA * model.largest_side, rng)
    measured = max(measure_noise(cloud, planes), MIN_NOISE)
    noise = measured if config.noise is None else config.noise
    is_background = find_background(cloud.points, planes, config.tolerance * noise)
    rest = cloud.select(~is_background)
    cells = make_cells(rest, SPACING) if rest.num_points else make_cells(cloud, SPACING)
    beams = None if cloud.origins is None else BeamIndex(cloud)
    normals = _compute_cell_normals(cells, _select_outward(cells, cloud, surface_normals))
    return _Scene(cloud, is_background, cells, normals, beams, noise)


def _select_outward(cells: Cells, cloud: Cloud, surface_normals: np.ndarray | None) -> np.ndarray:
    """Return `[C, 3]` directions away from the surface: the nearest normal of a mesh, to the viewpoint, else up."""
    from scipy.spatial import cKDTree

    if surface_normals is not None:
        return surface_normals[cKDTree(cloud.points).query(cells.points)[1]]
    if cloud.viewpoints is None or cells.viewpoint.min() < 0:
        return np.broadcast_to([0.0, 0.0, 1.0], cells.points.shape)
    return cloud.viewpoints[cells.viewpoint] - cells.points


def _compute_cell_normals(cells: Cells, outward: np.ndarray) -> Float[np.ndarray, "C 3"]:
    """Return the normals of the planes through the neighbors of each cell, on the outward side."""
    from scipy.spatial import cKDTree

    count = min(_NUM_NEIGHBORS, len(cells.points))
    _, near = cKDTree(cells.points).query(cells.points, k=count)
    offset = cells.points[near] - cells.points[near].mean(axis=1, keepdims=True)
    normals = np.linalg.eigh(np.einsum("nki,nkj->nij", offset, offset))[1][:, :, 0]
    return normals * np.where((normals * outward).sum(axis=1) < 0, -1.0, 1.0)[:, None]


def _search(
    scene: _Scene, model: ObjectModel, detector: Any, region: Region, config: ObjectsConfig
) -> _Candidate | None:
    """Return the best pose in a region, where the scan agrees with it."""
    points, normals = scene.cells.points[region.rows], scene.normals[region.rows]
    rows = _thin_rows(points, _THINNING * SAMPLING * 2 * model.radius)
    rows = rows[:: -(-len(rows) // _MAX_POINTS)]
    points, normals = points[rows], normals[rows]
    beams = None if scene.beams is None else scene.beams.find(region.center, 3 * model.radius)
    proposed = propose_poses(detector, model, points, normals)[:NUM_HYPOTHESES]
    if not proposed:
        return None
    best = _choose(scene, model, np.array(proposed), points, normals, beams, config)
    for least in _WORTH_TURNING:
        if not least <= best.verdict.score < _CERTAIN:
            break
        turned = _choose(scene, model, _turn(model, best.pose), points, normals, beams, config)
        if turned.verdict.score <= best.verdict.score:
            break
        best = turned
    if best.verdict.score < _PROMISING:
        return None
    all_points, all_normals = scene.cells.points[region.rows], scene.normals[region.rows]
    poses, _ = align(model, best.pose[None], all_points, all_normals, scene.noise, _FINAL_REACHES, True)
    best = _Candidate(model, poses[0], verify(scene, model, poses[0], beams, config))
    return best if is_accepted(best.verdict, config) else None


def _choose(
    scene: _Scene,
    model: ObjectModel,
    poses: Float[np.ndarray, "K 4 4"],
    points: Float[np.ndarray, "M 3"],
    normals: Float[np.ndarray, "M 3"],
    beams: Beams | None,
    config: ObjectsConfig,
) -> _Candidate:
    """Fit poses and return the one with which the scan agrees best; only those that fit best are verified."""
    fitted, worth = align(model, poses, points, normals, scene.noise)
    order = np.argsort(-worth, kind="stable")[:_NUM_VERIFIED]
    return max(
        (
            _Candidate(model, fitted[k], verify(scene, model, fitted[k], beams, config, _ROUGH_BEAMS))
            for k in order
        ),
        key=lambda each: each.verdict.score,
    )


def _turn(model: ObjectModel, pose: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "T 4 4"]:
    """Return poses with the same center, turned so that the object may look alike."""
    turned = np.tile(np.eye(4), (len(model.turns), 1, 1))
    turned[:, :3, :3] = model.turns
    turned[:, :3, 3] = model.center - model.turns @ model.center
    return pose @ turned


def verify(
    scene: _Scene,
    model: ObjectModel,
    pose: Float[np.ndarray, "4 4"],
    beams: Beams | None,
    config: ObjectsConfig,
    most: int | None = None,
) -> Verdict:
    """Return what the scan says about an object at a pose; with `most`, what so many of its beams say."""
    center, reach = pose[:3, :3] @ model.center + pose[:3, 3], find_reach(model)
    if beams is not None:
        beams = beams.near(center, reach, most)
        return verify_by_beams(model, pose, beams, scene.is_background[beams.rows], scene.noise, config)
    near = np.flatnonzero((np.abs(scene.cloud.points - center) < reach).all(axis=1))
    points, is_background = scene.cloud.points[near], scene.is_background[near]
    return verify_by_distance(model, pose, points, is_background, scene.noise, SPACING, config)


def is_accepted(verdict: Verdict, config: ObjectsConfig) -> bool:
    """Return whether a verdict is good enough for a find."""
    return (
        verdict.score >= config.min_score
        and verdict.coverage >= MIN_COVERAGE
        and verdict.num_beams >= MIN_BEAMS
    )


def suppress(found: list[_Candidate]) -> list[_Candidate]:
    """Return the best of the candidates that stand in each other's place, the best score first."""
    kept: list[_Candidate] = []
    for each in sorted(found, key=lambda one: -one.verdict.score):
        center, inner = _find_body(each)
        if all(
            np.linalg.norm(center - other) > _APART * (inner + reach)
            for other, reach in map(_find_body, kept)
        ):
            kept.append(each)
    return kept


def _find_body(candidate: _Candidate) -> tuple[np.ndarray, float]:
    """Return the center [m], and a radius within which no other object's can be."""
    model, pose = candidate.model, candidate.pose
    return pose[:3, :3] @ model.center + pose[:3, 3], float(model.spread[0]) * np.sqrt(3)


def _thin_rows(points: Float[np.ndarray, "M 3"], width: float) -> Int[np.ndarray, " S"]:
    """Return one row of each cell of a width [m]."""
    index = np.floor((points - points.min(axis=0)) / width).astype(np.int64)
    shape = index.max(axis=0) + 1
    return np.sort(
        np.unique((index[:, 0] * shape[1] + index[:, 1]) * shape[2] + index[:, 2], return_index=True)[1]
    )


def _report(each: _Candidate, offset: Float[np.ndarray, " 3"]) -> FoundObject:
    model = each.model
    rotation = choose_equivalent(each.pose[:3, :3], model.symmetries)
    center = each.pose[:3, :3] @ model.center + each.pose[:3, 3]
    position = center - rotation @ model.center + offset
    verdict = each.verdict
    return FoundObject(model.name, position, rotation, verdict.score, verdict.coverage, verdict.num_beams)
