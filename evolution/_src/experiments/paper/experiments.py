"""All experiments in their order; each result is saved when it is finished, and read by the next call."""

import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import evolution as ev
import reconstruction as rc
import symbrion_gym as sg
from evolution._src.experiments.demo.demo import Track
from evolution._src.experiments.paper.arenas import build_arenas, load_arena
from evolution._src.experiments.paper.cloud import measure_cloud
from evolution._src.experiments.paper.config import PaperConfig
from evolution._src.experiments.paper.folder import PaperFolder
from evolution._src.experiments.paper.laser import measure_laser
from evolution._src.experiments.paper.models import measure_resolutions
from evolution._src.experiments.paper.networks import measure_networks
from evolution._src.experiments.paper.physics import measure_physics
from evolution._src.experiments.paper.robots import describe_run, evolve_champion, film_robots, judge_champion
from evolution._src.experiments.paper.swarm import tell_stories
from evolution._src.experiments.paper.widened import measure_widened

Record = dict[str, Any]
Work = Callable[[rc.Progress], dict[str, Any] | list[dict[str, Any]]]
RUN = "run"


def run_experiments(
    folder: PaperFolder, track: Track, workers: int = os.cpu_count() or 1, names: Iterable[str] = ()
) -> dict[str, Record]:
    """Run all experiments whose results do not exist yet.

    Args:
        folder: the folder of the results.
        track: starts a step of the progress display.
        workers: threads; the results do not depend on their number.
        names: names of the experiments that are run; empty for all.

    Returns:
        Name -> record, see `PaperFolder.find`.

    Raises:
        ScanError: the survey fails.
        ReconstructionError: a network cannot learn the points.
        ArenaError: a surface cannot become an arena.
        RunError: an evolution fails, or a saved result is damaged.
    """
    experiments = list_experiments(folder.path, folder.config, workers)
    wanted = list(names) or list(experiments)
    records = {}
    for index, name in enumerate(wanted):
        title, work = experiments[name]
        record = folder.find(name)
        if record is None:
            with track(f"{index + 1}/{len(wanted)} {title}") as step:
                record = folder.keep(name, lambda work=work, step=step: work(step.progress))
        records[name] = record
    return records


def list_experiments(path: Path, config: PaperConfig, workers: int) -> dict[str, tuple[str, Work]]:
    """Return name -> title and work, in the order in which they need each other."""

    def champion() -> ev.Champion:
        return ev.load_champion(path / RUN)

    listed: dict[str, tuple[str, Work]] = {
        "cloud": ("Fig. 3: survey and cloud", lambda progress: measure_cloud(path, config.seed, progress)),
        "networks": ("Table I: networks", lambda progress: measure_networks(path, config, progress)),
        "arenas": ("arenas", lambda progress: build_arenas(path, config, progress)),
        "evolution": ("evolution in the GSRM arena", lambda progress: _evolve(path, config, workers, progress)),
        "physics": (
            "Table II: physics", lambda progress: measure_physics(path, champion(), config, progress)
        ),
        "laser": ("Table III: laser scan", lambda progress: measure_laser(path, config, progress)),
        "films": (
            "Fig. 7: videos",
            lambda progress: film_robots(path, ev.load_run(path / RUN), config, progress),
        ),
        "widened": (
            "the pit is widened",
            lambda progress: measure_widened(path, config, workers, progress),
        ),
    }  # fmt: skip
    if config.model_generations:
        listed["resolutions"] = (
            "one champion per resolution",
            lambda progress: measure_resolutions(path, config, workers, progress),
        )
    if config.swarm_stories:
        listed["swarm"] = (
            "a swarm gathers, crosses and parts",
            lambda progress: tell_stories(path, champion(), config, progress),
        )
    return listed


def _evolve(path: Path, config: PaperConfig, workers: int, progress: rc.Progress) -> dict[str, Any]:
    run = evolve_champion(path, "gsrm", RUN, config, config.generations, workers, progress)
    assert run.champion is not None
    progress("judging the champion", 0.99)
    arenas = {"gsrm": load_arena(path, "gsrm"), "truth": sg.load_arena("truth")}
    return {**describe_run(run), "judged": judge_champion(run.champion, arenas, config, workers)}
