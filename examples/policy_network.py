"""A small network as a controller: what reinforcement learning trains, with its weights as the genotype.

    a = tanh(W_1 x + b_1),  b = tanh(W_2 a + b_2),  y = clip(W_3 b + b_3, -1, 1)

x are the angles of the hinges, then pitch and contact of each module, as observed. y are the targets of the hinges as
shares of their range, a change of the speed ahead and a rate of turn: a network
of zeros drives straight ahead. A decision is held for `HOLD` ticks.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from evolution._src.controllers.joints import make_drive
from evolution._src.controllers.protocol import Structure
from symbrion_gym._src.robot.organism import Organism

UNITS = (32, 32)  # Units of the hidden layers
HOLD = 5  # Ticks for which a decision is held: 0.1 s, as in `examples/train_ppo.py`
SENSORS = ("hinge_angle", "pitch", "contact")  # Parts of the observation that are the inputs, in this order
LARGEST_WEIGHT = 1e3  # Bound of a gene; the scales of the inputs are part of the first weights


class HeldDecision(NamedTuple):
    """The memory of the policy."""

    age: Int[np.ndarray, " P"]  # ticks since the decision
    action: Float[np.ndarray, "P A"]  # what it was


class PolicyNetwork:
    """The policy for a body: it follows `Controller`."""

    name, version, sensors = "policy_network", "1", SENSORS

    def __init__(self, organism: Organism, num_tracks: int = 0) -> None:
        self._drive = make_drive(organism, num_tracks, LARGEST_WEIGHT)
        self.num_hinges = len(organism.servos)
        self._num_actions = self.num_hinges + num_tracks
        num_inputs = self.num_hinges + 2 * organism.num_modules
        self.sizes = (num_inputs, *UNITS, self.num_hinges + len(self._drive.genes))
        count = sum((below + 1) * above for below, above in pairwise(self.sizes))
        self.parameters = tuple(f"weight_{index}" for index in range(count))
        self.lower, self.upper = (-LARGEST_WEIGHT,) * count, (LARGEST_WEIGHT,) * count
        self.initial = (0.0,) * count

    def begin(self, count: int) -> HeldDecision:
        """Return the state before the first decision."""
        return HeldDecision(np.full(count, HOLD), np.zeros((count, self._num_actions)))

    def act(
        self,
        observation: Float[np.ndarray, "P O"],
        genotype: Float[np.ndarray, "P G"],
        structure: Structure,
        state: HeldDecision,
    ) -> tuple[Float[np.ndarray, "P A"], HeldDecision]:
        """Return the actions, decided again where the last decision is old."""
        is_due = state.age >= HOLD
        inputs = np.concatenate([observation[:, structure[name]] for name in self.sensors], axis=1)
        decided = self.find_actions(self._think(inputs.astype(float), genotype))
        action = np.where(is_due[:, None], decided, state.action)
        return action, HeldDecision(np.where(is_due, 1, state.age + 1), action)

    def find_actions(self, outputs: Float[np.ndarray, "P Y"]) -> Float[np.ndarray, "P A"]:
        """Return hinge targets and track speeds of outputs of the network."""
        outputs = np.clip(outputs, -1.0, 1.0)
        hinges, speeds = outputs[:, : self.num_hinges], outputs[:, self.num_hinges :]
        speed, turn = np.pad(speeds, ((0, 0), (0, 2 - speeds.shape[1]))).T[:, :, None]
        return np.concatenate([hinges, self._drive.run(np.clip(1.0 + speed, -1.0, 1.0), turn)], axis=1)

    def _think(
        self, inputs: Float[np.ndarray, "P I"], genotype: Float[np.ndarray, "P G"]
    ) -> Float[np.ndarray, "P Y"]:
        """Return the outputs before they are clipped, each row of its own weights alone."""
        values, begin = inputs, 0
        for layer, (below, above) in enumerate(pairwise(self.sizes)):
            end = begin + below * above
            weights = genotype[:, begin:end].reshape(-1, above, below)
            values = np.sum(weights * values[:, None, :], axis=2) + genotype[:, end : end + above]
            values = np.tanh(values) if layer < len(UNITS) else values
            begin = end + above
        return values
