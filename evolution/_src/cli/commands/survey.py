"""`symbrion survey`: scan an arena with the virtual robot."""

import dataclasses
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from jaxtyping import Float

import symbrion_gym as sg
from evolution._src.cli.command import (
    SeededCommand,
    UsageError,
    check_arena,
    require_own_archive,
    require_writable_file,
)
from evolution._src.cli.console import Console
from symbrion_gym._src.sensing.survey_robot import LaserScanner, SurveyRobot


@dataclasses.dataclass(frozen=True, kw_only=True)
class Survey(SeededCommand):
    """Drive a virtual robot with two SICK laser scanners through an arena, and save the scan log.

    Example: symbrion survey truth --out survey.npz

    Example: symbrion survey pit.ply --path="-1,1.6 0.2,2.8 1.4,1.6" --speed 0.5 --noise 0.01
    """

    arena: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ARENA")] = "truth"
    """A named arena (truth, simple, gsrm, gg, stairs), an arena folder, or a mesh file in meters, z up."""
    out: Path = Path("survey.npz")
    """Output file for the scan log (.npz)."""
    path: str | None = None
    """Waypoints: "X,Y X,Y ..." [m], or "$(cat FILE.csv)". Default: a zigzag around the arena."""
    speed: float = SurveyRobot.speed
    """Driving speed [m/s]; a lower speed gives more scans."""
    beams: int = LaserScanner.num_beams
    """Number of beams of a scan, over 180 degrees: 361 is one every half degree."""
    noise: float = LaserScanner.noise
    """Standard deviation of a reading at range 0 [m]; it grows by 0.5 mm per meter."""
    camera: bool = False
    """Color the readings by a camera beside the scanner. The arena must have colors; truth and stairs are painted."""
    friction: bool = False
    """Let docked Scouts drive over the arena as well and feel its friction by the slip of their tracks."""

    def check(self) -> None:
        super().check()
        check_arena(self.arena)
        require_writable_file(self.out, "--out", (".npz",))
        if self.out == Survey.out:
            require_own_archive(self.out, "--out", "ranges")
        self.require_least(beams=2, noise=0)
        self.require_positive("speed")
        if self.path is not None:
            read_path(self.path)

    def run(self, console: Console) -> dict[str, Any]:
        scanner = LaserScanner(num_beams=self.beams, noise=self.noise)
        with console.track(f"Survey of {self.arena}") as step:
            log = sg.survey(
                self.arena,
                path=None if self.path is None else read_path(self.path),
                sensor=SurveyRobot(scanner=scanner, speed=self.speed),
                seed=self.seed,
                progress=step.progress,
                camera=self.camera,
                friction=self.friction,
            )
            self.out.parent.mkdir(parents=True, exist_ok=True)
            log.save(self.out)
        scans, beams = log.ranges.shape
        console.print_line(f"{scans} scans of {beams} beams in {self.out}")
        console.print_line(f"next: symbrion reconstruct {self.out} --out surface.npz")
        slip = {} if log.slip is None else {"slip_ticks": len(log.slip)}
        return {"log": self.out, "scans": scans, "beams": beams, "seconds": step.seconds, **slip}


def read_path(text: str) -> Float[np.ndarray, "W 2"]:
    """Read waypoints from "X,Y X,Y ..." [m]."""
    try:
        waypoints = np.array([place.split(",") for place in text.split()], dtype=float)
    except ValueError as error:
        raise UsageError(f'--path {text}: not waypoints ({error}); give "X,Y X,Y ..."') from error
    if waypoints.ndim != 2 or waypoints.shape[1] != 2 or len(waypoints) < 2:
        raise UsageError(f'--path {text}: give two waypoints or more, each x and y, like "0,2 3,2"')
    if not np.isfinite(waypoints).all() or np.ptp(waypoints, axis=0).max() == 0:
        raise UsageError(f"--path {text}: waypoints must be finite and not all the same")
    return waypoints
