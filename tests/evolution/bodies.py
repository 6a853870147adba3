"""Bodies and observations that tests of controllers share."""

import numpy as np

from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.organism import Docking, Organism, cross, letter_h, snake


def make_random_tree(num_modules: int, seed: int) -> Organism:
    """Return modules docked at random, by any docks, without overlap."""
    rng = np.random.default_rng(seed)
    sides = ("front", "back", "left", "right")
    organism = Organism(1)
    while organism.num_modules < num_modules:
        new, other = organism.num_modules, int(rng.integers(organism.num_modules))
        first, second = rng.choice(sides, 2)
        try:
            organism = Organism(new + 1, (*organism.dockings, Docking(new, str(first), other, str(second))))
        except OrganismError:
            continue
    return organism


TREES = {
    "cross": cross(1),
    "h": letter_h(),
    "tree_5": make_random_tree(5, 1),
    "tree_7": make_random_tree(7, 2),
    "tree_9": make_random_tree(9, 3),
    "snake_2": snake(2),
    "snake_8": snake(8),
}
"""Bodies that every law moves."""


def make_structure(organism: Organism) -> tuple[dict[str, slice], int]:
    """Return the layout and the size of an observation of what laws read."""
    num_hinges, count = len(organism.hinges), organism.num_modules
    sizes = {
        "hinge_angle": num_hinges,
        "pitch": count,
        "roll": count,
        "contact": count,
        "track_odometry": 1,
        "goal_direction": 2,
    }
    structure, start = {}, 0
    for name, size in sizes.items():
        structure[name] = slice(start, start + size)
        start += size
    return structure, start


def make_observations(organism: Organism, count: int, seed: int) -> np.ndarray:
    """Return random observations, one per row; about a third of the modules touch nothing."""
    structure, size = make_structure(organism)
    rng = np.random.default_rng(seed)
    observation = rng.normal(0.0, 0.5, (count, size))
    contact = observation[:, structure["contact"]]
    observation[:, structure["contact"]] = np.where(rng.random(contact.shape) < 0.35, 0.0, np.abs(contact))
    return observation
