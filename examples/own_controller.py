"""An evolved controller of one's own: a sine wave runs along the hinges. Run: python examples/own_controller.py"""

import numpy as np

import evolution as ev


class Wave:
    name, version, sensors = "wave", "1", ("hinge_angle",)
    parameters, initial = ("size", "rate", "lag"), (0.3, 1.0, 1.0)
    lower, upper = (0.0, 0.0, -3.0), (0.8, 3.0, 3.0)

    def __init__(self, organism):
        self.hinges = np.arange(len(organism.hinges))

    def begin(self, count):
        return np.zeros((count, 1))  # the state: a time for each of `count` simulations

    def act(self, observation, genotype, structure, time):
        size, rate, lag = genotype.T[:, :, None]
        return size * np.sin(rate * time - lag * self.hinges), time + 0.02


if __name__ == "__main__":
    print(ev.evolve(ev.EvolutionConfig(controller=Wave, origin="hint", generations=4)).champion)
