"""`symbrion evolve --bodies`: search for a body, each of which learns its controller."""

from __future__ import annotations

import dataclasses
import re
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import evolution as ev
from evolution._src.backends.cluster import EXACT_BACKENDS
from evolution._src.cli.command import UsageError
from evolution._src.cli.console import Console
from evolution._src.errors import RunError
from evolution._src.references import MAX_MODULES
from evolution._src.search.bodies.run import BodyRun, describe_success, format_fitness, list_once
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.extras import find_missing
from reconstruction._src.base.range_checks import format_count

PICTURE = "bodies.png"  # Of the fittest bodies, in the run folder
MAX_DRAWN = 24
_MORE = 2  # A search is proposed to go on to this many times what it has done


def make_bodies_config(
    fields: Mapping[str, Any],
    *,
    bodies: tuple[int, ...],
    algorithm: str,
    iterations: int | None,
    children: int | None,
) -> ev.BodyEvolutionConfig:
    """Return the configuration of the options of `symbrion evolve --bodies`."""
    smallest, largest = _read_sizes(bodies)
    if fields["backend"] not in EXACT_BACKENDS:
        raise UsageError(f"--backend {fields['backend']}: --bodies needs one of {', '.join(EXACT_BACKENDS)}")
    environment = dict(fields["environment"])
    if smallest == 1:
        environment = {"track_control": "skid"} | environment
    values = dict(fields) | {
        "environment": environment,
    }
    if iterations is not None:
        values["iterations"] = iterations
    sizes: dict[str, Any] = {"smallest": smallest, "largest": largest, "algorithm": algorithm}
    if children is not None:  # the first iteration is no longer than others
        sizes |= {"children": children, "population_size": children}
    try:
        return ev.BodyEvolutionConfig(**values, bodies=ev.BodiesConfig(**sizes))
    except RunError as error:
        raise UsageError(name_flag(str(error), values | sizes)) from error


def name_flag(message: str, fields: Mapping[str, Any]) -> str:
    """Return the message of a configuration with the flag and its value first."""
    name = re.match(r"\w+", message)
    if name is None or not isinstance(fields.get(name[0]), str | int | float | tuple):
        return message
    given = fields[name[0]]
    text = " ".join(map(str, given)) if isinstance(given, tuple) else str(given)
    return f"--{name[0].replace('_', '-')} {text}: {message}"


def _read_sizes(bodies: tuple[int, ...]) -> tuple[int, int]:
    """Return the smallest and the largest number of modules."""
    if len(bodies) not in (1, 2) or not 1 <= bodies[0] <= bodies[-1] <= MAX_MODULES:
        raise UsageError(
            f"--bodies {' '.join(map(str, bodies))}: give the smallest and the largest number of modules, 1 to "
            f"{MAX_MODULES}, for example --bodies 1 8; or one number for both"
        )
    return bodies[0], bodies[-1]


def run_bodies(config: ev.BodyEvolutionConfig, console: Console) -> dict[str, Any]:
    """Search for bodies, confirm the champion, and return a summary."""
    title = (
        f"Bodies of {config.bodies.smallest} to {config.bodies.largest} modules, {config.bodies.algorithm}"
    )
    with console.track(title) as step:
        run = ev.evolve_bodies(config, progress=step.progress)
    return report_bodies(_confirm(run, console), console)


def resume_run_of_bodies(folder: Path, changes: Mapping[str, Any], console: Console) -> dict[str, Any]:
    """Continue a search for bodies, confirm the champion, and return a summary."""
    own = {"iterations" if name == "generations" else name: value for name, value in changes.items()}
    with console.track(f"Bodies in {folder}") as step:
        run = ev.resume_bodies(folder, progress=step.progress, **own)
    return report_bodies(_confirm(run, console), console)


def _confirm(run: BodyRun, console: Console) -> BodyRun:
    """Try the fittest bodies again, and return the run with what is known of them then."""
    if run.folder is None or run.best is None or run.confirmation is not None:
        return run
    with console.track("Fresh trials of the fittest bodies") as step:
        confirmation = ev.confirm(run, progress=step.progress)
    return dataclasses.replace(run, champion=confirmation.champion, confirmation=confirmation)


def describe_stop(run: BodyRun) -> str:
    """Return in one line what has stopped a search, and the command that goes on."""
    if not run.has_all_iterations:
        return "every body has learned to the end: nothing is left to be tried"
    more = max(_MORE * len(run.history), 1)
    return (
        f"stopped by --generations {run.config.iterations}; to go on: symbrion resume {shlex.quote(str(run.folder))} "
        f"--generations {more}"
    )


def report_bodies(run: BodyRun, console: Console) -> dict[str, Any]:
    """Print the results of a search for bodies, and return them as a summary."""
    results, confirmation = run.results, run.confirmation
    best = run.best if confirmation is None else confirmation.result
    summary: dict[str, Any] = {
        "folder": run.folder,
        "iterations": len(run.history),
        "bodies": len({result.body.canonical_text for result in results}),
        "simulated_seconds": run.seconds,
        "fresh_seconds": 0.0 if confirmation is None else confirmation.seconds,
        "champion": run.champion.as_dict() if run.champion else None,
    }
    console.print_line(
        f"{format_count(summary['iterations'], 'iteration')}, {format_count(summary['bodies'], 'body', 'bodies')}, "
        f"{run.seconds:.0f} s simulated in {run.folder}"
        + ("" if confirmation is None else f", and {confirmation.seconds:.0f} s in fresh trials")
    )
    if best is not None:
        modules = format_count(best.body.num_modules, "module")
        summary["plan"] = best.body.to_plan()
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
    from evolution._src.report.figures import draw_bodies, to_png

    best = sorted(run.results, key=lambda each: (each.level, each.fitness), reverse=True)
    shown = list_once(best)[:MAX_DRAWN]
    figure = draw_bodies([each.body for each in shown], [format_fitness(run, each.fitness) for each in shown])
    with write_atomically(path) as temporary:
        temporary.write_bytes(to_png(figure))
