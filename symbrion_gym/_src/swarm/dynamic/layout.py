"""Which robots form one body of the model, and which latched docks are held by a weld instead."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from symbrion_gym._src.robot.organism import Docking, Organism
from symbrion_gym._src.robot.scout_constants import ScoutConfig
from symbrion_gym._src.swarm.docks import find_groups, make_organism, sort_links


@dataclass(frozen=True)
class OpenOrganism(Organism):
    """An organism in which some arms move although nothing of it is docked to them.

    Attributes:
        open_arms: modules with such an arm.
    """

    open_arms: tuple[int, ...] = ()

    @property
    def hinges(self) -> tuple[int, ...]:
        """Modules whose hinge works, in order."""
        return tuple(sorted({*super().hinges, *self.open_arms}))


class Tree(NamedTuple):
    """Robots that are one tree of bodies in the model.

    Attributes:
        robots: which robot is which module.
        organism: what they form; None for a lone Scout, whose arm is free.
    """

    robots: tuple[int, ...]
    organism: Organism | None

    @property
    def is_organism(self) -> bool:
        """Whether it is the very tree of an `Organism`: docked robots whose free arms are folded."""
        return self.organism is not None and not isinstance(self.organism, OpenOrganism)

    @property
    def prefix(self) -> str:
        """What the names of its parts begin with."""
        return f"robot_{self.robots[0]}_"


class Layout(NamedTuple):
    """How a model holds the robots; hashable.

    Attributes:
        trees: every robot is in one of them.
        welds: latched docks between different trees.
    """

    trees: tuple[Tree, ...]
    welds: tuple[Docking, ...]


@lru_cache(maxsize=256)
def find_layout(
    links: tuple[Docking, ...],
    welds: tuple[Docking, ...],
    open_arms: frozenset[int],
    num_robots: int,
    scout: ScoutConfig,
) -> Layout:
    """Return the layout in which all links but the welded ones are parts of trees."""
    welds = sort_links(welds)
    rigid = [link for link in links if link not in welds]
    groups = find_groups(rigid, num_robots)
    moving = set(open_arms) | {robot for link in welds for robot, side in link.ends if side == "front"}
    trees = []
    for first in np.unique(groups):
        members = np.flatnonzero(groups == first).tolist()
        if len(members) == 1:
            trees.append(Tree((members[0],), None))
            continue
        inside = [link for link in rigid if link.first in members]
        organism, order = make_organism(inside, members, scout)
        arms = tuple(module for module, robot in enumerate(order) if robot in moving)
        if arms:
            organism = OpenOrganism(organism.num_modules, organism.dockings, scout, arms)
        trees.append(Tree(order, organism))
    return Layout(tuple(trees), welds)
