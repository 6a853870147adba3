"""Find known objects in a scan: OpenCV's surface matching proposes poses, the beams decide.

References:
    Drost, Ulrich, Navab, Ilic (2010): Model globally, match locally: efficient and robust 3D object recognition. CVPR.
"""

import logging
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.geometry.rows import compute_lengths, sum_rows
from reconstruction._src.objects.model import ObjectModel, choose_equivalent, compute_angle, make_model
from reconstruction._src.objects.regions import (
    SPACING,
    Region,
    find_background,
    find_planes,
    find_regions,
    measure_noise,
    read_scan,
)
from reconstruction._src.objects.verification import (
    MARGIN,
    Beams,
    Verdict,
    make_beams,
    verify_by_beams,
    verify_by_distance,
)
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.selection import compute_cell_keys, thin

if TYPE_CHECKING:
    import trimesh

logger = logging.getLogger(__name__)

_MIN_NOISE = 0.002  # Noise that is measured counts as no less [m]: the mesh of an object is not exact either
_TOLERANCE = 3.0  # A beam agrees with the object within this many standard deviations of the noise
MIN_SCORE = 0.94  # Share of the beams that agree, of those that say something; lower: more false finds
_MIN_COVERAGE = 0.3
"""Share of the beams at the object that end on it; lower: objects that are hidden for a larger part are found, and
more that are none."""
_MIN_BEAMS = 40  # Fewest beams that must end on an object
_PLANE_AREA = 2.5
"""A plane of this many times the largest side of the object's box is wall, floor or table top, and not searched."""
_NUM_NEIGHBORS = 14  # Cells whose plane gives a normal
_BLURRED = 0.25
"""An object is not searched where readings may be off it by more than this share of its radius: all would fit."""
_TAKEN = 0.5
"""A region is left out where an object was found whose center is nearer than this share of the radius."""
_APART = 0.8
"""Objects are farther apart than this share of the sum of their inner radii: two cannot be at one place."""

_SAMPLING = 0.07  # Distance of the points of the object in the matching, as a share of its diameter
_TRAINED = 600
"""Points of the object with which the detector is trained at most: its time grows with their square."""
_THINNING = 1.25  # Points of a region are farther apart than the samples of the object by this factor
_MAX_POINTS = 150  # More points of a region are not matched: the time grows with their square
_SCENE_STEP = 1.0 / 4.0  # Every fourth point of the region votes for poses
_MAX_POSES, _NUM_HYPOTHESES = 60, 12  # Poses with most votes that are looked at, and that are fitted
_SAME_PLACE, _SAME_ANGLE = 0.25, np.radians(20.0)
"""Poses nearer than this share of the radius, and this angle, are one hypothesis."""
_NUM_VERIFIED = 8  # Of the poses that were fitted, so many are verified
_ROUGH_BEAMS = 250  # Beams that choose between poses; all of them decide about a find
_CERTAIN = 0.96  # With this score no further pose is tried in a region
_PROMISING = 0.4  # With a lower score a region is given up
_WORTH_TURNING = (_PROMISING, 0.65)
"""An object is turned about the best pose of a region twice, each time where the score is at least this."""

_REACHES = (0.4, 0.3, 0.2, 0.15, 0.1, 0.1, 0.07, 0.07)
"""Readings farther than this share of the radius are left out, one iteration after the other."""
_FINAL_REACHES = (0.1, 0.08, 0.07, 0.07, 0.07)  # Likewise of the last fit, to all cells of a region
_MIN_NORMAL = 0.3  # A reading belongs to a face whose normal deviates from its own by less than 72 degrees
_DAMPING = 1e-3
"""Share of the mean diagonal that is added to the normal equations: readings of one plane leave three ways open."""
_MAX_TURN = 0.5  # Largest turn of one iteration [rad]


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


class Candidate(NamedTuple):
    """An object at a pose, and what the scan says about it."""

    model: ObjectModel
    pose: Float[np.ndarray, "4 4"]
    verdict: Verdict

    @property
    def center(self) -> Float[np.ndarray, " 3"]:
        """The middle of the object's area [m]."""
        return self.model.place(self.pose)


class _Scene(NamedTuple):
    """A scan, as it is searched for one object."""

    cloud: Cloud
    is_background: Bool[np.ndarray, " N"]
    cells: Float[np.ndarray, "C 3"]
    normals: Float[np.ndarray, "C 3"]
    beams: Beams | None
    noise: float  # [m]
    tolerance: float  # [m]


def find_objects(
    scan: Any, objects: "Mapping[str, trimesh.Trimesh]", *, seed: int = 0, progress: Progress = silent
) -> list[FoundObject]:
    """Find the instances of known objects in a scan.

    Large planes are set aside; in what is left OpenCV's surface matching proposes poses, which are fitted to the
    readings and verified: beams must end where the object is, none may pass through it, and it must not be a part of
    something larger. Equal seeds give equal results.

    Args:
        scan: a `Cloud`, points `[N, 3]` [m], a `ScanLog`, a `Reconstruction` (its readings are searched) or a mesh.
            With viewpoints beams decide; without, distances alone, with more false finds.
        objects: name -> mesh in meters, normals outwards.
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
    require_extras("`find_objects`", "objects")
    if not objects:
        raise ReconstructionError("objects is empty; give name -> mesh of at least one object")
    models = [make_model(name, mesh) for name, mesh in objects.items()]
    cloud, surface_normals = read_scan(scan, seed)
    found: list[Candidate] = []
    for number, model in enumerate(models):
        scene = _prepare(cloud, surface_normals, model, seed)
        if scene.tolerance > _BLURRED * model.radius:
            logger.warning(
                "%s is not searched: with a noise of %.0f mm its shape cannot be told from others",
                model.name,
                1000 * scene.noise,
            )
            continue
        detector, regions = _make_detector(model), find_regions(scene.cells, model)
        mine: list[Candidate] = []
        for done, region in enumerate(regions):
            if all(np.linalg.norm(region.center - each.center) >= _TAKEN * model.radius for each in mine):
                best = _search(scene, model, detector, region)
                mine += [best] if best is not None and is_accepted(best.verdict) else []
            progress(f"search for {model.name}", (number + (done + 1) / len(regions)) / len(models))
        found += mine
    return [_report(each, cloud.offset) for each in suppress(found)]


def is_accepted(verdict: Verdict) -> bool:
    """Return whether a verdict is good enough for a find."""
    is_seen = verdict.coverage >= _MIN_COVERAGE and verdict.num_beams >= _MIN_BEAMS
    return is_seen and verdict.score >= MIN_SCORE


def suppress(found: list[Candidate]) -> list[Candidate]:
    """Return the best of the candidates that stand in each other's place, the best score first."""
    kept: list[Candidate] = []
    for each in sorted(found, key=lambda one: -one.verdict.score):
        # Within this radius, half the side of a cube of the least spread, no other object's center can be.
        inner = np.sqrt(3) * np.array([each.model.spread[0] + other.model.spread[0] for other in kept])
        apart = [float(np.linalg.norm(each.center - other.center)) for other in kept]
        if (np.array(apart) > _APART * inner).all():
            kept.append(each)
    return kept


def _prepare(cloud: Cloud, surface_normals: np.ndarray | None, model: ObjectModel, seed: int) -> _Scene:
    """Set the planes aside that are large for this object; find the normals of the rest."""
    planes = find_planes(cloud.points, _PLANE_AREA * model.largest_side, np.random.default_rng(seed))
    noise = max(measure_noise(cloud, planes), _MIN_NOISE)
    tolerance = _TOLERANCE * noise
    is_background = find_background(cloud.points, planes, tolerance)
    cells = thin(cloud if is_background.all() else cloud.select(~is_background), SPACING)
    if surface_normals is not None:
        outward = surface_normals[cKDTree(cloud.points).query(cells.points)[1]]
    elif cells.origins is not None:
        outward = cells.origins - cells.points
    else:
        outward = np.broadcast_to([0.0, 0.0, 1.0], cells.points.shape)
    near = cKDTree(cells.points).query(cells.points, k=min(_NUM_NEIGHBORS, cells.num_points))[1]
    offset = cells.points[near] - cells.points[near].mean(axis=1, keepdims=True)
    normals = np.linalg.eigh(np.einsum("nki,nkj->nij", offset, offset))[1][:, :, 0]
    normals *= np.where(sum_rows(normals * outward) < 0, -1.0, 1.0)[:, None]
    return _Scene(cloud, is_background, cells.points, normals, make_beams(cloud), noise, tolerance)


def _make_detector(model: ObjectModel) -> Any:
    """Train the library's detector with an object, in one thread: results do not depend on the machine."""
    import cv2

    cv2.setNumThreads(1)
    detector = cv2.ppf_match_3d.PPF3DDetector(_SAMPLING, _SAMPLING, 30)
    rows = np.linspace(0, len(model.points) - 1, min(_TRAINED, len(model.points))).round().astype(np.int64)
    samples = np.hstack([model.points[rows], model.point_normals[rows]]).astype(np.float32)
    detector.trainModel(np.ascontiguousarray(samples))
    return detector


def _search(scene: _Scene, model: ObjectModel, detector: Any, region: Region) -> Candidate | None:
    """Return the best pose in a region; None where none is promising."""
    all_points, all_normals = scene.cells[region.rows], scene.normals[region.rows]
    keys = compute_cell_keys(all_points, _THINNING * _SAMPLING * 2 * model.radius)
    rows = np.sort(np.unique(keys, return_index=True)[1])
    rows = rows[:: -(-len(rows) // _MAX_POINTS)]
    points, normals = all_points[rows], all_normals[rows]
    beams = None if scene.beams is None else scene.beams.select_near(region.center, 3 * model.radius)

    def choose(poses: np.ndarray) -> Candidate:
        """Fit poses and return the one that the scan agrees with best; only those that fit best are verified."""
        fitted, worth = align(model, poses, points, normals, scene.noise)
        order = np.argsort(-worth, kind="stable")[:_NUM_VERIFIED]
        verified = [
            Candidate(model, fitted[k], _verify(scene, model, fitted[k], beams, _ROUGH_BEAMS)) for k in order
        ]
        return max(verified, key=lambda each: each.verdict.score)

    proposed = _propose_poses(detector, model, points, normals)
    if not proposed:
        return None
    best = choose(np.array(proposed))
    for least in _WORTH_TURNING:
        if not least <= best.verdict.score < _CERTAIN:
            break
        turned = choose(best.pose @ _turn_about(model.turns, model.center))
        if turned.verdict.score <= best.verdict.score:
            break
        best = turned
    if best.verdict.score < _PROMISING:
        return None
    poses, _ = align(model, best.pose[None], all_points, all_normals, scene.noise, _FINAL_REACHES)
    return Candidate(model, poses[0], _verify(scene, model, poses[0], beams))


def _propose_poses(
    detector: Any, model: ObjectModel, points: Float[np.ndarray, "M 3"], normals: Float[np.ndarray, "M 3"]
) -> list[Float[np.ndarray, "4 4"]]:
    """Return poses of an object in a region, the ones with most votes first, each once."""
    middle = points.mean(axis=0)
    scene = np.ascontiguousarray(np.hstack([points - middle, normals]).astype(np.float32))
    ranked = sorted(detector.match(scene, _SCENE_STEP, 0.03), key=lambda each: -int(each.numVotes))
    kept: list[np.ndarray] = []
    for each in ranked[:_MAX_POSES]:
        pose = np.array(each.pose, dtype=np.float64)
        pose[:3, 3] += middle
        is_new = np.isfinite(pose).all() and not any(
            np.linalg.norm(model.place(pose) - model.place(other)) <= _SAME_PLACE * model.radius
            and compute_angle(pose[:3, :3], other[:3, :3], model.symmetries) < _SAME_ANGLE
            for other in kept
        )
        kept += [pose] if is_new else []
    return kept[:_NUM_HYPOTHESES]


def align(
    model: ObjectModel,
    poses: Float[np.ndarray, "K 4 4"],
    points: Float[np.ndarray, "M 3"],
    normals: Float[np.ndarray, "M 3"],
    noise: float,
    reaches: tuple[float, ...] = _REACHES,
) -> tuple[Float[np.ndarray, "K 4 4"], Float[np.ndarray, " K"]]:
    """Return poses that fit the readings better, and the weight of these.

    Gauss-Newton on the distances along the normals of the faces, with Tukey's weights.

    References:
        Chen, Medioni (1992): Object modelling by registration of multiple range images.
    """
    worth = np.zeros(len(poses))
    for share in reaches:
        rotation = poses[:, :3, :3]
        local = (points[None] - poses[:, None, :3, 3]) @ rotation
        reach = max(share * model.radius, 4 * noise)
        distance, nearest = model.samples.query(local, distance_upper_bound=reach)
        nearest = np.minimum(nearest, model.samples.n - 1)  # that number means none
        face_normal = model.point_normals[nearest]
        faces_it = sum_rows(normals[None] @ rotation * face_normal) > _MIN_NORMAL
        weight = np.where(faces_it, np.maximum(1 - (distance / reach) ** 2, 0.0) ** 2, 0.0)
        arm = (local - model.center) / model.radius
        jacobian = np.concatenate([np.cross(arm, face_normal), face_normal], axis=2)
        weighted = jacobian * weight[:, :, None]
        matrix = weighted.transpose(0, 2, 1) @ jacobian
        damping = _DAMPING / 6 * np.trace(matrix, axis1=1, axis2=2) + 1e-9
        residual = sum_rows((local - model.points[nearest]) * face_normal)
        right = (weighted * residual[:, :, None]).sum(axis=1)[:, :, None]
        step = np.linalg.solve(matrix + damping[:, None, None] * np.eye(6), right)[:, :, 0]
        turn = step[:, :3] / model.radius
        turn *= np.minimum(1.0, _MAX_TURN / np.maximum(compute_lengths(turn), 1e-12))[:, None]
        moves = _turn_about(Rotation.from_rotvec(turn).as_matrix(), model.center)
        moves[:, :3, 3] += step[:, 3:]
        poses, worth = poses @ moves, weight.sum(axis=1)
    return poses, worth


def _turn_about(
    turns: Float[np.ndarray, "T 3 3"], center: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "T 4 4"]:
    """Return motions of an object in its own frame that turn it about its center."""
    moves = np.tile(np.eye(4), (len(turns), 1, 1))
    moves[:, :3, :3], moves[:, :3, 3] = turns, center - turns @ center
    return moves


def _verify(
    scene: _Scene, model: ObjectModel, pose: np.ndarray, beams: Beams | None, most: int | None = None
) -> Verdict:
    """Return what the scan says about an object at a pose; with `most`, what so many of its beams say."""
    center, reach = model.place(pose), model.radius + MARGIN
    if beams is not None:
        beams = beams.select_near(center, reach, most)
        return verify_by_beams(model, pose, beams, scene.is_background[beams.rows], scene.tolerance)
    near = np.flatnonzero((np.abs(scene.cloud.points - center) < reach).all(axis=1))
    points, is_background = scene.cloud.points[near], scene.is_background[near]
    return verify_by_distance(model, pose, points, is_background, scene.tolerance, SPACING)


def _report(each: Candidate, offset: Float[np.ndarray, " 3"]) -> FoundObject:
    rotation = choose_equivalent(each.pose[:3, :3], each.model.symmetries)
    position = each.center - rotation @ each.model.center + offset
    return FoundObject(each.model.name, position, rotation, *each.verdict)
