"""Controllers of a user, in a module that workers import as well."""

from dataclasses import dataclass

import numpy as np

from symbrion_gym._src.robot.organism import Organism


class Wave:
    """Hinges oscillate; the state is one array."""

    name, version, sensors = "wave", "3", ("hinge_angle",)
    parameters, lower, upper, initial = ("size", "lag"), (0.0, -3.0), (1.0, 3.0), (0.3, 0.0)

    def __init__(self, organism: Organism) -> None:
        self.num_hinges = len(organism.hinges)

    def begin(self, count):
        return np.zeros((count, 1))

    def act(self, observation, genotype, structure, state):
        phase = state - genotype[:, 1:] * np.arange(self.num_hinges)
        return genotype[:, :1] * np.sin(phase), state + 0.1


def make_wave(organism):
    """Return a controller, as a function of the organism."""
    return Wave(organism)


def make_driving_wave(organism, num_tracks):
    """Return a controller whose tracks run backward."""
    wave = Wave(organism)
    wave.act = lambda observation, genotype, structure, state: (
        -np.ones((len(observation), wave.num_hinges + num_tracks)),
        state,
    )
    return wave


@dataclass(frozen=True)
class Hold:
    """Hinges keep an angle; no state."""

    num_hinges: int
    angle: float = 0.2
    name = "hold"
    version = "1"
    sensors = ()
    parameters = lower = upper = initial = ()

    def begin(self, count):
        return ()

    def act(self, observation, genotype, structure, state):
        return np.full((len(observation), self.num_hinges), self.angle), state


hold_4 = Hold(4)


def fail(organism):
    """Cannot make a controller of any organism."""
    raise ZeroDivisionError("no legs")
