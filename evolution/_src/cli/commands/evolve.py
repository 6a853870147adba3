"""`symbrion evolve` and `symbrion resume`: search for a controller that does a task, or for a body."""

import dataclasses
import json
import logging
import os
import shlex
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

import evolution as ev
from evolution._src.backends.cluster import BACKENDS
from evolution._src.cli.command import (
    SeededCommand,
    TrustingCommand,
    UsageError,
    check_arena,
    find_modules_here,
    require_writable_folder,
)
from evolution._src.cli.console import Console
from evolution._src.search.bodies.config import ALGORITHMS
from evolution._src.search.bodies.run import BodyRun, describe_success, list_once
from evolution._src.search.run import RunFolder
from reconstruction._src.base.range_checks import format_count
from symbrion_gym._src.environment.config import STARTS

Place = tuple[float, float]  # x and y [m]
logger = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Evolve(SeededCommand):
    """Evolve the controller of a body of docked robots with CMA-ES, or bodies; an interrupted run can be resumed.

    What else a run can be told (scoring, validation, randomization, restarts) are fields of `ev.EvolutionConfig`.

    Example: symbrion evolve --arena gsrm --folder runs/a

    Example: symbrion evolve --arena arenas/mine --start 0 0 --goal 3 1 --folder runs/mine

    Example: symbrion evolve --arena arenas/mine --task traverse --bodies 1 8 --folder runs/bodies

    Example: symbrion evolve --arena truth --organism cross --task cross_gap --controller oscillators --folder runs/b
    """

    arena: str = "gsrm"
    """A named arena (truth, simple, gsrm, gg, stairs), an arena folder, or a file that `symbrion arena` takes."""
    modules: int | None = None
    """Number of modules of the snake. Default: 8."""
    organism: str | None = None
    """The body in place of --modules: a body plan, the name of a shape (cross, H), or a file of one."""
    task: str | None = None
    """What to do: cross_gap, climb, traverse or reach, or "module:name" of a task of yours."""
    start: Literal[STARTS] | Place | None = None  # pyright: ignore[reportInvalidTypeForm]
    """Where a trial begins: a name, or X Y [m]."""
    goal: Place | str | None = None
    """Where it ends: X Y [m], or the name of a known object."""
    environment: Annotated[tuple[tuple[str, str], ...], tyro.conf.arg(metavar="NAME VALUE ...")] = ()
    """Options of the environment, such as pit 0.35 or duration 30."""
    controller: str | None = None
    """Control law (reactive, path, oscillators, posture), or "module:name" of one of yours."""
    fitness: str | None = None
    """The scoring, "module:name" of a function of (outcome, body)."""
    bodies: Annotated[tuple[int, ...] | None, tyro.conf.arg(metavar="MIN MAX")] = None
    """Search for bodies of this many modules at least and at most (one number: both); each learns its controller."""
    algorithm: Literal[ALGORITHMS] = ev.BodiesConfig.algorithm  # pyright: ignore[reportInvalidTypeForm]
    """How --bodies are searched."""
    population_size: int | None = None
    """Genotypes of a generation, or new bodies of an iteration of --bodies. Default: 12, or 9 bodies."""
    trials: int | None = None
    """Trials of each genotype of one body. Default: 3."""
    generations: int | None = None
    """Limit on the generations, or on the iterations of --bodies. Default: 50; 20 with --bodies."""
    workers: int = os.cpu_count() or 1
    """Threads, processes or tasks; the results do not depend on their number."""
    backend: Literal[BACKENDS] = "batch"  # pyright: ignore[reportInvalidTypeForm]
    """Where simulations run: threads (batch), processes, a Ray cluster, or a GPU (warp)."""
    address: str | None = None
    """Address of an existing Ray cluster."""
    folder: Path = Path("runs/latest")
    """The run folder."""

    def check(self) -> None:
        super().check()
        find_modules_here(*(each for each in (self.task, self.controller, self.fitness) if ":" in str(each)))
        check_arena(self.arena)
        self.require_least(generations=1)
        require_writable_folder(self.folder, "--folder")
        if isinstance(self.goal, str) and not self.goal.strip("+-.0123456789"):
            raise UsageError(f"--goal {self.goal}: a known object is a name, a place is `FLOAT FLOAT`")
        self.make_config()

    def explain_interruption(self) -> str:
        return propose_resume(self.folder)

    def make_config(self) -> "ev.EvolutionConfig | ev.BodyEvolutionConfig":
        """Return the configuration of the run."""
        names = ("arena", "seed", "task", "start", "goal", "controller", "workers", "backend", "address")
        fields: dict[str, Any] = {name: getattr(self, name) for name in names}
        fields |= {"scoring": self.fitness, "folder": str(self.folder)}
        fields["environment"] = {name: _read_value(text) for name, text in self.environment}
        own = {"modules": self.modules, "organism": self.organism, "trials": self.trials}
        if self.bodies is None:
            if self.algorithm != ev.BodiesConfig.algorithm:
                raise UsageError("--algorithm is of a search for bodies; give --bodies MIN MAX")
            fields |= own | {"population_size": self.population_size, "generations": self.generations}
            return ev.EvolutionConfig(**_drop_absent(fields))
        given = next(iter(_drop_absent(own)), None)
        if given:
            raise UsageError(
                f"--{given} is of one body, and --bodies searches for bodies; leave out one of them"
            )
        if len(self.bodies) not in (1, 2):
            raise UsageError("--bodies: give MIN MAX, for example --bodies 1 8; or one number for both")
        sizes = {"smallest": self.bodies[0], "largest": self.bodies[-1], "algorithm": self.algorithm}
        # the first iteration is no longer than others
        sizes |= {"children": self.population_size, "population_size": self.population_size}
        fields |= {"bodies": ev.BodiesConfig(**_drop_absent(sizes)), "iterations": self.generations}
        if self.bodies[0] == 1:
            fields["environment"] = {"track_control": "skid"} | fields["environment"]
        return ev.BodyEvolutionConfig(**_drop_absent(fields))

    def run(self, console: Console) -> dict[str, Any]:
        config = self.make_config()
        with console.track(f"Evolution in {self.arena}") as step:
            run = ev.evolve(config, progress=step.progress)
        return report_run(run, console)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Resume(TrustingCommand):
    """Continue a run; the history is bit-identical to that of a run that was never interrupted.

    Example: symbrion resume runs/a --generations 100
    """

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER")]
    """The run folder."""
    generations: int | None = None
    """New limit on the generations, or on the iterations of a search for bodies. Default: as recorded."""
    workers: int = os.cpu_count() or 1
    """Threads or processes; the results do not depend on their number."""
    backend: Literal[BACKENDS] | None = None  # pyright: ignore[reportInvalidTypeForm]
    """Where simulations run: threads (batch), processes, a Ray cluster, or a GPU (warp). Default: as recorded."""

    def check(self) -> None:
        super().check()
        require_run(self.folder)

    def explain_interruption(self) -> str:
        return propose_resume(self.folder)

    def run(self, console: Console) -> dict[str, Any]:
        length = "iterations" if RunFolder(self.folder).has_bodies() else "generations"
        changes = {length: self.generations, "workers": self.workers, "backend": self.backend}
        with console.track(f"Evolution in {self.folder}") as step:
            run = ev.resume(
                self.folder, progress=step.progress, allow=self.allow_code, **_drop_absent(changes)
            )
        return report_run(run, console)


def _drop_absent(options: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in options.items() if value is not None}


def _read_value(text: str) -> Any:
    """Return the value of an option of the environment: JSON, or the text itself."""
    try:
        return json.loads(text)
    except ValueError:
        return text


def require_run(folder: Path) -> None:
    """Refuse a folder without a run, by a `UsageError`."""
    if not (folder / "config.json").is_file():
        has_run = (folder / "run" / "config.json").is_file()  # as that of a training has
        advice = f"give {folder / 'run'}" if has_run else f"`symbrion evolve --folder {folder}` starts one"
        raise UsageError(f"{folder} contains no run; {advice}")


def propose_resume(folder: Path) -> str:
    """Return how an interrupted run goes on; empty where it has not begun."""
    if not (folder / "config.json").is_file():
        return ""
    return f"all but what was unfinished is stored; to go on: symbrion resume {shlex.quote(str(folder))}"


def report_run(run: "ev.Run", console: Console) -> dict[str, Any]:
    """Confirm the champion of bodies, print the results of a run, and return them as a summary."""
    if isinstance(run, BodyRun) and run.best is not None and run.confirmation is None:
        with console.track("Fresh trials of the fittest bodies") as step:
            confirmation = ev.confirm(run, progress=step.progress)
        run = dataclasses.replace(run, champion=confirmation.champion, confirmation=confirmation)
    done, champion, folder = len(run.history), run.champion, shlex.quote(str(run.folder))
    summary: dict[str, Any] = {
        "folder": run.folder,
        "generations": done,
        "evaluations": int(run.history[-1]["evaluations"]) if done else 0,
        "solved": run.is_solved,
        "champion": champion.to_json() if champion else None,
    }
    count = format_count(done, run.config.STEP)
    console.print_line(f"{count}, {summary['evaluations']} genotypes in {run.folder}")
    if isinstance(run, BodyRun):
        summary |= _report_bodies(run, console)
    elif champion and champion.trials:
        rate = f"{champion.successes} of {champion.trials} fresh trials in {champion.arena}"
        console.print_line(f"champion, {format_count(champion.modules, 'module')}: succeeds in {rate}")
    console.print_line(describe_stop(run))
    if not (champion and champion.successes):
        console.print_line("no success yet: more learning may help, or an easier way (--start, --goal)")
    if champion and (champion.trials or isinstance(run, BodyRun)):
        console.print_line(f"next: symbrion replay {folder} --video champion.mp4")
    return summary


def describe_stop(run: "ev.Run") -> str:
    """Return in one line what has stopped a search, and the command that goes on."""
    done = len(run.history)
    if run.is_solved:
        return "solved"
    if done < run.config.length:
        return "every body has learned to the end: nothing is left to be tried"
    return (
        f"stopped by --generations {run.config.length}; to go on: symbrion resume {shlex.quote(str(run.folder))} "
        f"--generations {max(2 * done, 1)}"
    )


def _report_bodies(run: BodyRun, console: Console) -> dict[str, Any]:
    """Print what bodies have learned, and return the results."""
    confirmation, bodies = run.confirmation, len(list_once(run.results))
    best = run.best if confirmation is None else confirmation.result
    fresh_seconds = 0.0 if confirmation is None else confirmation.seconds
    count = format_count(bodies, "body", "bodies")
    console.print_line(f"{count}, {run.seconds:.0f} s simulated, {fresh_seconds:.0f} s in fresh trials")
    summary = {"bodies": bodies, "simulated_seconds": run.seconds, "fresh_seconds": fresh_seconds}
    if best is None:
        return summary
    plan = best.body.to_plan()
    modules = format_count(best.body.num_modules, "module")
    console.print_line(f"best body, {modules}, {plan}: {describe_success(run)}")
    return summary | {"plan": plan, "confirmed": confirmation is not None}
