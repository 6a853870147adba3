"""What a robot has learned on a site, and how it is judged."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import symbrion_gym as sg
    from evolution._src.search.cmaes import Run
    from symbrion_gym._src.arenas.verdict import Verdict

TRIALS = 20  # Trials in each arena of the champion, and of what it is compared with
GOOD = 0.9  # Share of them that a good champion holds


@dataclass(frozen=True, eq=False)
class Training:
    """What a robot has learned on a site.

    Attributes:
        folder: where all of it is kept.
        arena: model of the first half of the readings, or the mesh, in which the controller evolved.
        other: model of the other half; of a mesh or an arena folder, which have no readings, that of a scan of it.
        verdict: whether the first model is good for a robot, with what the other half does not confirm.
        run: the evolution; `run.champion` drives.
        held: where ("training", "other half" or "scan of it", "truth" where it is known) -> who drives ("champion",
            "doing nothing", "tracks forward") -> successes in `TRIALS` trials with fresh conditions.
        page: the report.
    """

    folder: Path
    arena: sg.Arena
    other: sg.Arena
    verdict: Verdict
    run: Run
    held: dict[str, dict[str, int]]
    page: Path

    def list_faults(self) -> list[str]:
        """Return in words what keeps the champion from being a good one."""
        champion = min(drivers["champion"] for drivers in self.held.values())
        straight = max(drivers["tracks forward"] for drivers in self.held.values())
        faults = []
        if champion < GOOD * TRIALS:
            faults.append(
                f"it holds in fewer than {GOOD * TRIALS:.0f}: a shorter way, or another --seed in a new --out, may do"
            )
        if TRIALS - straight < GOOD * TRIALS:
            faults.append(
                f"tracks forward hold in {straight}, too: such a way needs no steering, one with a turn does"
            )
        return [f"not a good champion: {fault} (--start X Y --goal X Y)" for fault in faults]

    @property
    def held_in_training(self) -> int:
        """Successes of the champion in the model in which it evolved."""
        return self.held["training"]["champion"]

    @property
    def held_in_other_half(self) -> int:
        """Successes of the champion in the model that evolution has not seen."""
        return list(self.held.values())[1]["champion"]
