"""The plan of an organism as robots use it: who docks where, one robot after the other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Int

from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.robot.scout_constants import SIDES
from symbrion_gym._src.swarm.behavior.percepts import FRONT, NOBODY

MOST_ROLES = 60
"""Places of a plan: robots keep a bit for each."""


class Plan(NamedTuple):
    """Which place of an organism wants which other at each of its docks.

    Attributes:
        wanted: place that is to dock at each dock of a place, in the order of `SIDES`; NOBODY for none.
        everyone: bits of all places.
    """

    wanted: Int[np.ndarray, "n 4"]
    everyone: int

    @property
    def num_roles(self) -> int:
        """Number of robots that the organism needs."""
        return len(self.wanted)


def make_plan(organism: Organism) -> Plan:
    """Return the plan of an organism whose module 0 is the seed, and to which robots dock with their front docks."""
    if organism.num_modules > MOST_ROLES:
        raise OrganismError(f"a plan has at most {MOST_ROLES} robots, got {organism.num_modules}")
    wanted = np.full((organism.num_modules, len(SIDES)), NOBODY)
    parents = organism.parents
    for docking in organism.dockings:
        ends = dict(docking.ends)
        child = docking.second if parents[docking.second] == docking.first else docking.first
        parent = docking.first + docking.second - child
        if SIDES.index(ends[child]) != FRONT:
            raise OrganismError(
                f"robots dock with their front docks; module {child} would with its {ends[child]} dock"
            )
        wanted[parent, SIDES.index(ends[parent])] = child
    return Plan(wanted, (1 << organism.num_modules) - 1)
