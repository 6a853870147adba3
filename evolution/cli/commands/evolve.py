"""`symbrion evolve` and `symbrion resume`: search for a controller that crosses the pit."""

import dataclasses
import os
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

import evolution as ev
from evolution.cli.arguments import check_arena, check_arena_folder, check_modules
from evolution.cli.command import Command, SeededCommand, UsageError, require_writable_folder
from evolution.cli.console import Console
from symbrion_gym.assets import SCANNED_PITS

if TYPE_CHECKING:
    from evolution.search.loop import OnGeneration

MODELS_OF_TRUTH = ("truth", "simple", *SCANNED_PITS)
"""Named arenas that are the true course or models of it."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Evolve(SeededCommand):
    """Evolve the controller of a snake of docked robots with CMA-ES; an interrupted run can be resumed.

    Example: symbrion evolve --arena gsrm --folder runs/a

    Example: symbrion evolve --stages gsrm gg --folder runs/coarse-to-fine
    """

    folder: Path = Path("runs/latest")
    """Output folder: configuration, history.csv, every genotype, champion. Must not contain a run yet."""
    arena: str = "gsrm"
    """A named arena (truth, simple, gsrm, gg, stairs), an arena folder, or a mesh file."""
    modules: int = 8
    """Number of modules in the snake."""
    body_lengths: tuple[int, int] | None = None
    """Let evolution select the length of the body: fewest and most modules; replaces --modules."""
    restart_after: int | None = 10
    """Restart the search after n generations without an increase in successes; None: never."""
    generations: int = 50
    """Limit on the generations; the run stops earlier when a champion is confirmed by fresh trials."""
    workers: int = os.cpu_count() or 1
    """Threads or processes; the results do not depend on their number."""
    backend: Literal["batch", "processes", "ray"] = "batch"
    """Where simulations run: threads (batch), processes, or a Ray cluster."""
    address: str | None = None
    """Address of an existing Ray cluster."""
    controller: Literal["path", "reactive", "travelling", "posture", "network"] = "path"
    """The controller, which turns a genotype into hinge angles."""
    population: int = 12
    """Number of genotypes in a generation."""
    sigma: float = 0.5
    """Initial step size of CMA-ES."""
    origin: Literal["zero", "hint"] = "zero"
    """Start of the search: at zero, or at a genotype set by hand (then give --sigma 0.15)."""
    trials: int = 3
    """Number of randomized trials of each genotype."""
    start: Literal["pit", "floor"] = "pit"
    """Start of a trial: just before the pit (fast), or on the floor before the first ramp."""
    stages: tuple[str, ...] = ()
    """Several arenas one after the other, coarse to fine; replaces --arena."""
    tensorboard: bool = False
    """Also write the history for TensorBoard, into the run folder."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for arena in self.stages or (self.arena,):
            check_arena(arena)
        if self.body_lengths is None:
            check_modules(self.modules)
        elif not 2 <= self.body_lengths[0] < self.body_lengths[1]:
            given = " ".join(map(str, self.body_lengths))
            raise UsageError(
                f"--body-lengths {given} is not a range; give the fewest modules, 2 or more, then the most"
            )
        for option in ("generations", "workers", "population", "trials"):
            if getattr(self, option) < 1:
                raise UsageError(f"--{option} {getattr(self, option)} is too few; give 1 or more")
        if self.restart_after is not None and self.restart_after < 1:
            raise UsageError(
                f"--restart-after {self.restart_after} is too few; give 1 or more, or leave it out"
            )
        require_writable_folder(self.folder, "--folder")

    def run(self, console: Console) -> dict[str, Any]:
        for arena in self.stages or (self.arena,):
            check_arena_folder(arena)
        config = ev.EvolutionConfig(
            arena=self.arena,
            modules=self.modules,
            body_lengths=self.body_lengths,
            restart_after=self.restart_after,
            seed=self.seed,
            generations=self.generations,
            folder=str(self.folder),
            workers=self.workers,
            backend=self.backend,
            address=self.address,
            controller=self.controller,
            population_size=self.population,
            sigma=self.sigma,
            origin=self.origin,
            trials=self.trials,
            start=self.start,
            stages=tuple(ev.Stage(arena) for arena in self.stages),
        )
        with (
            console.track(
                f"Evolution, {' to '.join(map(str, self.body_lengths or (self.modules,)))} modules"
            ) as step,
            _open_tensorboard(self.folder, self.tensorboard) as callback,
        ):
            run = ev.evolve(config, on_generation=callback, progress=step.progress)
        return report_run(run, console)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Resume(Command):
    """Continue a run; the history is bit-identical to that of a run that was never interrupted.

    Example: symbrion resume runs/a --generations 100
    """

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER")]
    """The run folder."""
    generations: int | None = None
    """New limit on the generations. Default: as recorded."""
    workers: int = os.cpu_count() or 1
    """Threads or processes; the results do not depend on their number."""
    backend: Literal["batch", "processes", "ray"] | None = None
    """Where simulations run: threads (batch), processes, or a Ray cluster. Default: as recorded."""
    address: str | None = None
    """Address of an existing Ray cluster. Default: as recorded."""
    tensorboard: bool = False
    """Also write the history for TensorBoard, into the run folder."""

    def __post_init__(self) -> None:
        require_run(self.folder)
        if self.workers < 1:
            raise UsageError(f"--workers {self.workers} is too few; give 1 or more")

    def run(self, console: Console) -> dict[str, Any]:
        options = {name: getattr(self, name) for name in ("generations", "workers", "backend", "address")}
        changes = {name: value for name, value in options.items() if value is not None}
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
    from evolution.report.tensorboard_log import FOLDER, TensorBoardLog

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
        f"{summary['generations']} generations, {summary['evaluations']} genotypes in {run.folder}"
    )
    if run.champion and run.champion.trials:
        rate = f"{run.champion.successes} of {run.champion.trials}"
        body = f"{run.champion.modules} modules"
        console.print_line(f"champion, {body}: crosses in {rate} fresh trials in {run.champion.arena}")
        arena = find_replay_arena(run.champion.arena)
        console.print_line(f"next: symbrion replay {run.folder} --arena {arena} --video champion.mp4")
    else:
        console.print_line(
            "no genotype has crossed in all of its trials yet; try `symbrion resume` with more --generations"
        )
    return summary


def find_replay_arena(arena: str) -> str:
    """Return the arena in which to test a champion: the true course for models of it, else the champion's own."""
    return "truth" if arena in MODELS_OF_TRUTH else arena
