"""`symbrion evolve --bodies`: search for a body, each of which learns its controller."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import evolution as ev
from evolution._src.backends.making import EXACT_BACKENDS
from evolution._src.body_search.description import describe_success, format_fitness
from evolution._src.cli.command import UsageError
from evolution._src.cli.config_options import name_flag
from evolution._src.cli.console import Console
from evolution._src.cli.search_limits import describe_stop, find_stops
from evolution._src.errors import RunError
from evolution._src.limits import MAX_MODULES
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.extras import find_missing
from reconstruction._src.base.quantities import format_count

if TYPE_CHECKING:
    from evolution._src.body_search.learning import Lesson
    from evolution._src.body_search.run import BodyRun

DEFAULT_CONTROLLER = "oscillators"
"""The law of bodies of any shape, unless another is named."""
_PART_NAMES = ("episode", "control", "trial", "execution")
PICTURE = "bodies.png"
"""The fittest bodies, in the run folder."""
MAX_DRAWN = 24
_OTHER_PARTS = ("body", "search")
"""Options that are those of one body alone."""


def make_bodies_config(fields: Mapping[str, Any], parts: Mapping[str, Any]) -> ev.BodyEvolutionConfig:
    """Return the configuration of the options of `symbrion evolve --bodies`.

    Args:
        fields: `bodies` (smallest and largest number of modules, or the one number of all), `algorithm`,
            `children`, `max_seconds`, `dofs`, `arena`, `seed`, `scoring` and `environment` as they are given.
        parts: the options by the name of their part.

    Raises:
        UsageError: a value is refused, or an option is given that has no meaning where bodies are searched.
    """
    for name in _OTHER_PARTS:
        _refuse_changes(parts[name])
    own = {
        name: getattr(part, name)
        for part in (parts[each] for each in _PART_NAMES)
        for name in _list_names(part)
    }
    own["iterations"] = own.pop("generations")
    del own["stop_when_solved"]
    if own["controller"] == type(parts["control"])().controller:
        own["controller"] = DEFAULT_CONTROLLER
    smallest, largest = _read_sizes(fields["bodies"])
    if parts["execution"].backend not in EXACT_BACKENDS:
        raise UsageError(
            f"--backend {parts['execution'].backend}: --bodies needs one of {', '.join(EXACT_BACKENDS)}"
        )
    environment = dict(fields["environment"])
    if smallest == 1:
        environment = {"track_control": "skid"} | environment
    values = own | {
        "environment": environment,
        "arena": fields["arena"],
        "seed": fields["seed"],
        "smallest": smallest,
        "largest": largest,
        "algorithm": fields["algorithm"],
        "children": fields["children"],
        "population_size": fields["children"],  # the first iteration is no longer than the others
        "max_seconds": None if fields["max_seconds"] == "unlimited" else fields["max_seconds"],
        "dofs": fields["dofs"],
    }
    if fields["scoring"] is not None:
        values["scoring"] = fields["scoring"]
    try:
        return ev.BodyEvolutionConfig(**values)
    except RunError as error:
        raise UsageError(name_flag(str(error), values)) from error


def _read_sizes(bodies: tuple[int, ...]) -> tuple[int, int]:
    """Return the smallest and the largest number of modules.

    Raises:
        UsageError: there are more than two numbers, or they are out of range.
    """
    if len(bodies) not in (1, 2) or not 1 <= bodies[0] <= bodies[-1] <= MAX_MODULES:
        raise UsageError(
            f"--bodies {' '.join(map(str, bodies))}: give the smallest and the largest number of modules, 1 to "
            f"{MAX_MODULES}, for example --bodies 1 8; or one number for both"
        )
    return bodies[0], bodies[-1]


def run_bodies(config: ev.BodyEvolutionConfig, console: Console, confirm: bool = True) -> dict[str, Any]:
    """Search for bodies, confirm the champion if wanted, and return a summary."""
    title = (
        f"Bodies of {config.bodies.smallest} to {config.bodies.largest} modules, {config.bodies.algorithm}"
    )
    with console.track(title) as step:
        run = ev.evolve_bodies(config, progress=step.progress)
    return report_bodies(_confirm(run, console) if confirm else run, console)


def resume_run_of_bodies(
    folder: Path, changes: Mapping[str, Any], console: Console, confirm: bool = True
) -> dict[str, Any]:
    """Continue a search for bodies, confirm the champion if wanted, and return a summary."""
    own = {"iterations" if name == "generations" else name: value for name, value in changes.items()}
    with console.track(f"Bodies in {folder}") as step:
        run = ev.resume_bodies(folder, progress=step.progress, **own)
    return report_bodies(_confirm(run, console) if confirm else run, console)


def _confirm(run: BodyRun, console: Console) -> BodyRun:
    """Try the fittest bodies again, and return the run with what is known of them then."""
    from evolution._src.body_search.confirmation import CANDIDATES
    from evolution._src.body_search.run import read_fresh_trials

    if run.folder is None or run.best is None:
        return run
    with console.track(f"Fresh trials of the fittest bodies, {CANDIDATES} at most") as step:
        ev.confirm(run, CANDIDATES, progress=step.progress)
    return dataclasses.replace(run, fresh=read_fresh_trials(run.folder, run.config))


def report_bodies(run: BodyRun, console: Console) -> dict[str, Any]:
    """Print the results of a search for bodies, and return them as a summary."""
    lessons, confirmation = run.record.lessons, run.confirmation
    best = run.best if confirmation is None else confirmation.lesson
    summary: dict[str, Any] = {
        "folder": run.folder,
        "iterations": len(run.history),
        "bodies": len({lesson.pupil.key for lesson in lessons}),
        "simulated_seconds": run.record.seconds,
        "fresh_seconds": 0.0 if confirmation is None else confirmation.seconds,
        "stopped_by": find_stops(run),
        "champion": run.champion.as_dict() if run.champion else None,
    }
    console.print_line(
        f"{format_count(summary['iterations'], 'iteration')}, {format_count(summary['bodies'], 'body', 'bodies')}, "
        f"{run.record.seconds:.0f} s simulated in {run.folder}"
        + ("" if confirmation is None else f", and {confirmation.seconds:.0f} s in fresh trials")
    )
    if best is not None:
        modules = format_count(best.pupil.body.num_modules, "module")
        summary["plan"] = best.pupil.body.to_plan()
        summary["confirmed"] = confirmation is not None
        console.print_line(f"best body, {modules}, {summary['plan']}: {describe_success(run)}")
        if run.folder is not None and not find_missing("report"):
            _draw_best(run, run.folder / PICTURE)
            console.print_line(f"the best bodies: {run.folder / PICTURE}")
    console.print_line(describe_stop(run))
    if run.champion is not None:
        if not run.champion.successes:
            console.print_line("more learning may help, by that command; or an easier way (--start, --goal)")
        console.print_line(f"next: symbrion replay {run.folder} --video champion.mp4")
    return summary


def _draw_best(run: BodyRun, path: Path) -> None:
    """Draw the fittest bodies with their fitness."""
    from evolution._src.report.bodies import draw_bodies
    from evolution._src.report.pictures import to_png

    best: dict[str, Lesson] = {}
    for lesson in sorted(run.record.lessons, key=lambda each: (each.rung, each.fitness), reverse=True):
        best.setdefault(lesson.pupil.body.canonical_text, lesson)
    shown = list(best.values())[:MAX_DRAWN]
    figure = draw_bodies(
        [each.pupil.body for each in shown], [format_fitness(run, each.fitness) for each in shown]
    )
    with write_atomically(path) as temporary:
        temporary.write_bytes(to_png(figure))


def _refuse_changes(options: Any) -> None:
    """Refuse options of a part that are not its defaults."""
    for each in dataclasses.fields(options):
        value = getattr(options, each.name)
        if value != each.default:
            flag = f"--{each.name.replace('_', '-')}"
            raise UsageError(
                f"{flag} {value}: an option of one body, and --bodies searches for bodies; leave out one of them"
            )


def _list_names(options: Any) -> list[str]:
    return [each.name for each in dataclasses.fields(options)]
