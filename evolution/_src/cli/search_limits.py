"""The limits of a search for bodies in words: which of them stopped it, how to go on, what an iteration can take."""

from __future__ import annotations

import logging
import math
import shlex
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, cast

import evolution as ev
import reconstruction as rc
import symbrion_gym as sg
from evolution._src.bodies.genome import BodyGenome, make_row
from reconstruction._src.base.range_checks import format_count, format_distance, format_share
from symbrion_gym._src.assets import NAMED_ARENAS
from symbrion_gym._src.errors import ArenaError

if TYPE_CHECKING:
    import evolution as ev
    import symbrion_gym as sg
    from evolution._src.body_search.run import BodyRun
    from symbrion_gym._src.arenas.scan_quality import AccuracyReport
    from symbrion_gym._src.robot.organism import Organism
    from symbrion_gym._src.tasks.drivable_way import Pair
    from symbrion_gym._src.tasks.route import StartName

logger = logging.getLogger(__name__)
_MORE = 2
"""A search is proposed to go on to this many times what it has done."""


def find_stops(run: BodyRun) -> list[str]:
    """Return the options whose limits have stopped a search for bodies; none where nothing is left to be tried."""
    stops = []
    if run.has_all_iterations:
        stops.append(f"--generations {run.config.iterations}")
    if run.is_spent:
        stops.append(f"--max-seconds {run.config.max_seconds:g}")
    return stops


def describe_stop(run: BodyRun) -> str:
    """Return in one line which limits have stopped a search, and the command that goes on."""
    stops = find_stops(run)
    if not stops:
        return "every body has learned to the end: nothing is left to be tried"
    return f"stopped by {' and '.join(stops)}; to go on: {name_resume(run)}"


def name_resume(run: BodyRun) -> str:
    """Return the command that continues a stopped search: it raises each limit that stands in the way."""
    command = f"symbrion resume {shlex.quote(str(run.folder))}"
    if run.has_all_iterations:
        command += f" --generations {max(_MORE * len(run.history), 1)}"
    if run.is_spent:
        command += f" --max-seconds {max(ceil(_MORE * run.history[-1][0]), 1)}"
    return command


def describe_interruption(folder: Path) -> str:
    """Return how an interrupted run goes on; empty where it has not begun."""
    if not (folder / "config.json").is_file():
        return ""
    return f"all but what was unfinished is stored; to go on: symbrion resume {shlex.quote(str(folder))}"


def find_longest_iteration(config: ev.BodyEvolutionConfig) -> tuple[int, int, float]:
    """Return the bodies and the trials of the first iteration, and the longest time that a trial can take [s]."""
    from evolution._src.body_search.algorithms import make_algorithm
    from symbrion_gym._src.environment.config import EnvironmentConfig

    assignments = make_algorithm(config).ask()
    trials = sum(
        config.learning.count_trials(level) for each in assignments for level in range(each.level + 1)
    )
    longest = EnvironmentConfig.from_options(config.make_options()).find_task().duration
    return len(assignments), trials, longest


def warn_of_limit(config: ev.BodyEvolutionConfig) -> None:
    """Log one line if an iteration, which is always finished, can take more simulated time than a search may."""
    limit = config.max_seconds
    if limit is None:
        return
    bodies, trials, longest = find_longest_iteration(config)
    if trials * longest > limit:
        logger.warning(
            "--max-seconds %g may be exceeded: an iteration is always finished, and the first one has %d trials of %s, "
            "up to %g s each, %g s in all; for shorter ones give --population %d, or --environment duration %g",
            *(limit, trials, format_count(bodies, "body", "bodies"), longest, trials * longest),
            *(max(config.bodies.children // 3, 1), ceil(longest / 4)),
        )


TASK = "traverse"
"""The task whose way is to be drivable: of others, such as climb and cross_gap, crossing is the point."""


def warn_of_way(
    config: ev.EvolutionConfig | ev.BodyEvolutionConfig, smallest: Organism, largest: Organism
) -> None:
    """Log one line if the way of a search over a scan leaves drivable ground; a task that fails says so itself."""
    if config.task != TASK or not isinstance(config.arena, str) or config.arena in NAMED_ARENAS:
        return
    import symbrion_gym as sg
    from evolution._src.backends.trials import prepare_arena
    from symbrion_gym._src.tasks.drivable_way import find_broken_traverse, propose_way

    arena, goal = prepare_arena(config.arena), config.goal
    assert isinstance(arena, sg.Arena)
    if isinstance(goal, str):  # a known object
        return
    start = cast("StartName", config.start or "floor")
    bodies = format_count(largest.num_modules, "module")
    try:
        way = find_broken_traverse(arena, smallest, largest, start, goal)
    except ArenaError:
        return
    if way is None and isinstance(config, ev.BodyEvolutionConfig) and goal is None and isinstance(start, str):
        refused, other = _find_refused(arena, largest.num_modules), propose_way(arena, largest)
        if refused is not None and other is not None:
            logger.warning("bodies that are too wide count as failed: %s; %s", refused, _name_way(other))
    if way is None:
        return
    if smallest.num_modules < largest.num_modules:
        bodies = f"bodies of {smallest.num_modules} to {bodies}"
    remedy = (
        f"`symbrion view {config.arena}` shows where to drive" if way.other is None else _name_way(way.other)
    )
    logger.warning(
        "the way of --task %s, from %s to %s, leaves the ground on which %s are known to drive (steps, slopes, gaps): "
        "many fail there, perhaps all; %s",
        *(TASK, way.start, way.finish, bodies, remedy),
    )


def _find_refused(arena: sg.Arena, modules: int) -> str | None:
    """Return why the task cannot be made for the widest body, modules side by side; None where it can.

    Where no way is open each body takes one on the ground that it can drive on, which is the less the wider it is.
    """
    from symbrion_gym._src.tasks.starts import Start
    from symbrion_gym._src.tasks.traverse import FarEnd

    widest = make_row(1) if modules == 1 else BodyGenome(left=make_row(modules - 1))
    try:
        FarEnd().find(arena, widest.to_organism(), Start())
    except ArenaError as error:
        return str(error)
    return None


def _name_way(way: Pair) -> str:
    """Return the options of a way."""
    start, goal = (" ".join(f"{value:g}" for value in place) for place in way)
    return f"a straight way that can be driven, in place of --task {TASK}: --start {start} --goal {goal}"


def make_quality_rows(arena: sg.Arena, report: AccuracyReport) -> list[list[object]]:
    """Return measure and value of what is known about the contact geometry of an arena."""
    quality, wanted_pieces = arena.quality, arena.provenance.get("options", {}).get("max_pieces")
    pieces = f"{quality.num_pieces}" + (f" of at most {wanted_pieces}" if wanted_pieces else "")
    rows: list[tuple[str, str | None]] = [
        ("accuracy wanted", _distance(report.wanted)),
        ("accuracy reached", f"{_distance(report.reached)}{'' if report.is_reached else ' (missed)'}"),
        ("surface to contact: 95 %", _distance(quality.p95)),
        ("surface to contact: largest", _distance(quality.max)),
        ("surface without contact", _share(quality.uncovered)),
        ("contact to surface: mean", _distance(quality.protrusion_mean)),
        ("contact to surface: 95 %", _distance(quality.protrusion_p95)),
        ("contact to surface: largest", _distance(quality.protrusion_max)),
        ("beams that end at their reading: contact", _share(quality.beams_contact)),
        ("beams that end at their reading: surface", _share(quality.beams_surface)),
        ("free space seen that is solid", _share(quality.free_space)),
        ("readings dropped by pre-processing", _share(quality.dropped)),
        ("pieces", pieces if arena.height_field is None else "none: a height field"),
        ("time to build", f"{quality.seconds:.1f} s"),
    ]
    return [[name, value] for name, value in rows if value is not None]


def make_surface_rows(quality: rc.Quality) -> list[list[object]]:
    """Return measure and value of what is known about a reconstructed surface."""
    topology = quality.topology
    rows: list[list[object]] = [
        ["vertices, faces", f"{topology.num_vertices}, {topology.num_faces}"],
        ["area", f"{quality.area:.4g} m²"],
        ["parts", topology.components],
        ["boundary loops", topology.boundary_loops],
        [
            "non manifold edges, pinched vertices",
            f"{topology.non_manifold_edges}, {topology.pinched_vertices}",
        ],
        ["self intersections, folds", f"{quality.self_intersections}, {quality.folds}"],
        ["smallest angle of a face: mean", f"{math.degrees(quality.min_angle):.1f}°"],
        ["faces with an angle below 10°", format_share(quality.slivers)],
    ]
    for name, distances in (
        ("cloud to mesh", quality.cloud_to_mesh),
        ("truth to mesh", quality.truth_to_mesh),
        ("mesh to truth", quality.mesh_to_truth),
    ):
        if distances is not None:
            values = (distances.mean, distances.p95, distances.max)
            rows.append([f"{name}: mean, p95, max", ", ".join(format_distance(value) for value in values)])
    return rows


def _distance(distance: float | None) -> str | None:
    return None if distance is None else format_distance(distance)


def _share(share: float | None) -> str | None:
    return None if share is None else format_share(share)
