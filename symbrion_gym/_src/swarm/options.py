"""Options of the environment of a swarm."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from reconstruction._src.base.range_checks import check_not_negative, check_positive
from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.swarm.kinematic.kinematic_world import KinematicWorld

if TYPE_CHECKING:
    from symbrion_gym._src.arenas.arena import Arena
    from symbrion_gym._src.robot.scout_constants import ScoutConfig
    from symbrion_gym._src.swarm.docks import DockConfig
    from symbrion_gym._src.swarm.world import SwarmWorld

FIDELITIES = ("kinematic", "dynamic")  # All robots simply and fast; all in full contact


def check_fidelity(fidelity: str) -> None:
    """Refuse a level of physics that there is not."""
    if fidelity not in FIDELITIES:
        raise OptionError(f"no fidelity {fidelity!r}; there are: {', '.join(FIDELITIES)}")


def make_world(
    arena: Arena,
    num_robots: int,
    fidelity: str = "kinematic",
    scout: ScoutConfig | None = None,
    docks: DockConfig | None = None,
) -> SwarmWorld:
    """Return a world of robots at a level of physics; `reset` places them."""
    check_fidelity(fidelity)
    if fidelity == "kinematic":
        return KinematicWorld(arena, num_robots, scout, docks)
    from symbrion_gym._src.swarm.dynamic.world import DynamicWorld

    return DynamicWorld(arena, num_robots, scout, docks)


MOST_ROBOTS = 1000


@dataclass(frozen=True)
class SwarmOptions:
    """Options of `swarm_v0.parallel_env`.

    Raises:
        OptionError: a value is out of range.
    """

    arena: str | Path | Arena = "gsrm"  # a name, a folder, a mesh file or an `Arena` with a pit
    num_robots: int = 8  # robots, all Scouts
    duration: float = 900.0  # of an episode [s]
    success_bonus: float = 1.0  # reward of every robot once all are beyond the pit, undocked and upright
    noise: float = 1.0  # factor on the noise of the sensors; 0 for none
    fidelity: str = "kinematic"  # level of physics, one of `FIDELITIES`

    def __post_init__(self) -> None:
        count = self.num_robots
        if (
            isinstance(count, bool)
            or not isinstance(count, int | np.integer)
            or not 1 <= count <= MOST_ROBOTS
        ):
            raise OptionError(f"num_robots must be a whole number from 1 to {MOST_ROBOTS}, got {count!r}")
        for name in ("duration", "success_bonus", "noise"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float | np.number):
                raise OptionError(f"{name} must be a number, got {value!r}")
        check_positive(self, ("duration",), OptionError)
        check_not_negative(self, ("success_bonus", "noise"), OptionError)
        check_fidelity(self.fidelity)

    @classmethod
    def from_options(cls, options: dict[str, Any]) -> SwarmOptions:
        """Return options by name."""
        names = [field.name for field in fields(cls)]
        unknown = sorted(set(options) - set(names))
        if unknown:
            raise OptionError(f"no option {unknown[0]!r}; there are: {', '.join(names)}")
        return cls(**options)
