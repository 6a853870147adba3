"""`symbrion evolve` and `symbrion resume`: search for a controller that does a task."""

import dataclasses
import os
import shlex
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

import evolution as ev
from evolution._src.backends.parts import BodyConfig, ControlConfig, EpisodeConfig
from evolution._src.backends.scoring import Scoring
from evolution._src.backends.trials import TrialConfig
from evolution._src.body_search.config import ALGORITHMS, BodiesConfig
from evolution._src.body_search.run import has_bodies
from evolution._src.cli.arguments import check_arena, check_arena_folder
from evolution._src.cli.command import (
    SeededCommand,
    TrustingCommand,
    UsageError,
    find_modules_here,
    require_writable_folder,
)
from evolution._src.cli.commands.evolve_bodies import make_bodies_config, resume_run_of_bodies, run_bodies
from evolution._src.cli.config_options import make_config, make_options, read_environment
from evolution._src.cli.console import Console
from evolution._src.cli.search_limits import describe_interruption, warn_of_limit
from evolution._src.cli.way_warning import warn_of_way
from evolution._src.search.search_config import ExecutionConfig, SearchConfig
from evolution._src.search.validation import Validation
from reconstruction._src.base.quantities import format_count
from symbrion_gym._src.assets import SCANNED_PITS
from symbrion_gym._src.robot.organism import snake

if TYPE_CHECKING:
    from evolution._src.search.loop import OnGeneration

MODELS_OF_TRUTH = ("truth", "simple", *SCANNED_PITS)
"""Named arenas that are the true course or models of it."""


BodyOptions, EpisodeOptions, ControlOptions, TrialOptions, SearchOptions = (
    make_options(kind, **defaults)
    for kind, defaults in (
        (BodyConfig, {"modules": None}),
        (EpisodeConfig, {"start": None}),
        (ControlConfig, {}),
        (TrialConfig, {}),
        (SearchConfig, {}),
    )
)
ExecutionOptions = make_options(ExecutionConfig, folder="runs/latest", workers=os.cpu_count() or 1)
_PART = tyro.conf.arg(name="")
"""The options of a part have no prefix."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Evolve(SeededCommand):
    """Evolve the controller of a body of docked robots with CMA-ES; an interrupted run can be resumed.

    The options are the fields of `EvolutionConfig`.

    Example: symbrion evolve --arena gsrm --folder runs/a

    Example: symbrion evolve --arena arenas/mine --start 0 0 --goal 3 1 --folder runs/mine

    Example: symbrion evolve --arena arenas/mine --task traverse --bodies 1 8 --folder runs/bodies

    Example: symbrion evolve --arena truth --organism cross --task cross_gap --controller oscillators --folder runs/b
    """

    arena: str = "gsrm"
    """A named arena (truth, simple, gsrm, gg, stairs), an arena folder, or a file that `symbrion arena` takes."""
    stages: tuple[str, ...] = ()
    """Several arenas one after the other, coarse to fine; replaces --arena."""
    body: Annotated[BodyOptions, _PART] = dataclasses.field(default_factory=BodyOptions)  # pyright: ignore[reportInvalidTypeForm]
    episode: Annotated[EpisodeOptions, _PART] = dataclasses.field(default_factory=EpisodeOptions)  # pyright: ignore[reportInvalidTypeForm]
    control: Annotated[ControlOptions, _PART] = dataclasses.field(default_factory=ControlOptions)  # pyright: ignore[reportInvalidTypeForm]
    search: Annotated[SearchOptions, _PART] = dataclasses.field(default_factory=SearchOptions)  # pyright: ignore[reportInvalidTypeForm]
    execution: Annotated[ExecutionOptions, _PART] = dataclasses.field(default_factory=ExecutionOptions)  # pyright: ignore[reportInvalidTypeForm]
    trial: Annotated[TrialOptions, _PART] = dataclasses.field(default_factory=TrialOptions)  # pyright: ignore[reportInvalidTypeForm]
    fitness: str | None = None
    """The scoring, "module:name" of a function of (outcome, body); replaces the weights of --scoring."""
    scoring: Scoring = dataclasses.field(default_factory=Scoring)
    validation: Validation = dataclasses.field(default_factory=Validation)
    bodies: Annotated[tuple[int, ...] | None, tyro.conf.arg(metavar="MIN MAX")] = None
    """Search for bodies of this many modules at least and at most (one number: both); each learns its controller."""
    algorithm: Literal[ALGORITHMS] = BodiesConfig.algorithm  # pyright: ignore[reportInvalidTypeForm]
    """How --bodies are searched."""
    children: int = BodiesConfig.children
    """New bodies of an iteration of --bodies. With fewer, an iteration is shorter and knows less when it ends."""
    max_seconds: float | Literal["unlimited"] | None = None
    """Simulated time after which no new iteration of --bodies begins [s]. The iteration that is running then is always
    finished, so that a run can take much longer: see --children. `symbrion resume` can raise it."""
    dofs: Literal[1, 2] = 1
    """Rotational degrees of freedom of each module of --bodies: 2 adds the rotation of the arm."""
    confirm: bool = True
    """Whether the fittest of --bodies are tried again at the end: up to 48 fresh trials of each of 8 select the
    champion. They may take longer than an iteration, and --max-seconds does not count them."""
    tensorboard: bool = False
    """Also write the history for TensorBoard, into the run folder."""

    def __post_init__(self) -> None:
        super().__post_init__()
        task, controller = self.episode.task, self.control.controller  # pyright: ignore[reportAttributeAccessIssue]
        find_modules_here(*(each for each in (task, controller, self.fitness) if ":" in str(each)))
        for arena in self.stages or (self.arena,):
            check_arena(arena)
        if self.execution.generations < 1:
            raise UsageError(f"--generations {self.execution.generations} is too few; give 1 or more")
        require_writable_folder(self._folder, "--folder")
        _check_goal(self.episode.goal)  # pyright: ignore[reportAttributeAccessIssue]
        if self.bodies is None:
            own = (self.algorithm, self.children, self.max_seconds, self.dofs, self.confirm)
            if own != (BodiesConfig.algorithm, BodiesConfig.children, None, 1, True):
                raise UsageError(
                    "--algorithm, --children, --max-seconds, --dofs and --no-confirm are of a search for bodies; give "
                    "--bodies MIN MAX"
                )
            self.make_config()
        else:
            self.make_bodies_config()

    @property
    def _folder(self) -> Path:
        return Path(self.execution.folder)

    def explain_interruption(self) -> str:
        return describe_interruption(self._folder)

    def make_config(self) -> "ev.EvolutionConfig":
        """Return the configuration of the run.

        Raises:
            UsageError: a value is refused.
        """
        parts = (self.body, self.episode, self.control, self.trial, self.search, self.execution)
        fields = {each.name: getattr(part, each.name) for part in parts for each in dataclasses.fields(part)}
        if fields["modules"] is None:
            del fields["modules"]
        fields |= {
            "environment": read_environment(fields["environment"]),
            "arena": self.arena,
            "stages": tuple(ev.Stage(arena) for arena in self.stages),
            "seed": self.seed,
            "scoring": self.fitness or self.scoring,
            "validation": self.validation,
        }
        return make_config(fields)

    def make_bodies_config(self) -> "ev.BodyEvolutionConfig":
        """Return the configuration of a search for bodies.

        Raises:
            UsageError: a value is refused, or an option has no meaning where bodies are searched.
        """
        if self.stages or self.tensorboard or self.validation != Validation():
            raise UsageError(
                "--stages, --tensorboard and --validation have no meaning with --bodies; leave them out"
            )
        names = ("bodies", "algorithm", "children", "max_seconds", "dofs", "arena", "seed")
        fields = {name: getattr(self, name) for name in names}
        fields["environment"] = read_environment(self.episode.environment)  # pyright: ignore[reportAttributeAccessIssue]
        fields["scoring"] = self.fitness or (self.scoring if self.scoring != Scoring() else None)
        parts = {
            name: getattr(self, name)
            for name in ("body", "episode", "control", "trial", "search", "execution")
        }
        return make_bodies_config(fields, parts)

    def run(self, console: Console) -> dict[str, Any]:
        for arena in self.stages or (self.arena,):
            check_arena_folder(arena)
        if self.bodies is not None:
            found = self.make_bodies_config()
            warn_of_limit(found)
            warn_of_way(found, snake(found.bodies.smallest), snake(found.bodies.largest))
            return run_bodies(found, console, self.confirm)
        config = self.make_config()
        shortest, longest = config.body_lengths or (config.modules, config.modules)
        warn_of_way(config, config.body.find_organism(shortest), config.body.find_organism(longest))
        with (
            console.track(f"Evolution, {describe_body(config)}") as step,
            _open_tensorboard(self._folder, self.tensorboard) as callback,
        ):
            run = ev.evolve(config, on_generation=callback, progress=step.progress)
        return report_run(run, console)


def _check_goal(goal: object) -> None:
    """Refuse a single number: a word is a known object, and a place has two numbers."""
    if isinstance(goal, str) and not goal.strip("+-.0123456789"):
        raise UsageError(f"--goal {goal}: a known object is a name, a place is `FLOAT FLOAT`")


def describe_body(config: "ev.EvolutionConfig") -> str:
    """Return the size of the body of a run in words."""
    if config.body_lengths is None:
        return format_count(config.modules, "module")
    return f"{' to '.join(map(str, config.body_lengths))} modules"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Resume(TrustingCommand):
    """Continue a run; the history is bit-identical to that of a run that was never interrupted.

    Example: symbrion resume runs/a --generations 100
    """

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER")]
    """The run folder."""
    generations: int | None = None
    """New limit on the generations, or on the iterations of a search for bodies. Default: as recorded."""
    max_seconds: float | Literal["unlimited"] | None = None
    """New limit on the simulated time of a search for bodies [s], or unlimited; an iteration is always finished.
    Default: as recorded."""
    confirm: bool = True
    """Whether the fittest bodies of a search for bodies are tried again at the end, as by `symbrion evolve`."""
    workers: int = os.cpu_count() or 1
    """Threads or processes; the results do not depend on their number."""
    backend: Literal["batch", "processes", "ray", "warp"] | None = None
    """Where simulations run: threads (batch), processes, a Ray cluster, or a GPU (warp). Default: as recorded."""
    address: str | None = None
    """Address of an existing Ray cluster. Default: as recorded."""
    tensorboard: bool = False
    """Also write the history for TensorBoard, into the run folder."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_run(self.folder)
        if self.workers < 1:
            raise UsageError(f"--workers {self.workers} is too few; give 1 or more")
        if (self.max_seconds, self.confirm) != (None, True) and not has_bodies(self.folder):
            raise UsageError(
                f"--max-seconds and --no-confirm are of a search for bodies, and {self.folder} is none; leave them out"
            )
        if isinstance(self.max_seconds, float) and not self.max_seconds > 0:
            raise UsageError(f"--max-seconds {self.max_seconds:g} is no time; give more than 0, or unlimited")

    def explain_interruption(self) -> str:
        return describe_interruption(self.folder)

    def run(self, console: Console) -> dict[str, Any]:
        options = {name: getattr(self, name) for name in ("generations", "workers", "backend", "address")}
        changes: dict[str, Any] = {name: value for name, value in options.items() if value is not None}
        changes["allow"] = self.allow_code
        if has_bodies(self.folder):
            if self.max_seconds is not None:
                changes["max_seconds"] = None if self.max_seconds == "unlimited" else self.max_seconds
            return resume_run_of_bodies(self.folder, changes, console, self.confirm)
        with (
            console.track(f"Evolution in {self.folder}") as step,
            _open_tensorboard(self.folder, self.tensorboard) as callback,
        ):
            run = ev.resume(self.folder, on_generation=callback, progress=step.progress, **changes)
        return report_run(run, console)


def _open_tensorboard(folder: Path, tensorboard: bool) -> "AbstractContextManager[OnGeneration | None]":
    """Return the callback that writes for TensorBoard; one of None where it is not wanted."""
    if not tensorboard:
        return nullcontext()
    from evolution._src.report.tensorboard_log import FOLDER, TensorBoardLog

    first = len(ev.load_run(folder).history) if (folder / FOLDER).is_dir() else 0
    return TensorBoardLog(first)


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
