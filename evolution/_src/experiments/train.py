"""From any scan to a robot that drives there: two models that share no reading, a verdict, a way, a champion."""

from __future__ import annotations

import hashlib
import logging
import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

import reconstruction as rc
import symbrion_gym as sg
from evolution._src.backends.settings import Randomization, read_organism
from evolution._src.champions.playback import judge
from evolution._src.errors import RunError
from evolution._src.experiments.folders import claim_folder, evolve_or_resume, refuse_foreign_files
from evolution._src.experiments.training import TRIALS, Training
from evolution._src.search.cmaes import Run
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.run import lock_folder
from evolution._src.search.validation import Validation
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.base.range_checks import format_extents
from reconstruction._src.base.typed_json import write_json
from reconstruction._src.geometry.sampling import SQUARE, TALLEST, find_low, sample_area
from reconstruction._src.surfaces.far_faces import select_faces
from symbrion_gym._src.arenas.saving import ABOUT
from symbrion_gym._src.arenas.scanned import simulate_readings
from symbrion_gym._src.contact.distances import find_nearest
from symbrion_gym._src.sensing.survey import SPACING
from symbrion_gym._src.tasks.features.gap import find_gap
from symbrion_gym._src.tasks.paths import find_path
from symbrion_gym._src.tasks.route import Start

if TYPE_CHECKING:
    from symbrion_gym._src.robot.organism import Organism

Site = rc.ScanLog | rc.Cloud | sg.Arena  # What a robot is to drive in, as it was read
Place = tuple[float, ...]  # (x, y) [m], and z where it was chosen

logger = logging.getLogger(__name__)

MARKER, PAGE = "train.json", "report.html"
HALVES = ("arena", "other")  # Folders of both models: that of training, and that which checks it
RUN = "run"  # Folder of the evolution
OUTPUTS = (*HALVES, RUN, PAGE)
GENERATIONS = 30
_MODELS, _WAY, _GENERATION, _JUDGING, _PAGE = 5.0, 4.0, 2.0, 4.0, 5.0
"""How long the parts of a training take, relative to each other; how many generations the search takes it tells."""
_SITE = 20.0  # Edge of the square of a larger scan that is used [m]: a Scout drives 10 m in 100 s
_RIM = 1.0  # The ends of a way that lie so far within the part with most ground do not move it [m]
_FEWEST = 100  # With fewer readings such a square holds no ground
_COLUMN, _PARTS = 0.2, 4  # Width of columns of readings [m], and parts of the edge by which squares are apart
_MOST = 0.9  # Share of the most columns of level ground that is nearly as many
_LEVEL = 0.05  # Lowest readings of columns side by side that differ by less are of the same level ground [m]
_NUM_PLACES, _EYE, _NUM_READINGS = 8, 0.3, 80_000
"""Places from which a mesh is scanned, height of the scanner there [m], and about how many readings this gives ..."""
_MOST_POINTS, _FIRST = 100_000, 1_000
"""... of so many points at most; the first tell how many of them are seen."""
_SCANS = 8  # Of as many positions of the scanner the readings alternate by position, of fewer one by one
_AGREE = 0.02
"""Models that are this near to each other confirm each other [m], as contact does that holds a robot."""
_AS_SCANNED = Randomization(stretch=(1.0,))
"""Conditions of trials at a gap as wide as it was scanned: errors of the scan are those between the halves."""
_CONFIRMED = Validation(rounds=(8, 16), solved_share=0.95)
"""At a gap, where a trial is long, half as many trials as in other runs: the champion is judged anew."""
_LOCALIZED = replace(_AS_SCANNED, start_offset=(-0.02, 0.02), yaw=(-0.0175, 0.0175))
"""Conditions of trials on a way: the robot knows where it starts to 2 cm and 1 degree, twice what the laser scans of
the paper of 2011 tell. From there on it has its own tracks alone."""
_VARIED = {name: getattr(_LOCALIZED, name) for name in ("friction", "start_offset", "yaw")}
_NUM_STRAIGHT = 5  # Trials of a body that drives straight on, none of which may arrive
_LEGS = ((0.35, 0.6), (0.27, 0.35))
"""Shortest and longest first and second leg of a way that is chosen [m]: after a turn tracks alone know the heading to
about a tenth of it."""
_TURN = np.deg2rad([50.0, 62.0])  # Least and most turn between them
_SIGMA = 1.0  # First step of the search: a small gain, an arc, follows a way by chance in one model alone
_SNAP = 0.05  # Corners lie at most so far from a place of the map [m]
_NUM_WAYS, _NUM_TRIED = 5_000, 20  # Ways that are drawn, and of which so many are tried in the environment
_ROOMS = 2.0, 1.0
"""Distances from walls on a way that is chosen, over that which the body needs; less where no way has more."""
_EQUALLY = np.deg2rad(1.0)  # Ground that is steeper by less is as level [rad]
_NUM_CHECKED = 17  # Places of a leg that are looked up on the maps, at most 5 cm apart
_MODULES = (2, 12)  # Least and most modules of a row that crosses a gap
_REACH = 1.75  # Length of such a row over the width of the gap: eight Scouts cross 0.45 m


def read_site(
    path: str | Path,
    viewpoints: ArrayLike | None = None,
    max_pieces: int | None = None,
    progress: Progress = silent,
    **frame: Any,
) -> Site:
    """Return what a file holds: a scan log, a cloud or, of a mesh or an arena folder, an arena.

    Args:
        path: a file or folder.
        viewpoints: where the scanner stood, in the coordinates of the file with z up [m].
        max_pieces: of the arena of a mesh, as of `make_arena`.
        progress: of its making.
        frame: unit, up, scale and classes, as of `reconstruction.load_cloud`.
    """
    path, given = Path(path), {name: value for name, value in frame.items() if value not in (None, 1.0)}
    if path.is_dir():
        return sg.load_arena(path)
    if rc.is_scan_log(path):
        if given or viewpoints is not None:
            raise rc.ScanError(f"{path} is a scan log, which says all about its frame; leave out the others")
        return rc.load_scan_log(path)
    if rc.is_mesh(path):
        return _make_arena(path, max_pieces, viewpoints=viewpoints, progress=progress, **given)
    return rc.load_cloud(path, viewpoints=viewpoints, **given)


def _make_arena(source: Any, max_pieces: int | None, **options: Any) -> sg.Arena:
    """Return an arena; where nothing but the number of its pieces is wrong, and none is given, of twice as many."""
    if max_pieces is not None:
        options["max_pieces"] = max_pieces
    arena = sg.make_arena(source, **options)
    remedies = [reason.remedy for reason in arena.verdict.reasons if reason.answer == "no"]
    if max_pieces is not None or not remedies or not all("--max-pieces" in each for each in remedies):
        return arena
    most = 2 * arena.provenance["options"]["max_pieces"]
    logger.warning("the arena is made again, of up to %d pieces", most)
    return sg.make_arena(source, max_pieces=most, **options)


def train(
    scan: str | Path | Site,
    folder: str | Path,
    *,
    start: Place | None = None,
    goal: Place | None = None,
    organism: Any = None,
    max_pieces: int | None = None,
    truth: sg.Arena | None = None,
    source: str = "SCAN",
    seed: int = 0,
    workers: int = os.cpu_count() or 1,
    progress: Progress = silent,
) -> Training:
    """Make two models of a scan, evolve a controller in one from zero, judge it in both, and write a page.

    What has been done in the folder is not done again: an interrupted training goes on, with equal results. Where
    nothing has evolved yet, other options make the models anew.

    Args:
        scan: a file of points, a scan log, a mesh or an arena folder, or what one of them holds.
        folder: new, or that of an earlier training of the same scan with the same options.
        start: (x, y) [m]; None to choose it where both models agree.
        goal: likewise; chosen so that the way has a corner.
        organism: body, by name, number of modules or `Organism`; None: a lone Scout, or a row that crosses the gap
            between start and goal.
        max_pieces: of each model, as of `make_arena`; None: 2200, or twice as many where these alone make it a "no".
        truth: the exact arena where it is known, in which the champion is judged, too.
        source: the scan and how it is read, as the command on the page is to say it.
        seed: of everything; equal seeds give equal results.
        workers: number of threads; results do not depend on it.
        progress: called with what is being done and the share done.

    Raises:
        RunError: the folder holds something else, a start or goal lies beside the scan, the arena is not good for a
            robot, or there is no way in it.
        ScanError: the scan cannot be read.
    """
    require_extras("`symbrion train`", "report")
    from evolution._src.experiments.train_page import write_train_page

    folder = Path(folder)
    refuse_foreign_files(folder, MARKER, OUTPUTS)
    progress("reading the scan", 0.0)
    site = read_site(scan, max_pieces=max_pieces) if isinstance(scan, str | Path) else scan
    _check_inside(site, start=start, goal=goal)
    body = None if organism is None else read_organism(organism)
    options = {"start": start, "goal": goal, "organism": None if organism is None else str(organism)}
    options["max_pieces"] = max_pieces
    _claim(folder, {"scan": _digest(site), "seed": seed, **options})
    begun = length = _WAY + _JUDGING + _PAGE + (0.0 if (folder / RUN).exists() else _MODELS)

    def search(message: str, share: float) -> None:
        nonlocal length
        length = begun + _GENERATION * GENERATIONS * share
        progress(message, 1.0 - (_JUDGING + _PAGE) / length)

    with lock_folder(folder):
        ends = [place[:2] for place in (start, goal) if place is not None]
        arenas = make_models(site, folder, seed, cover_part(progress, 0.02, 0.25), ends, max_pieces)
        verdict = arenas[0].verdict
        if verdict.answer == "no":
            raise RunError(f"{verdict}; symbrion view {folder / HALVES[0]} shows it")
        progress("choosing the way", 0.25)
        config = choose_task(arenas, folder, body, start, goal, seed, workers)
        run = evolve_or_resume(config, search)
        progress("judging the champion", 1.0 - (_JUDGING + _PAGE) / length)
        second = "scan of it" if isinstance(site, sg.Arena) else "other half"
        known = {"training": arenas[0], second: arenas[1]} | ({} if truth is None else {"truth": truth})
        held = {name: judge_in(arena, run, seed, workers) for name, arena in known.items()}
        result = Training(folder, arenas[0], arenas[1], verdict, run, held, folder / PAGE)
        judged_in, writing = list(known.values())[-1], cover_part(progress, 1.0 - _PAGE / length, 1.0)
        write_train_page(result, judged_in, source, _format_options({**options, "seed": seed}), writing)
        progress("done", 1.0)
        return result


def _format_options(options: dict[str, Any]) -> str:
    """Return options as a command line has them."""
    given = {name: np.atleast_1d(value).tolist() for name, value in options.items() if value is not None}
    return " ".join(
        f"--{name.replace('_', '-')} {' '.join(map(str, values))}" for name, values in given.items()
    )


def _check_inside(site: Site, **ends: Place | None) -> None:
    """Refuse a start or goal beside what was scanned, or a goal at the start."""
    if ends["start"] is not None and ends["start"] == ends["goal"]:
        raise RunError(f"start and goal are the same place {ends['start']}; move one of them")
    places = _find_places(site)
    low, high = places.min(axis=0), places.max(axis=0)
    for name, place in ends.items():
        if place is not None and not ((low[:2] <= place[:2]) & (place[:2] <= high[:2])).all():
            raise RunError(
                f"the {name} ({place[0]:g}, {place[1]:g}) lies beside the scan, which extends over "
                f"{format_extents(low[:2], high[:2])}"
            )


def _find_places(site: Site) -> Float[np.ndarray, "N 3"]:
    """Return points of a site, those at its ends among them [m]."""
    if isinstance(site, sg.Arena):
        return np.asarray(site.surface.bounds)
    return site.points if isinstance(site, rc.Cloud) else site.points()


def _claim(folder: Path, options: dict[str, Any]) -> None:
    """Claim a folder; where nothing has evolved, as after a refusal, other options make models anew."""
    try:
        claim_folder(folder, MARKER, options, OUTPUTS)
    except RunError as error:
        refuse_foreign_files(folder, MARKER, OUTPUTS)
        if (folder / RUN).exists():
            raise RunError(f"{error}; without {folder / RUN} its models serve another way") from None
        with lock_folder(folder):
            write_json(folder / MARKER, options)


def cover_part(progress: Progress, low: float, high: float, what: str = "") -> Progress:
    """Return a progress that covers a part of another, and says of what."""
    return lambda message, share: progress(what + message, low + (high - low) * share)


def _digest(site: Site) -> str:
    """Return a fingerprint of what was scanned."""
    if isinstance(site, rc.ScanLog):
        arrays = [site.ranges, site.angles, site.poses]
    elif isinstance(site, rc.Cloud):
        arrays = [site.points, *(() if site.viewpoints is None else (site.viewpoints,))]
    else:
        arrays = [np.asarray(site.surface.vertices), np.asarray(site.surface.faces)]
    up = site.up if isinstance(site, rc.Cloud) else getattr(site, "provenance", {}).get("up")
    found = hashlib.sha256(repr(up).encode())
    for array in arrays:
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()


def split_readings(site: rc.ScanLog | rc.Cloud) -> list[Any]:
    """Return two halves that share no reading: scans, or positions of the scanner, alternately; else points."""
    if isinstance(site, rc.ScanLog):
        colors = site.colors
        return [
            site.replace(
                ranges=site.ranges[k::2],
                poses=site.poses[k::2],
                colors=None if colors is None else colors[k::2],
                horizontal=None,
                truth=None,
                slip=None,
            )
            for k in range(2)
        ]
    has_scans = site.seen_from is not None and len(cast(Any, site.viewpoints)) >= _SCANS
    number = cast(np.ndarray, site.seen_from) if has_scans else np.arange(site.num_points)
    return [site.select(number % 2 == k) for k in range(2)]


def find_part(site: Site, ends: Sequence[Place]) -> Place | None:
    """Return the middle of the square of a large site that is used; None where all of it is.

    It is that where most ground was read, or about the ends of a way that it does not hold.
    """
    places = _find_places(site)
    width, depth = np.ptp(places[:, :2], axis=0)
    if isinstance(site, rc.ScanLog) or max(width, depth) <= _SITE:
        return None
    if isinstance(site, sg.Arena):
        places = sample_area(np.asarray(site.surface.vertices), np.asarray(site.surface.faces), _MOST_POINTS)
    middle = _find_ground(places)
    if ends and np.abs(np.subtract(ends, middle)).max() > _SITE / 2 - _RIM:
        middle = np.mean(ends, axis=0)
    text = "of %.0f m x %.0f m the %g m around (%.1f, %.1f) are used%s"
    remedy = "" if ends else "; --start and --goal choose another part"
    logger.warning(text, width, depth, _SITE, *middle, remedy)
    return tuple(np.round(middle, 3).tolist())


def crop_part(site: rc.Cloud, middle: Place | None) -> rc.Cloud:
    """Return the square of a large site about its middle; all where that is None."""
    if middle is None:
        return site
    low, high = site.points.min(axis=0), site.points.max(axis=0)
    low[:2], high[:2] = np.subtract(middle, _SITE / 2), np.add(middle, _SITE / 2)
    part = rc.crop(site, [low, high])
    if part.num_points < _FEWEST:
        raise RunError(
            f"{part.num_points} of {site.num_points} readings lie there, too few for a surface: the scan is too "
            "sparse, or not in meters (--unit, --scale)"
        )
    return part


def scan_mesh(site: sg.Arena, seed: int, part: Place | None = None) -> rc.Cloud:
    """Return exact readings of a surface, with its colors, from over ground on which a Scout can drive, in its part."""
    ground = site.traversability(sg.snake(1))
    places = ground.positions[ground.is_drivable]
    places = places[find_low(places)]
    middle = places[:, :2] if part is None else part
    is_near = np.abs(places[:, :2] - middle).max(axis=1) < _SITE / 2
    places = places[is_near] if is_near.any() else places
    chosen = np.random.default_rng(seed).permutation(len(places))[:_NUM_PLACES]
    viewpoints = places[chosen] + np.array([0.0, 0.0, _EYE])
    num_seen = len(simulate_readings(site.surface, viewpoints, _FIRST)[0])
    num_points = min(_FIRST * _NUM_READINGS // max(num_seen, 1), _MOST_POINTS)
    points, seen_from = simulate_readings(site.surface, viewpoints, num_points)
    colors = None if site.texture is None else np.rint(255 * site.find_colors(points)).astype(np.uint8)
    return rc.Cloud(points, colors, viewpoints=viewpoints, seen_from=seen_from, up=site.provenance.get("up"))


def keep_low(site: rc.Cloud) -> rc.Cloud:
    """Return the readings that a robot on the ground can meet, so that crowns and ceilings take nothing from these."""
    is_low = find_low(site.points)
    if not is_low.all():
        text = "of %d readings %d are left out, more than %g m above the lowest of their square of %g m"
        logger.warning(text, len(is_low), (~is_low).sum(), TALLEST, SQUARE)
    return site.select(is_low)


def _find_ground(points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, " 2"]:
    """Return the middle of the square in which most columns end at the height of two of those beside them [m].

    Of squares with nearly as many it is that nearest to the median of the points.
    """
    median = np.median(points[:, :2], axis=0)
    column = np.floor(points[:, :2] / _COLUMN).astype(np.int64)
    width = np.ptp(column[:, 1]) + 2  # so that the last column of a row has none beside it in the next
    order = np.argsort(points[:, 2], kind="stable")
    number, lowest = np.unique((column @ [width, 1])[order], return_index=True)
    lowest = order[lowest]
    height, num_level = points[lowest, 2], np.zeros(len(number), dtype=np.int64)
    for step in (1, width):
        beside = np.searchsorted(number, number + step).clip(max=len(number) - 1)
        is_level = (number[beside] == number + step) & (np.abs(height[beside] - height) <= _LEVEL)
        num_level[is_level] += 1
        num_level[beside[is_level]] += 1
    ground = column[lowest[num_level >= 2]]
    if not len(ground):
        return median
    part = _SITE / _PARTS
    shifts = np.stack(np.meshgrid(*[np.arange(_PARTS)] * 2), axis=-1).reshape(-1, 2)
    corners = np.floor(ground * (_COLUMN / part)).astype(int)[:, None] - shifts
    squares, count = np.unique(corners.reshape(-1, 2), axis=0, return_counts=True)
    middles = (squares[count >= _MOST * count.max()] + _PARTS / 2) * part
    return middles[np.linalg.norm(middles - median, axis=1).argmin()]


def make_models(
    site: Site,
    folder: Path,
    seed: int,
    progress: Progress = silent,
    ends: Sequence[Place] = (),
    max_pieces: int | None = None,
) -> list[sg.Arena]:
    """Return the models of both halves of a site, or a mesh and the model of a scan of it; kept ones from the folder.

    Of a large site they are of the part that `find_part` finds. The faces of a model
    that the other, or the mesh, does not confirm are `unseen`. A first one that is good for no robot is both.
    """
    folders = [folder / name for name in HALVES]
    part = find_part(site, ends)
    of = f"{_digest(site)} {seed} {part} {max_pieces}"
    if not _is_kept(folders[1], of):
        if isinstance(site, sg.Arena):
            made = [site]
            if site.verdict.answer != "no":
                readings = keep_low(crop_part(scan_mesh(site, seed + 1, part), part))
                making = cover_part(progress, 0.5, 1.0, "scan of it: ")
                again = _make_model(readings, seed + 1, HALVES[1], making, max_pieces)
                made.append(_mark_unconfirmed(again, site))
        else:
            halves = split_readings(keep_low(crop_part(site, part)) if isinstance(site, rc.Cloud) else site)
            made = []
            for k, (half, each) in enumerate(zip(halves, folders, strict=True)):
                if not _is_kept(each, f"half of {of}"):
                    making = cover_part(progress, k / 2, (k + 1) / 2, f"half {k + 1}: ")
                    _keep(_make_model(half, seed + k, HALVES[k], making, max_pieces), each, f"half of {of}")
                made.append(sg.Arena.load(each))
                if made[0].verdict.answer == "no":
                    break
            else:
                made = [_mark_unconfirmed(*pair) for pair in (made, made[::-1])]
        made = [made[0], made[-1]]
        for arena, each in zip(made, folders, strict=True):  # that which is asked for is the last
            _keep(arena, each, of)
    return [sg.Arena.load(each) for each in folders]  # as files keep them: a resumed training reads the same


def _is_kept(folder: Path, of: str) -> bool:
    return (folder / ABOUT).is_file() and sg.Arena.load(folder).provenance.get("models_of") == of


def _keep(arena: sg.Arena, folder: Path, of: str) -> None:
    replace(arena, provenance={**arena.provenance, "models_of": of}).save(folder)


def _make_model(
    half: rc.ScanLog | rc.Cloud, seed: int, name: str, progress: Progress, max_pieces: int | None
) -> sg.Arena:
    readings, points = half, rc.preprocess_cloud(half)
    if isinstance(half, rc.ScanLog):
        readings, points = rc.make_log_cloud(rc.level_floor(half)), rc.thin(points, SPACING)
    made = rc.reconstruct(
        points, readings=cast(rc.Cloud, readings), seed=seed, progress=cover_part(progress, 0.0, 0.4)
    )
    return _make_arena(made, max_pieces, name=name, seed=seed, progress=cover_part(progress, 0.4, 1.0))


def _mark_unconfirmed(arena: sg.Arena, other: sg.Arena) -> sg.Arena:
    """Return an arena whose faces that lie off another model are marked as unseen, too."""
    seen = other.seen_surface
    vertices, faces = np.asarray(seen.vertices, np.float64), np.asarray(seen.faces, np.int64)
    own = np.asarray(arena.surface.vertices, np.float64), np.asarray(arena.surface.faces, np.int64)
    is_off = select_faces(*own, lambda places: find_nearest(places, vertices, faces)[0] > _AGREE)
    return replace(arena, unseen=tuple(sorted({*arena.unseen, *np.flatnonzero(is_off).tolist()})))


def choose_task(
    arenas: list[sg.Arena],
    folder: Path,
    body: Organism | None,
    start: Place | None,
    goal: Place | None,
    seed: int,
    workers: int,
) -> EvolutionConfig:
    """Return the run that learns the site: to follow a way on ground that all models confirm, or to cross a gap."""
    common: dict[str, Any] = {"arena": str((folder / HALVES[0]).resolve()), "seed": seed, "workers": workers}
    common |= {"folder": str(folder / RUN), "generations": GENERATIONS}
    crossing = _find_crossing(arenas, body, start, goal)
    if crossing is not None:
        task = {} if start is None else {"task": "cross_gap", "start": start}
        conditions = {"randomization": _AS_SCANNED, "validation": _CONFIRMED}
        return EvolutionConfig(organism=crossing, **conditions, **task, **common)
    body, is_given = body or sg.snake(1), start is not None and goal is not None
    problem: ValueError | str = "a robot can drive nowhere on ground that both models confirm"
    for way in _list_ways(arenas, body, start, goal, np.random.default_rng(seed)):
        task = {"task": "reach", "track_control": "skid", **way}
        try:
            easy = [_arrives_straight(arena, organism=body, **task) for arena in arenas]
        except ValueError as error:
            problem = error
            continue
        if is_given or not any(easy):
            common |= {"controller": "posture", "randomization": _LOCALIZED, "sigma": _SIGMA}
            return EvolutionConfig(organism=body, **task, **common)
        problem = "who drives straight on arrives"
    remedy = "check scale and axis, choose other places, or scan more ground"
    raise RunError(f"no way in {folder / HALVES[0]}, as symbrion view shows it: {problem}; {remedy}")


def _arrives_straight(arena: sg.Arena, **task: Any) -> bool:
    """Return whether a body that drives straight on arrives in one of a few trials."""
    environment = sg.OrganismEnv(arena=arena, randomize=_VARIED, **task)
    for seed in range(_NUM_STRAIGHT):
        environment.reset(seed=seed)
        terminated = truncated = False
        while not (terminated or truncated):
            _, _, terminated, truncated, info = environment.step(cast(Any, environment.action_space).high)
            if info["success"]:
                return True
    return False


def _find_crossing(
    arenas: list[sg.Arena], body: Organism | None, start: Place | None, goal: Place | None
) -> Organism | None:
    """Return the row that crosses the gap that the site asks to be crossed; None where it asks for none.

    It does where no ground leads a Scout from the start to the goal, or where a row is given and no place.
    """
    if body is None and start is not None and goal is not None:
        row, ahead = sg.snake(_MODULES[1]), np.subtract(goal, start)
        try:
            arenas[0].find_route(start=start, goal=goal)
            return None
        except sg.ArenaError as no_way:
            try:
                gap = find_gap(arenas[0], row, ahead / np.linalg.norm(ahead), np.array(start, float))
            except (sg.TaskError, sg.ArenaError):
                raise RunError(f"{no_way}; nor is there a gap to be crossed") from None
        modules = np.ceil(_REACH * (gap.far - gap.near) / row.scout.pitch) + 1
        return sg.snake(int(np.clip(modules, *_MODULES)))
    if body is None or body.num_modules == 1 or start is not None or goal is not None:
        return None
    with suppress(sg.TaskError, sg.ArenaError):
        for arena in arenas:
            find_gap(arena, body)
        return body
    return None


def _list_ways(
    arenas: list[sg.Arena], body: Organism, start: Place | None, goal: Place | None, rng: np.random.Generator
) -> Iterator[dict[str, Any]]:
    """Yield ways with a corner between places that all models confirm; or the way that is given.

    The first leads over the least ground that they do not confirm; of those, over the most level, and far.

    A way has a `start`, a `goal`, and `places` to be reached before the goal.
    """
    if start is not None and goal is not None:
        for corners in _list_corners(arenas, body, start, goal) or [()]:  # of none the environment says why
            yield {"start": start, "goal": goal, "places": corners}
        return
    near = goal if start is None else start
    for room in _ROOMS:
        yield from _draw_ways(*_find_confirmed(arenas, body, near, room), start, goal, rng)


def _draw_ways(
    places: Float[np.ndarray, "N 3"],
    lean: Float[np.ndarray, " N"],
    start: Place | None,
    goal: Place | None,
    rng: np.random.Generator,
) -> Iterator[dict[str, Any]]:
    """Yield ways between some of the places, the best first; `lean` is the slope there [rad]."""
    if not len(places):
        return
    known, legs = (start, _LEGS) if goal is None else (goal, _LEGS[::-1])
    corners = [rng.integers(len(places), size=_NUM_WAYS)]
    line = [places[corners[0], :2] if known is None else np.array([known[:2]] * _NUM_WAYS)]
    heading = rng.uniform(-np.pi, np.pi, _NUM_WAYS)
    turned = heading + rng.choice([-1.0, 1.0], _NUM_WAYS) * rng.uniform(_TURN[0], _TURN[1], _NUM_WAYS)
    doubtful, steepest, is_good = np.zeros(_NUM_WAYS, int), np.zeros(_NUM_WAYS), np.ones(_NUM_WAYS, bool)
    tree, shares = cKDTree(places[:, :2]), np.linspace(0.0, 1.0, _NUM_CHECKED)[:, None]
    lengths = np.zeros(_NUM_WAYS)
    for limits, angle in zip(legs, (heading, turned), strict=True):
        length = rng.uniform(*limits, _NUM_WAYS)
        ahead = length[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        away, nearest = tree.query(line[-1][:, None] + shares * ahead[:, None])
        is_good &= away[:, -1] <= _SNAP
        doubtful += (away > _SNAP).sum(axis=1)
        steepest = np.maximum(steepest, lean[nearest].max(axis=1))
        lengths += length
        corners.append(nearest[:, -1])
        line.append(places[corners[-1], :2])
    level = np.ceil(steepest / _EQUALLY)
    best = np.lexsort([-lengths, level, doubtful, ~is_good])[: min(_NUM_TRIED, is_good.sum())]
    for row in best:
        way = [tuple(np.round(places[corner[row]], 3).tolist()) for corner in corners]
        first, middle, last = [known or way[0], *way[1:]][:: 1 if goal is None else -1]
        yield {"start": first, "goal": last, "places": (middle,)}


def _list_corners(
    arenas: list[sg.Arena], body: Organism, start: Place, goal: Place
) -> list[tuple[tuple[float, float], ...]]:
    """Return the corners of the path that each model has, those first with which all models have the same."""
    found, begin = [], Start(tuple(start))
    for arena in arenas:
        with suppress(sg.ArenaError):
            path = find_path(arena, body, begin, (tuple(goal),))
            corners = tuple((round(x, 3), round(y, 3)) for x, y in path.corners[:-1])
            paths = [find_path(each, body, begin, (*corners, tuple(goal))) for each in arenas]
            found.append((sum(len(each.corners) for each in paths) - len(arenas) * len(corners), corners))
    return [corners for _, corners in sorted(found)]


def _find_confirmed(
    arenas: list[sg.Arena], body: Organism, near: Place | None, room: float
) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, " N"]]:
    """Return places with room around them, so many times what the body needs, of the largest or nearest region of all.

    With each goes the slope of the ground in the model in which it is steeper [rad].
    """
    grounds = [arena.traversability(body) for arena in arenas]
    first = grounds[0]
    is_low = find_low(first.positions)  # no roof
    chosen: Int[np.ndarray, " N"] = np.flatnonzero(is_low & first.is_drivable)
    slope, away, region = np.nan_to_num(first.slope), first.wall_distance.copy(), first.region.copy()
    for ground in grounds[1:]:
        places = first.positions[chosen]
        found = ground.sorted_heights.find_nearest(ground.grid.compute_cells(places[:, :2]), places[:, 2])
        chosen, found = chosen[found >= 0], found[found >= 0]
        is_there = np.abs(ground.height[found] - first.positions[chosen, 2]) <= 2 * _AGREE
        is_there &= ground.is_drivable[found]
        chosen, found = chosen[is_there], found[is_there]
        slope[chosen] = np.fmax(slope[chosen], ground.slope[found])
        away[chosen] = np.minimum(away[chosen], ground.wall_distance[found])
        pairs = region[chosen] * ground.num_regions + ground.region[found]  # connected in all of them
        region[chosen] = pairs
    chosen = chosen[away[chosen] >= room * first.footprint.reach]
    if not len(chosen):
        return first.positions[chosen], slope[chosen]
    region = region[chosen]
    if near is None:
        wanted = np.bincount(region).argmax()
    else:
        wanted = region[np.linalg.norm(first.positions[chosen, :2] - near, axis=1).argmin()]
    chosen = chosen[region == wanted]
    return first.positions[chosen], slope[chosen]


def judge_in(arena: sg.Arena, run: Run, seed: int, workers: int) -> dict[str, int]:
    """Return how often the champion, a robot that does nothing and one that drives straight on hold in an arena."""
    champion, randomization = run.champion, replace(run.config.randomization, stretch=(1.0,))
    if champion is None:
        raise RunError(f"{run.folder}: no genotype could be tried; give another --start and --goal")
    straight = dict.fromkeys(champion.names, 0.0)
    drivers = {"champion": champion.genotype, "tracks forward": tuple(straight.values())}
    if "track_speed_change" in straight:
        drivers["doing nothing"] = tuple((straight | {"track_speed_change": -1.0}).values())
    return {
        name: judge(
            replace(champion, genotype=genotype),
            arena,
            TRIALS,
            seed,
            randomization=randomization,
            workers=workers,
        ).successes
        for name, genotype in drivers.items()
    }
