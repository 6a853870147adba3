"""Which robots form one body of the model, and which latched docks are held by a weld instead."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from symbrion_gym.robot.organism import Docking, Organism
from symbrion_gym.robot.scout_constants import ScoutConfig
from symbrion_gym.swarm.docks import find_groups, make_organism, sort_links


class Tree(NamedTuple):
    """Robots that are one tree of bodies in the model.

    Attributes:
        robots: which robot is which module.
        organism: what they form; None for a lone Scout, whose arm is free.
    """

    robots: tuple[int, ...]
    organism: Organism | None

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


def find_layout(
    links: Iterable[Docking], welds: Iterable[Docking], num_robots: int, scout: ScoutConfig
) -> Layout:
    """Return the layout in which all links but the welded ones are parts of trees.

    Args:
        links: all latched docks.
        welds: those of them that are held by welds.
        num_robots: N.
        scout: constants of the robots.
    """
    welds = frozenset(welds)
    rigid = [link for link in links if link not in welds]
    groups = find_groups(rigid, num_robots)
    trees = []
    for first in np.unique(groups):
        members = np.flatnonzero(groups == first).tolist()
        if len(members) == 1:
            trees.append(Tree((members[0],), None))
            continue
        organism, order = make_organism(rigid_of(rigid, members), members, scout)
        trees.append(Tree(order, organism))
    return Layout(tuple(trees), sort_links(tuple(welds)))


def rigid_of(links: Iterable[Docking], members: list[int]) -> list[Docking]:
    """Return the links between members of a group."""
    inside = set(members)
    return [link for link in links if link.first in inside and link.second in inside]
