"""The whole road, walked once: survey, networks, arenas, evolution, judgement, film."""

import dataclasses
import json
import os
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Protocol

import numpy as np

import evolution as ev
import reconstruction as rc
import symbrion_gym as sg
from evolution.experiments.output_folder import refuse_foreign
from evolution.search.run import RunFolder
from reconstruction.files.atomic_write import write_atomically
from reconstruction.files.typed_json import JsonError, read_json
from symbrion_gym.ready_made import SPACING

TRIALS = 20
MARK = "demo.json"
"""What the demo writes first; it tells its folder from any other."""


class Step(Protocol):
    """One step of work, as the command line draws it: `progress` is called, `seconds` told at the end."""

    seconds: float

    @property
    def progress(self) -> rc.Progress:
        """The callback for the function that does the work."""
        ...


Track = Callable[[str], AbstractContextManager[Step]]
"""Given a title, begins a step."""


@dataclasses.dataclass(frozen=True)
class DemoConfig:
    """What the demo builds.

    Attributes:
        folder: where everything is kept.
        seed: of everything that is drawn.
        modules: length of the snake.
        gsrm_units: resolution of the GSRM, the arena of the evolution.
        gg_units: resolution of the growing grid.
        generations: of the evolution, at most.
        workers: threads.
    """

    folder: Path
    seed: int = 0
    modules: int = 8
    gsrm_units: int = 2200
    gg_units: int = 7000
    generations: int = 30
    workers: int = os.cpu_count() or 1


@dataclasses.dataclass
class Road:
    """Everything the demo made, for the report.

    Attributes:
        config: what was asked for.
        log: the scan log.
        raw_points: `[N, 3]` before the pre-processing [m].
        points: `[N, 3]` after it, evenly spread [m].
        surfaces: network -> reconstruction.
        arenas: network -> arena.
        run: the evolution.
        judgements: arena -> trials of the champion there.
        films: what -> recording of a trial in the true arena.
        seconds: step -> wall time [s].
    """

    config: DemoConfig
    log: rc.ScanLog
    raw_points: np.ndarray
    points: np.ndarray
    surfaces: dict[str, rc.Reconstruction]
    arenas: dict[str, sg.Arena]
    run: ev.Run
    judgements: dict[str, ev.Outcome]
    films: dict[str, ev.Recording]
    seconds: dict[str, float]

    @property
    def crosses(self) -> dict[str, bool]:
        """Arena -> whether the champion crosses from the floor under nominal conditions."""
        return {name: film.success for name, film in self.films.items() if name in ("gsrm", "truth")}


def walk_road(config: DemoConfig, track: Track) -> Road:
    """Walk the road of the design from the survey to the film.

    Args:
        config: what to build.
        track: begins a step of the progress display.

    Raises:
        RunError: the folder holds something else.
        ScanError, ReconstructionError, ArenaError, RunError: when a step fails.
    """
    seconds: dict[str, float] = {}
    claim_folder(config)
    with track("1/7 survey of the true arena") as step:
        log = sg.survey("truth", seed=config.seed, progress=step.progress)
        log.save(config.folder / "survey.npz")
    seconds["survey"] = step.seconds
    with track("2/7 pre-processing") as step:
        points = rc.thin(rc.preprocess(log), SPACING)
        rc.save_points(config.folder / "cloud.ply", points)
    seconds["pre-processing"] = step.seconds

    surfaces: dict[str, rc.Reconstruction] = {}
    for method, units in (("gsrm", config.gsrm_units), ("gg", config.gg_units)):
        with track(f"3/7 network {method}, {units} units") as step:
            surfaces[method] = rc.reconstruct(
                points, method=method, units=units, seed=config.seed, progress=step.progress
            )
            surfaces[method].save(config.folder / f"{method}.npz")
        seconds[f"network {method}"] = step.seconds

    arenas: dict[str, sg.Arena] = {}
    for method, surface in surfaces.items():
        with track(f"4/7 arena from {method}") as step:
            arenas[method] = sg.make_arena(
                surface.mesh, name=method, course=sg.Course(), seed=config.seed, progress=step.progress
            )
            arenas[method].save(config.folder / "arenas" / method)
        seconds[f"arena {method}"] = step.seconds

    with track(f"5/7 evolution of {config.modules} modules in the GSRM arena") as step:
        run = _evolve(config, step.progress)
    seconds["evolution"] = step.seconds
    with track("6/7 judgement and film") as step:
        judgements, films = _judge(config, run, arenas["gsrm"], step.progress)
    seconds["judgement and film"] = step.seconds
    return Road(config, log, log.points(), points, surfaces, arenas, run, judgements, films, seconds)


def claim_folder(config: DemoConfig) -> None:
    """Write `demo.json`, which says that a demo may replace what it makes there.

    Raises:
        RunError: the folder holds something of that which is no demo's.
    """
    names = (
        "survey.npz",
        "cloud.ply",
        "gsrm.npz",
        "gg.npz",
        "arenas/gsrm",
        "arenas/gg",
        "run",
        "report.html",
    )
    _refuse_foreign_mark(config.folder / MARK)
    refuse_foreign(config.folder, MARK, names)
    config.folder.mkdir(parents=True, exist_ok=True)
    with write_atomically(config.folder / MARK) as beside:
        beside.write_text(json.dumps(dataclasses.asdict(config) | {"folder": "."}, indent=2) + "\n")


def _refuse_foreign_mark(path: Path) -> None:
    try:
        content = read_json(path) if path.exists() else None
    except JsonError:
        content = ()
    names = {field.name for field in dataclasses.fields(DemoConfig)}
    if content is not None and not (isinstance(content, dict) and set(content) == names):
        raise ev.RunError(f"{path} was not written by a demo; name another folder, or move it")


def _evolve(config: DemoConfig, progress: rc.Progress) -> ev.Run:
    """Evolve in the reconstructed arena; an earlier run of the demo is replaced."""
    folder = config.folder / "run"
    former = RunFolder(folder)
    with former.lock():
        former.remove()
    return ev.evolve(
        ev.EvolutionConfig(
            arena=str(config.folder / "arenas" / "gsrm"),
            modules=config.modules,
            seed=config.seed,
            generations=config.generations,
            workers=config.workers,
            folder=str(folder),
        ),
        progress=progress,
    )


def _judge(
    config: DemoConfig, run: ev.Run, arena: sg.Arena, progress: rc.Progress
) -> tuple[dict[str, ev.Outcome], dict[str, ev.Recording]]:
    """Try the champion in the reconstructed and in the true arena, and film it beside a bad one."""
    assert run.champion is not None
    judgements: dict[str, ev.Outcome] = {}
    films: dict[str, ev.Recording] = {}
    places = {"gsrm": arena, "truth": sg.load_arena("truth")}
    for index, (name, place) in enumerate(places.items()):
        progress(f"trials in {name}", 0.3 * index)
        judgements[name] = ev.judge(run.champion, place, TRIALS, config.seed, workers=config.workers)
        films[name] = ev.play(run.champion, place, config.seed, film=name == "truth")
    progress("an insufficient robot", 0.8)
    films["insufficient"] = ev.play(find_insufficient(run), places["truth"], config.seed, film=True)
    return judgements, films


def find_insufficient(run: ev.Run) -> ev.Champion:
    """Return a robot of the first generation that did not cross: the median one of those."""
    assert run.champion is not None
    first = [entry for entry in run.record.entries if entry.generation == 0]
    failed = sorted(
        (entry for entry in first if not any(entry.outcome.succeeded)), key=lambda entry: entry.fitness
    )
    if not failed:  # all crossed at once: a body that follows no law stands for it
        return dataclasses.replace(run.champion, genotype=(0.0,) * len(run.champion.genotype))
    genotype = failed[len(failed) // 2].genotype
    return dataclasses.replace(run.champion, genotype=tuple(map(float, genotype)))
