"""Random organisms, for tests and as material of a search."""

from __future__ import annotations

import numpy as np

from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.organism import Docking, Organism
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig


def make_random_organism(
    num_modules: int, rng: np.random.Generator, scout: ScoutConfig | None = None
) -> Organism:
    """Return a tree of modules, each docked with a random side to a random free side of those before it.

    Args:
        num_modules: number of modules.
        rng: drawn from.
        scout: constants of the modules; None for the defaults.

    Raises:
        OrganismError: fewer than one module.
    """
    if num_modules < 1:
        raise OrganismError(f"an organism needs at least 1 module, got {num_modules}")
    body = Organism(1, scout=scout or ScoutConfig())
    while body.num_modules < num_modules:
        new = body.num_modules
        docking = Docking(new, str(rng.choice(SIDES)), int(rng.integers(new)), str(rng.choice(SIDES)))
        try:
            body = Organism(new + 1, (*body.dockings, docking), body.scout)
        except OrganismError:
            continue  # the side is taken, or the module would lie on another
    return body
