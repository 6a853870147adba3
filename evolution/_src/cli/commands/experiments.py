"""`symbrion train`, `demo`, `swarm` and `paper`: whole experiments, each in a folder of its own."""

import dataclasses
import os
import shlex
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from evolution._src.cli.command import (
    SeededCommand,
    TrustingCommand,
    UsageError,
    require_file,
    require_writable_folder,
)
from evolution._src.cli.console import Console
from evolution._src.cli.scan_source import Box, FrameCommand, check_box, crop_cloud
from reconstruction._src.base.atomic_write import write_file
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.range_checks import format_count
from reconstruction._src.base.typed_json import write_json


@dataclasses.dataclass(frozen=True, kw_only=True)
class Experiment(SeededCommand):
    """A subcommand that repeats a whole experiment."""

    out: Path
    """Output folder."""
    workers: int = os.cpu_count() or 1
    """Threads; the results do not depend on their number."""

    def check(self) -> None:
        super().check()
        require_writable_folder(self.out, "--out")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Demo(Experiment):
    """Train a row of six Scouts on a survey of a short course, and judge its champion in the true course, too.

    Example: symbrion demo --out demo
    """

    out: Path = Path("demo")
    """Output folder; open report.html in it. The same command again goes on where it was interrupted."""

    def run(self, console: Console) -> dict[str, Any]:
        require_extras("`symbrion demo`", "scan", "report")
        import evolution as ev
        import symbrion_gym as sg
        from evolution._src.experiments.folders import refuse_foreign_files
        from evolution._src.experiments.train import MARKER, OUTPUTS

        refuse_foreign_files(self.out, MARKER, OUTPUTS)
        # Six Scouts that drive straight ahead do not cross it.
        course = sg.Course(pit=0.38, height=0.2, ramp=0.7, floor=1.0, color_pattern="checker")
        truth = sg.Arena.from_course(course, "truth")
        survey = self.out / "survey.npz"
        if not survey.exists():
            with console.track("Survey of the course") as step:
                sg.survey(truth, seed=self.seed, progress=step.progress, camera=True).save(survey)
        with console.track("Training") as step:
            options = {"organism": 6, "truth": truth, "seed": self.seed, "workers": self.workers}
            result = ev.train(survey, self.out, progress=step.progress, **options)
        return _report(result, step.seconds, console)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Train(FrameCommand, Experiment):
    """Make a robot drive in any scan: two models of two halves of the readings, a verdict, a way, a champion, a page.

    A controller evolves from zero in the first model and is judged in the other one. The same command again goes on
    where it was interrupted.

    Example: symbrion train scan.ply --out mine
    """

    scan: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCAN")]
    """A file of points, a scan log, a mesh, or an arena folder. Of more than 20 m the part around --start and
    --goal, or with most level ground, is used."""
    out: Path = Path("trained")
    """Output folder; open report.html in it."""
    classes: tuple[int, ...] = ()
    """Classes of a .las or .laz file that are used. Default: all but noise, water, high vegetation and wires."""
    crop: Box | None = None
    """Use only the points in this box: XMIN XMAX YMIN YMAX ZMIN ZMAX [m], in the coordinates of the file with z up."""
    start: tuple[float, float] | None = None
    """Where the robot starts: X Y [m]. Default: chosen on ground that both halves confirm."""
    goal: tuple[float, float] | None = None
    """Where it is to arrive: X Y [m]. Default: chosen so that the way has a corner."""
    organism: str | None = None
    """The body: a number of modules in a row, a body plan, or the name or file of one. Default: a lone Scout, or a row
    that crosses the gap between --start and --goal."""
    max_pieces: int | None = None
    """Most contact pieces of each model. Default: 2200, or twice as many where these alone make it a no."""

    def check(self) -> None:
        super().check()
        if not self.scan.is_dir():
            require_file(self.scan, "SCAN")
        if self.crop is not None:
            check_box(self.crop)
        self.require_least(max_pieces=1)

    def explain_interruption(self) -> str:
        return "what is done is kept; the same command goes on"

    def run(self, console: Console) -> dict[str, Any]:
        import evolution as ev
        import reconstruction as rc
        from evolution._src.experiments.train import cover_part, read_site

        is_mesh = self.scan.is_file() and rc.is_mesh(self.scan)
        if self.crop is not None and (is_mesh or self.scan.is_dir() or rc.is_scan_log(self.scan)):
            raise UsageError(f"--crop is for points, which {self.scan} are not")
        with console.track(f"Training in {self.scan.name}") as step:
            frame = {"unit": self.unit, "up": self.up, "scale": self.scale, "classes": self.classes or None}
            begun = 0.3 if is_mesh else 0.0  # its arena is made where it is read
            making = cover_part(step.progress, 0.0, begun)
            site = read_site(self.scan, self.viewpoint or None, self.max_pieces, making, **frame)
            if self.crop is not None:
                assert isinstance(site, rc.Cloud)
                site = crop_cloud(site, np.reshape(self.crop, (3, 2)).T, self.scan)
            names = ("start", "goal", "organism", "max_pieces", "seed", "workers")
            options: dict[str, Any] = {name: getattr(self, name) for name in names}
            options["progress"] = cover_part(step.progress, begun, 1.0)
            result = ev.train(site, self.out, source=self._describe(), **options)
        return _report(result, step.seconds, console)

    def _describe(self) -> str:
        """Return the scan and how it is read, as words of the command line."""
        words = [str(self.scan)]
        for name in ("unit", "up", "scale", "viewpoint", "classes", "crop"):
            value = getattr(self, name)
            if value != getattr(Train, name):
                words += [f"--{name}", *map(str, np.ravel(value))]
        return shlex.join(words)


def _report(result: Any, seconds: float, console: Console) -> dict[str, Any]:
    """Print what a robot has learned, and return it as a summary."""
    from evolution._src.experiments.training import TRIALS

    config = result.run.config
    for where, arena in zip(result.held, (result.arena, result.other), strict=False):
        console.print_line(f"model, {where}: {arena.verdict}")
    places = [config.start, *dict(config.environment).get("places", ()), config.goal]
    way = " to ".join(map(str, places)) if config.goal else "across the gap"
    console.print_line(f"way of {format_count(config.modules, 'module', 'modules')}: {way}")
    for where, drivers in result.held.items():
        counts = ", ".join(f"{name} {count}" for name, count in drivers.items())
        console.print_line(f"held of {TRIALS} trials, {where}: {counts}")
    for fault in result.list_faults():
        console.print_line(fault)
    console.print_line(f"page: {result.page.resolve()}")
    return {
        "folder": result.folder,
        "page": result.page,
        "verdict": dataclasses.asdict(result.verdict),
        "trials": TRIALS,
        "held": result.held,
        "start": config.start,
        "goal": config.goal,
        "modules": config.modules,
        "seconds": seconds,
    }


@dataclasses.dataclass(frozen=True, kw_only=True)
class Swarm(Experiment, TrustingCommand):
    """Let single robots, scattered before a pit that none of them can cross, become one body that crosses it.

    One meets the pit and becomes the seed; the others find its beacon, dock and lock; the organism crosses with an
    evolved champion in full contact; then all undock and go on. The same command again goes on where it was
    interrupted.

    Example: symbrion swarm --arena gsrm --out swarm
    """

    out: Path = Path("swarm")
    """Output folder: champion, track, timeline, film and figures."""
    arena: str = "gsrm"
    """Arena with a pit: a name, folder or file."""
    robots: int = 8
    """Number of robots, and length of the snake that they become."""
    champion: Path | None = None
    """Run folder or file of a champion of that length; by default one evolves in the arena."""

    def check(self) -> None:
        super().check()
        self.require_least(robots=2)

    def run(self, console: Console) -> dict[str, Any]:
        require_extras("`symbrion swarm`", "report")
        import symbrion_gym as sg
        from evolution._src.experiments.swarm.film import draw_timeline, encode_film
        from evolution._src.experiments.swarm.run import SwarmRunConfig, run_swarm
        from evolution._src.experiments.swarm.story import StoryConfig
        from evolution._src.report.figures import to_png
        from symbrion_gym._src.swarm.placing import find_field

        story = StoryConfig(arena=self.arena, seed=self.seed, num_robots=self.robots)
        config = SwarmRunConfig(self.out, story, self.champion, self.workers, self.allow_code)
        track, stories = run_swarm(config, console.track)
        first, arena, path = stories[0], sg.load_arena(self.arena), self.out / "film.mp4"
        field = find_field(arena, self.robots)
        crossing = None if first["crossed"] is None else (first["gathered"], first["crossed"])
        write_file(self.out / "timeline.png", to_png(draw_timeline(track, field, crossing)))
        if not path.exists():
            with console.track("film") as step:
                film = encode_film(track, arena, field, crossing, step.progress)
            if film is None:
                console.print_line("no film: this machine has no OpenGL")
            else:
                write_file(path, film)
        for each in stories:
            docking = "a swarm that docks" if each["docks"] else "one that may not dock"
            reason = f": {each['reason']}" if each["reason"] else ""
            console.print_line(f"{docking}: {each['across']} of {self.robots} robots across{reason}")
        console.print_line(f"The swarm {'is' if first['success'] else 'is not'} across; {self.out}")
        return {"folder": self.out, "success": first["success"], "stories": stories}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Paper(Experiment):
    """Repeat the experiments of the paper (Tables I-III, Figs. 3-7) and write a page that compares them with it.

    Each result is saved when it is finished: the same command continues where it was interrupted.

    Example: symbrion paper --quick --out paper
    """

    out: Path = Path("paper")
    """Output folder: report.html, results.json, figures, films, arenas. Finished experiments in it are not repeated."""
    quick: bool = False
    """Fewer sizes, runs and scans: about 3 minutes instead of 20 on two cores."""

    def run(self, console: Console) -> dict[str, Any]:
        require_extras("`symbrion paper`", "scan", "report")
        from evolution._src.experiments.folders import claim_folder
        from evolution._src.experiments.paper import MARKER, OUTPUTS, run_experiments
        from evolution._src.experiments.paper_page import write_paper_page
        from evolution._src.search.run import lock_folder

        report = self.out / "report.html"
        claim_folder(self.out, MARKER, {"quick": self.quick, "seed": self.seed}, OUTPUTS)
        with lock_folder(self.out):
            results = run_experiments(self.out, self.quick, self.seed, console.track, self.workers)
            write_json(self.out / "results.json", results)
            with console.track("figures and page"):
                write_paper_page(self.out, self.quick, self.seed, results)
        console.print_line(f"report: {report.resolve()}")
        return {
            "report": report,
            "results": self.out / "results.json",
            "held_in_truth": results["evolution"]["figures"]["judged"]["truth"],
            "physics_ratio": results["physics"]["figures"]["ratios"]["gg"]["physics_us"],
            "laser_ratio": results["laser"]["figures"]["ratios"]["tree"]["gg"],
            "seconds": {name: record["seconds"] for name, record in results.items()},
            "cpu_seconds": {name: record.get("cpu_seconds") for name, record in results.items()},
        }
