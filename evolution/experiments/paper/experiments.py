"""All experiments in their order; each is kept when it is done, and found again by the next call."""

import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import evolution as ev
import reconstruction as rc
import symbrion_gym as sg
from evolution.experiments.demo.demo import Track
from evolution.experiments.paper.arenas import build_arenas, load_arena
from evolution.experiments.paper.cloud import measure_cloud
from evolution.experiments.paper.config import PaperConfig
from evolution.experiments.paper.folder import PaperFolder
from evolution.experiments.paper.laser import measure_laser
from evolution.experiments.paper.models import measure_resolutions
from evolution.experiments.paper.networks import measure_networks
from evolution.experiments.paper.physics import measure_physics
from evolution.experiments.paper.robots import describe_run, evolve_champion, film_robots, judge_champion
from evolution.experiments.paper.widened import measure_widened

Record = dict[str, Any]
Work = Callable[[rc.Progress], Any]
RUN = "run"


def run_experiments(
    folder: PaperFolder, track: Track, workers: int = os.cpu_count() or 1, names: Iterable[str] = ()
) -> dict[str, Record]:
    """Do all experiments that are not there yet.

    Args:
        folder: where each is kept.
        track: begins a step of the progress display.
        workers: threads; the results do not depend on their number.
        names: do no others; empty for all.

    Returns:
        Name -> record, see `PaperFolder.find`.

    Raises:
        ScanError, ReconstructionError, ArenaError, RunError: when an experiment fails.
    """
    experiments = list_experiments(folder.path, folder.config, workers)
    wanted = list(names) or list(experiments)
    records = {}
    for index, name in enumerate(wanted):
        title, work = experiments[name]
        kept = folder.find(name)
        if kept is None:
            with track(f"{index + 1}/{len(wanted)} {title}") as step:
                kept = folder.keep(name, lambda work=work, step=step: work(step.progress))
        records[name] = kept
    return records


def list_experiments(path: Path, config: PaperConfig, workers: int) -> dict[str, tuple[str, Work]]:
    """Return name -> title and work, in the order in which they need each other."""

    def champion() -> ev.Champion:
        return ev.load_champion(path / RUN)

    listed: dict[str, tuple[str, Work]] = {
        "cloud": ("Fig. 3: survey and cloud", lambda told: measure_cloud(path, config.seed, told)),
        "networks": ("Table I: networks", lambda told: measure_networks(path, config, told)),
        "arenas": ("arenas", lambda told: build_arenas(path, config, told)),
        "evolution": ("evolution in the GSRM arena", lambda told: _evolve(path, config, workers, told)),
        "physics": (
            "Table II: physics", lambda told: measure_physics(path, champion(), config, told)
        ),
        "laser": ("Table III: laser scan", lambda told: measure_laser(path, config, told)),
        "films": (
            "Fig. 7: films",
            lambda told: film_robots(path, ev.load_run(path / RUN), config, told),
        ),
        "widened": (
            "the pit is widened",
            lambda told: measure_widened(path, config, workers, told),
        ),
    }  # fmt: skip
    if config.model_generations:
        listed["resolutions"] = (
            "a champion of every resolution",
            lambda told: measure_resolutions(path, config, workers, told),
        )
    return listed


def _evolve(path: Path, config: PaperConfig, workers: int, progress: rc.Progress) -> dict[str, Any]:
    run = evolve_champion(path, "gsrm", RUN, config, config.generations, workers, progress)
    assert run.champion is not None
    progress("judging", 0.99)
    arenas = {"gsrm": load_arena(path, "gsrm"), "truth": sg.load_arena("truth")}
    return {**describe_run(run), "judged": judge_champion(run.champion, arenas, config, workers)}
