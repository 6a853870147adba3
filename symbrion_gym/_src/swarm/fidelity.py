"""One switch for the level of physics of a swarm."""

from __future__ import annotations

from typing import TYPE_CHECKING

from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.swarm.kinematic.kinematic_world import KinematicWorld

if TYPE_CHECKING:
    from symbrion_gym._src.arenas.arena import Arena
    from symbrion_gym._src.robot.scout_constants import ScoutConfig
    from symbrion_gym._src.swarm.docks import DockConfig
    from symbrion_gym._src.swarm.world import SwarmWorld

FIDELITIES = ("kinematic", "dynamic", "mixed")
"""All robots simply and fast; all in full contact; docked ones and those near them in full contact, the others not."""


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
    if fidelity == "dynamic":
        from symbrion_gym._src.swarm.dynamic.world import DynamicWorld

        return DynamicWorld(arena, num_robots, scout, docks)
    from symbrion_gym._src.swarm.mixed import MixedWorld

    return MixedWorld(arena, num_robots, scout, docks)
