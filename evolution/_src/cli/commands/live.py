"""`symbrion live`: a robot updates the model of a place that has changed."""

import dataclasses
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evolution._src.cli.arguments import check_modules
from evolution._src.cli.command import SeededCommand, UsageError, require_writable_folder
from evolution._src.cli.console import Console
from evolution._src.errors import RunError
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.extras import require_extras

if TYPE_CHECKING:
    from evolution._src.experiments.live.ground import FeltFriction

MILLIMETERS = 1000.0


@dataclasses.dataclass(frozen=True, kw_only=True)
class Live(SeededCommand):
    """Let a Scout find what has changed in a course since its scan: its readings update the model, where it changed.

    The course is surveyed, a champion evolves in its model; then a box is gone, another is there, the far wall of the
    pit has moved, and there is ice on the floor. A Scout drives around, and three docked ones feel the ground; their
    laser and infrared readings and their slip go to `refine`, the arena is built again only where it changed, and the
    champion is judged in both models and in the truth. The same command again goes on where it was interrupted.

    Example: symbrion live --out live
    """

    out: Path = Path("live")
    """Output folder: models, arenas, readings, picture and figures."""
    widening: float = 0.1
    """By how much the far wall of the pit has moved away [m]."""
    ice: float = 0.2
    """Friction of the ice; that of the other ground is 0.7."""
    pit: float = 0.4
    """Width of the pit before [m]."""
    modules: int = 8
    """Number of modules of the champion."""
    units: int = 2200
    """Neurons of the network."""
    generations: int = 4
    """Limit on the generations of the evolution in the model before."""
    trials: int = 20
    """Randomized trials in which the champion is judged in each arena."""
    workers: int = os.cpu_count() or 1
    """Threads; the results do not depend on their number."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_writable_folder(self.out, "--out")
        check_modules(self.modules)
        for option in ("units", "generations", "trials", "workers"):
            if getattr(self, option) < 1:
                raise UsageError(f"--{option} {getattr(self, option)} is too few; give 1 or more")
        for option in ("pit", "widening"):
            if not getattr(self, option) >= 0:
                raise UsageError(f"--{option} {getattr(self, option)} is no length; give 0 or more")
        if not 0 < self.ice <= 1:
            raise UsageError(f"--ice {self.ice} is no friction of ice; give above 0, up to 1")

    def run(self, console: Console) -> dict[str, Any]:
        require_extras("`symbrion live`", "scan", "report")
        from evolution._src.experiments.live.live import LiveConfig, run_live
        from evolution._src.experiments.live.pictures import draw_models
        from evolution._src.experiments.live.scene import DEFAULT_ICE, SceneConfig
        from evolution._src.report.pictures import to_png

        try:
            ice = dataclasses.replace(DEFAULT_ICE, friction=self.ice)
            scene = SceneConfig(pit=self.pit, widening=self.widening, ice=ice)
        except RunError as error:
            raise UsageError(f"--widening {self.widening}: {error}") from error
        config = LiveConfig(
            self.out,
            self.seed,
            scene,
            modules=self.modules,
            units=self.units,
            generations=self.generations,
            trials=self.trials,
            workers=self.workers,
        )
        result = run_live(config, console.track)
        picture = self.out / "models.png"
        with write_atomically(picture) as beside:
            beside.write_bytes(to_png(draw_models(result, scene)))
        rows: list[list[object]] = [
            [name, f"{before * MILLIMETERS:.1f}", f"{after * MILLIMETERS:.1f}"]
            for name, (before, after) in result.errors.items()
        ]
        columns = ["change", "model before [mm]", "model after [mm]"]
        console.show_table("Mean distance of the true surface from the model", columns, rows)
        _show_friction(console, result.friction)
        console.show_table(
            "Successes of the champion, of no control, and of a random one",
            ["control", *next(iter(result.successes.values()))],
            [
                [control, *(f"{count} of {result.trials}" for count in found.values())]
                for control, found in result.successes.items()
            ],
        )
        update = result.update
        again = update.get("built_again", "")
        kept = (
            f"all contact was built again: {again}"
            if again
            else f"{update.get('kept')} pieces stayed as they were"
        )
        console.print_line(f"arena after the drive: {kept}; {picture}")
        return {"folder": self.out, **result.as_dict()}


def _show_friction(console: Console, friction: dict[str, "FeltFriction"]) -> None:
    rows: list[list[object]] = [
        [
            name,
            f"{felt.truth:.2f}",
            f"{felt.before:.2f}",
            f"{felt.after:.2f} ± {felt.half_width:.2f}",
            f"{felt.error_before:.3f}",
            f"{felt.error_after:.3f}",
        ]
        for name, felt in friction.items()
    ]
    columns = ["ground", "truth", "model before", "model after", "mean error before", "mean error after"]
    console.show_table("Friction of the ground on this side of the pit", columns, rows)
