"""The whole pipeline, run once: survey, networks, arenas, evolution, judging the champion, video."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Protocol

import evolution as ev
import reconstruction as rc
import symbrion_gym as sg
from evolution._src.experiments.folders import refuse_foreign_files, write_json
from evolution._src.search.run import RunFolder
from reconstruction._src.base.typed_json import JsonError, read_json
from symbrion_gym._src.sensing.survey import SPACING

MARKER = "demo.json"  # The file that the demo writes first; it shows that the folder is a demo's
OUTPUTS = ("survey.npz", "cloud.ply", "gsrm.npz", "gg.npz", "arenas/gsrm", "arenas/gg", "run", "report.html")
"""Files and folders that the demo makes."""


class Step(Protocol):
    """One step of the pipeline, as the command line draws it."""

    seconds: float  # wall time, known when the step has ended

    @property
    def progress(self) -> rc.Progress:
        """The callback for the function that does the work, see `reconstruction._src.base.progress`."""
        ...


Track = Callable[[str], AbstractContextManager[Step]]  # Starts a step with the given title


MODULES = 8  # Of the snake
UNITS = {"gsrm": 2200, "gg": 7000}
"""Units of each network: 2200 as in the paper, and as many as give about 14,000 triangles, as there."""
GENERATIONS = 30  # Limit of the evolution, which stops earlier when a champion is confirmed
TRIALS = 20
"""Randomized trials in which the champion is judged in each arena; 18 of 20 are the success threshold."""


@dataclasses.dataclass(frozen=True)
class DemoConfig:
    """What the demo builds."""

    folder: Path  # the folder of all files
    seed: int = 0  # seed of all random numbers
    workers: int = os.cpu_count() or 1  # threads; the results do not depend on their number


@dataclasses.dataclass
class DemoResult:
    """Everything the demo made, for its page."""

    config: DemoConfig  # the configuration of the demo
    log: rc.ScanLog  # the scan log
    cloud: rc.Cloud  # points, in the colors that the camera saw, after pre-processing and thinned
    surfaces: dict[str, rc.Reconstruction]  # network -> reconstruction
    arenas: dict[str, sg.Arena]  # network -> arena
    run: ev.Run  # the evolution
    outcomes: dict[str, ev.Outcome]  # arena -> randomized trials of the champion there
    # arena -> recording of the champion's nominal trial there; "insufficient": of a robot that did not cross,
    # in the true arena
    films: dict[str, ev.Recording]
    seconds: dict[str, float]  # step -> wall time [s]

    @property
    def crosses(self) -> dict[str, bool]:
        """Arena -> whether the champion crosses from the floor under nominal conditions (no randomization)."""
        return {name: film.success for name, film in self.films.items() if name in ("gsrm", "truth")}


def run_pipeline(config: DemoConfig, track: Track) -> DemoResult:
    """Run all steps from the survey to the video of the champion."""
    seconds: dict[str, float] = {}

    @contextmanager
    def timed(number: int, name: str) -> Iterator[Step]:
        with track(f"{number}/7 {name}") as step:
            yield step
        seconds[name] = step.seconds

    claim_folder(config)
    with timed(1, "survey of the true arena") as step:
        log = sg.survey(paint_truth(), seed=config.seed, progress=step.progress, camera=True)
        log.save(config.folder / "survey.npz")
    with timed(2, "pre-processing"):
        cloud = rc.thin(rc.preprocess(log), SPACING)
        assert isinstance(cloud, rc.Cloud)
        rc.save_points(config.folder / "cloud.ply", cloud)
    surfaces: dict[str, rc.Reconstruction] = {}
    for method, units in UNITS.items():
        with timed(3, f"network {method}") as step:
            surfaces[method] = rc.reconstruct(
                cloud, method=method, units=units, seed=config.seed, progress=step.progress
            )
            surfaces[method].save(config.folder / f"{method}.npz")
    arenas: dict[str, sg.Arena] = {}
    for method, surface in surfaces.items():
        with timed(4, f"arena {method}") as step:
            made = sg.make_arena(surface.mesh, name=method, seed=config.seed, progress=step.progress)
            arenas[method] = sg.color_arena(made, surface.cloud)
            arenas[method].save(config.folder / "arenas" / method)
    with timed(5, "evolution") as step:
        run = _evolve(config, step.progress)
    with timed(6, "trials and video") as step:
        outcomes, films = _judge(config, run, arenas["gsrm"], step.progress)
    return DemoResult(config, log, cloud, surfaces, arenas, run, outcomes, films, seconds)


def paint_truth() -> sg.Arena:
    """Return the true arena with colors: the robot's camera sees them, its bodies do not feel them."""
    return sg.Arena.from_course(sg.Course(color_pattern="checker"), "truth")


def claim_folder(config: DemoConfig) -> None:
    """Write `demo.json`, which allows a later demo to replace the files of this one."""
    marker, content = config.folder / MARKER, dataclasses.asdict(config) | {"folder": "."}
    try:
        known = read_json(marker) if marker.exists() else content
    except JsonError:
        known = None
    if not isinstance(known, dict) or set(known) != set(content):
        raise ev.RunError(f"{marker} was not written by a demo; name another folder, or move it")
    refuse_foreign_files(config.folder, MARKER, OUTPUTS)
    config.folder.mkdir(parents=True, exist_ok=True)
    write_json(marker, content)


def _evolve(config: DemoConfig, progress: rc.Progress) -> ev.Run:
    """Evolve in the reconstructed arena; the run of an earlier demo is replaced."""
    folder = config.folder / "run"
    earlier = RunFolder(folder)
    with earlier.lock():
        earlier.remove()
    return ev.evolve(
        ev.EvolutionConfig(
            arena=str(config.folder / "arenas" / "gsrm"),
            modules=MODULES,
            seed=config.seed,
            generations=GENERATIONS,
            workers=config.workers,
            folder=str(folder),
        ),
        progress=progress,
    )


def _judge(
    config: DemoConfig, run: ev.Run, arena: sg.Arena, progress: rc.Progress
) -> tuple[dict[str, ev.Outcome], dict[str, ev.Recording]]:
    """Judge the champion in the reconstructed and in the true arena, and film it and a robot that did not cross."""
    assert run.champion is not None
    outcomes: dict[str, ev.Outcome] = {}
    films: dict[str, ev.Recording] = {}
    judged_in = {"gsrm": arena, "truth": paint_truth()}
    for index, (name, place) in enumerate(judged_in.items()):
        progress(f"trials in {name}", index / (len(judged_in) + 1))
        outcomes[name] = ev.judge(run.champion, place, TRIALS, config.seed, workers=config.workers)
        films[name] = ev.play(run.champion, place, config.seed, film=name == "truth")
    progress("an insufficiently evolved robot", len(judged_in) / (len(judged_in) + 1))
    films["insufficient"] = ev.play(find_insufficient(run), judged_in["truth"], config.seed, film=True)
    return outcomes, films


def find_insufficient(run: ev.Run) -> ev.Champion:
    """Return an insufficiently evolved robot: of those of the first generation that did not cross, the median one."""
    assert run.champion is not None
    first = [entry for entry in run.record.entries if entry.generation == 0]
    failed = sorted(
        (entry for entry in first if not any(entry.outcome.succeeded)), key=lambda entry: entry.fitness
    )
    if not failed:  # all crossed at once: a robot that does nothing instead
        return dataclasses.replace(run.champion, genotype=(0.0,) * len(run.champion.genotype))
    genotype = failed[len(failed) // 2].genotype
    return dataclasses.replace(run.champion, genotype=tuple(map(float, genotype)))
