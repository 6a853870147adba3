"""`symbrion evolve` and `symbrion resume`: search for a controller that crosses."""

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

if TYPE_CHECKING:
    from evolution.search.loop import OnGeneration


@dataclasses.dataclass(frozen=True, kw_only=True)
class Evolve(SeededCommand):
    """Evolve the controller of a snake of docked robots with CMA-ES, in a run folder that can be resumed.

    Example: symbrion evolve --arena gsrm --folder runs/a

    Example: symbrion evolve --stages gsrm gg --folder runs/coarse-to-fine
    """

    folder: Path = Path("runs/latest")
    """The run folder: config, history.csv, every genotype, champion. Must not hold a run yet."""
    arena: str = "gsrm"
    """A named arena (truth, simple, gsrm, gg, stairs), an arena folder, or a mesh file."""
    modules: int = 8
    """Modules in the snake."""
    body_lengths: tuple[int, int] | None = None
    """Shortest and longest body that evolution may choose; replaces --modules."""
    restart_after: int | None = 10
    """Begin anew when successes have not become more for so many generations; None: never."""
    generations: int = 50
    """Stop after so many generations; sooner when a champion is confirmed by fresh trials."""
    workers: int = os.cpu_count() or 1
    """Threads or processes; the results do not depend on their number."""
    backend: Literal["batch", "processes", "ray"] = "batch"
    """Who simulates: threads, processes, or a Ray cluster."""
    address: str | None = None
    """Address of an existing Ray cluster."""
    controller: Literal["path", "reactive", "travelling", "posture", "network"] = "path"
    """The law that turns a genotype into hinge angles."""
    population: int = 12
    """Genotypes in a generation."""
    sigma: float = 0.5
    """First step size of CMA-ES."""
    origin: Literal["zero", "hint"] = "zero"
    """Where the search begins: with no knowledge, or near numbers set by hand (then give --sigma 0.15)."""
    trials: int = 3
    """Randomised trials of each genotype."""
    start: Literal["pit", "floor"] = "pit"
    """Where a trial starts: close before the pit (fast), or on the floor before the first ramp."""
    stages: tuple[str, ...] = ()
    """Arenas one after the other, coarse to fine; replaces --arena."""
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
                f"--body-lengths {given} is no range; give the shortest, from 2, then a longer one"
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
            _watch(self.folder, self.tensorboard) as watch,
        ):
            run = ev.evolve(config, on_generation=watch, progress=step.progress)
        return report_run(run, console)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Resume(Command):
    """Go on with a run as if it had never stopped: the history is the same to the bit.

    Example: symbrion resume runs/a --generations 100
    """

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER")]
    """The run folder."""
    generations: int | None = None
    """A new limit of generations; the recorded one otherwise."""
    workers: int = os.cpu_count() or 1
    """Threads or processes; the results do not depend on their number."""
    backend: Literal["batch", "processes", "ray"] | None = None
    """Who simulates: threads, processes, or a Ray cluster; the recorded one otherwise."""
    address: str | None = None
    """Address of an existing Ray cluster; the recorded one otherwise."""
    tensorboard: bool = False
    """Also write the history for TensorBoard, into the run folder."""

    def __post_init__(self) -> None:
        require_run(self.folder)
        if self.workers < 1:
            raise UsageError(f"--workers {self.workers} is too few; give 1 or more")

    def run(self, console: Console) -> dict[str, Any]:
        asked = {name: getattr(self, name) for name in ("generations", "workers", "backend", "address")}
        changes = {name: value for name, value in asked.items() if value is not None}
        with (
            console.track(f"Evolution in {self.folder}") as step,
            _watch(self.folder, self.tensorboard) as watch,
        ):
            run = ev.resume(self.folder, on_generation=watch, progress=step.progress, **changes)
        return report_run(run, console)


def _watch(folder: Path, tensorboard: bool) -> "AbstractContextManager[OnGeneration | None]":
    """Return what watches the generations: TensorBoard's log, or nothing."""
    if not tensorboard:
        return nullcontext()
    from evolution.report.tensorboard_log import FOLDER, TensorBoardLog

    first = len(ev.load_run(folder).history) if (folder / FOLDER).is_dir() else 0
    return TensorBoardLog(first)


def require_run(folder: Path) -> None:
    """Refuse a folder that holds no run."""
    if not (folder / "config.json").is_file():
        raise UsageError(f"{folder} holds no run; `symbrion evolve --folder {folder}` begins one")


def report_run(run: "ev.Run", console: Console) -> dict[str, Any]:
    """Print what a run came to; return its summary."""
    last = run.history[-1] if len(run.history) else None
    summary: dict[str, Any] = {
        "folder": run.folder,
        "generations": len(run.history),
        "evaluations": int(last["evaluations"]) if last is not None else 0,
        "solved": run.is_solved,
        "champion": run.champion.as_dict() if run.champion else None,
    }
    console.say(f"{summary['generations']} generations, {summary['evaluations']} genotypes in {run.folder}")
    if run.champion and run.champion.trials:
        rate = f"{run.champion.successes} of {run.champion.trials}"
        body = f"{run.champion.modules} modules"
        console.say(f"champion, {body}: crossed in {rate} fresh trials in {run.champion.arena}")
        console.say(f"next: symbrion replay {run.folder} --arena truth --video champion.mp4")
    else:
        console.say("no genotype held in all its trials yet; `symbrion resume` with more --generations")
    return summary
