"""`symbrion evolve` and `symbrion resume`: search for a controller that does a task."""

import dataclasses
import json
import os
import shlex
from collections.abc import Callable
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
    check_arena_folder,
    find_modules_here,
    require_writable_folder,
)
from evolution._src.cli.commands.evolve_bodies import (
    make_bodies_config,
    name_flag,
    resume_run_of_bodies,
    run_bodies,
)
from evolution._src.cli.console import Console
from evolution._src.cli.way_warning import warn_of_way
from evolution._src.search.bodies.config import ALGORITHMS, BodiesConfig
from evolution._src.search.run import RunFolder
from reconstruction._src.base.range_checks import format_count
from symbrion_gym._src.assets import SCANNED
from symbrion_gym._src.environment.config import STARTS
from symbrion_gym._src.robot.organism import snake

MODELS_OF_TRUTH = ("truth", "simple", *SCANNED)  # Named arenas that are the true course or models of it
Place = tuple[float, float]  # x and y [m]


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
    """What to do: cross_gap, climb, traverse, reach, recover or explore, or "module:name" of a task of yours."""
    start: Literal[STARTS] | Place | None = None  # pyright: ignore[reportInvalidTypeForm]
    """Where a trial begins: a name, or X Y [m]."""
    goal: Place | str | None = None
    """Where it ends: X Y [m], or the name of a known object."""
    environment: Annotated[tuple[tuple[str, str], ...], tyro.conf.arg(metavar="NAME VALUE ...")] = ()
    """Options of the environment, such as pit 0.35 or duration 30."""
    controller: str | None = None
    """Control law (reactive, path, oscillators, network, posture), or "module:name" of one of yours."""
    fitness: str | None = None
    """The scoring, "module:name" of a function of (outcome, body)."""
    bodies: Annotated[tuple[int, ...] | None, tyro.conf.arg(metavar="MIN MAX")] = None
    """Search for bodies of this many modules at least and at most (one number: both); each learns its controller."""
    algorithm: Literal[ALGORITHMS] = BodiesConfig.algorithm  # pyright: ignore[reportInvalidTypeForm]
    """How --bodies are searched."""
    population: int | None = None
    """Genotypes of a generation, or new bodies of an iteration of --bodies. Default: 12, or 9 bodies."""
    trials: int = ev.EvolutionConfig.trials
    """Trials of each genotype."""
    generations: int | None = None
    """Limit on the generations, or on the iterations of --bodies. Default: 50; 20 with --bodies."""
    workers: int = os.cpu_count() or 1
    """Threads, processes or actors; the results do not depend on their number."""
    backend: Literal[BACKENDS] = "batch"  # pyright: ignore[reportInvalidTypeForm]
    """Where simulations run: threads (batch), processes, a Ray cluster, or a GPU (warp)."""
    address: str | None = None
    """Address of an existing Ray cluster."""
    folder: Path = Path("runs/latest")
    """The run folder."""

    def __post_init__(self) -> None:
        super().__post_init__()
        find_modules_here(*(each for each in (self.task, self.controller, self.fitness) if ":" in str(each)))
        check_arena(self.arena)
        self.require_least(generations=1)
        require_writable_folder(self.folder, "--folder")
        _check_goal(self.goal)
        if self.bodies is None:
            if self.algorithm != BodiesConfig.algorithm:
                raise UsageError("--algorithm is of a search for bodies; give --bodies MIN MAX")
            self.make_config()
        else:
            self.make_bodies_config()

    def explain_interruption(self) -> str:
        return describe_interruption(self.folder)

    def make_config(self) -> "ev.EvolutionConfig":
        """Return the configuration of the run."""
        fields = self._list_common() | {
            "organism": self.organism,
            "trials": self.trials,
        }
        optional = {
            "modules": self.modules,
            "population_size": self.population,
            "generations": self.generations,
        }
        fields |= {name: value for name, value in optional.items() if value is not None}
        return _make(ev.EvolutionConfig, fields)

    def make_bodies_config(self) -> "ev.BodyEvolutionConfig":
        """Return the configuration of a search for bodies."""
        for name in ("modules", "organism"):
            value = getattr(self, name)
            if value:
                flag = f"--{name.replace('_', '-')}"
                raise UsageError(
                    f"{flag} is of one body, and --bodies searches for bodies; leave out one of them"
                )
        if self.trials != ev.EvolutionConfig.trials:
            raise UsageError("--trials is of one body; see `ev.LearningConfig` for what a body may learn")
        assert self.bodies is not None
        return make_bodies_config(
            self._list_common(),
            bodies=self.bodies,
            algorithm=self.algorithm,
            iterations=self.generations,
            children=self.population,
        )

    def _list_common(self) -> dict[str, Any]:
        """Return the fields of both kinds of search."""
        fields: dict[str, Any] = {
            "arena": self.arena,
            "seed": self.seed,
            "task": self.task,
            "start": self.start,
            "goal": self.goal,
            "environment": read_environment(self.environment),
            "workers": self.workers,
            "backend": self.backend,
            "address": self.address,
            "folder": str(self.folder),
        }
        optional = {"controller": self.controller, "scoring": self.fitness}
        return fields | {name: value for name, value in optional.items() if value is not None}

    def run(self, console: Console) -> dict[str, Any]:
        check_arena_folder(self.arena)
        if self.bodies is not None:
            found = self.make_bodies_config()
            warn_of_way(found, snake(found.bodies.smallest), snake(found.bodies.largest))
            return run_bodies(found, console)
        config = self.make_config()
        body = config.find_organism()
        warn_of_way(config, body, body)
        with console.track(f"Evolution, {format_count(config.modules, 'module')}") as step:
            run = ev.evolve(config, progress=step.progress)
        return report_run(run, console)


def describe_interruption(folder: Path) -> str:
    """Return how an interrupted run goes on; empty where it has not begun."""
    if not (folder / "config.json").is_file():
        return ""
    return f"all but what was unfinished is stored; to go on: symbrion resume {shlex.quote(str(folder))}"


def read_environment(pairs: tuple[tuple[str, str], ...]) -> dict[str, Any]:
    """Return options of the environment, their values read as JSON where they are such."""

    def read(text: str) -> Any:
        try:
            return json.loads(text)
        except ValueError:
            return text

    return {name: read(text) for name, text in pairs}


def _make(kind: Callable[..., Any], fields: dict[str, Any]) -> Any:
    """Return a configuration."""
    try:
        return kind(**fields)
    except ev.RunError as error:
        raise UsageError(name_flag(str(error), fields)) from error


def _check_goal(goal: object) -> None:
    """Refuse a single number: a word is a known object, and a place has two numbers."""
    if isinstance(goal, str) and not goal.strip("+-.0123456789"):
        raise UsageError(f"--goal {goal}: a known object is a name, a place is `FLOAT FLOAT`")


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
    backend: Literal["batch", "processes", "ray", "warp"] | None = None
    """Where simulations run: threads (batch), processes, a Ray cluster, or a GPU (warp). Default: as recorded."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_run(self.folder)
        self.require_least(workers=1)

    def explain_interruption(self) -> str:
        return describe_interruption(self.folder)

    def run(self, console: Console) -> dict[str, Any]:
        options = {name: getattr(self, name) for name in ("generations", "workers", "backend")}
        changes: dict[str, Any] = {name: value for name, value in options.items() if value is not None}
        changes["allow"] = self.allow_code
        if RunFolder(self.folder).has_bodies():
            return resume_run_of_bodies(self.folder, changes, console)
        with console.track(f"Evolution in {self.folder}") as step:
            run = ev.resume(self.folder, progress=step.progress, **changes)
        return report_run(run, console)


def require_run(folder: Path) -> None:
    """Refuse a folder without a run, by a `UsageError`."""
    if not (folder / "config.json").is_file():
        raise UsageError(f"{folder} contains no run; `symbrion evolve --folder {folder}` starts one")


def report_run(run: "ev.Run", console: Console) -> dict[str, Any]:
    """Print the results of a run, and return them as a summary."""
    last = run.history[-1] if len(run.history) else None
    summary: dict[str, Any] = {
        "folder": run.folder,
        "generations": len(run.history),
        "evaluations": int(last["evaluations"]) if last is not None else 0,
        "solved": run.is_solved,
        "champion": run.champion.as_dict() if run.champion else None,
    }
    console.print_line(
        f"{format_count(summary['generations'], 'generation')}, {summary['evaluations']} genotypes in {run.folder}"
    )
    if run.champion and run.champion.trials:
        rate = f"{run.champion.successes} of {run.champion.trials}"
        body = format_count(run.champion.modules, "module")
        console.print_line(f"champion, {body}: succeeds in {rate} fresh trials in {run.champion.arena}")
        arena = find_replay_arena(run.champion.arena)
        console.print_line(f"next: symbrion replay {run.folder} --arena {arena} --video champion.mp4")
    else:
        console.print_line(
            "no genotype has succeeded in all of its trials yet; more learning may help: symbrion resume "
            f"{shlex.quote(str(run.folder))} --generations {2 * run.config.generations}"
        )
    return summary


def find_replay_arena(arena: str) -> str:
    """Return the arena in which to test a champion: the true course for models of it, else the champion's own."""
    return "truth" if arena in MODELS_OF_TRUTH else arena
