"""Bodies and observations that tests of controllers share."""

import numpy as np

from evolution._src.controllers.controller import REACTIVE_GENES, make_law
from symbrion_gym._src.robot.body_plans import make_random_organism
from symbrion_gym._src.robot.organism import Organism, cross, letter_h, snake

TREES = {
    "cross": cross(1),
    "h": letter_h(),
    "tree_5": make_random_organism(5, np.random.default_rng(1)),
    "tree_7": make_random_organism(7, np.random.default_rng(2)),
    "tree_9": make_random_organism(9, np.random.default_rng(3)),
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


def make_reactive(**genes: float) -> np.ndarray:
    return np.array([[genes.get(name, 0.0) for name in REACTIVE_GENES]])


def act(law: str, organism: Organism, genotype, ticks: int = 1, **sensed) -> np.ndarray:
    """Return hinge targets [rad] after equal observations."""
    controller = make_law(law, organism)
    structure, size = make_structure(organism)
    observation = np.zeros((1, size))
    for name, values in sensed.items():
        observation[0, structure[name]] = values
    state, action = controller.begin(1), np.zeros((1, 0))
    for _ in range(ticks):
        action, state = controller.act(observation, np.atleast_2d(genotype), structure, state)
    return action[0] * organism.scout.hinge_range
