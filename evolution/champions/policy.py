"""A champion as a policy, in the form that reinforcement-learning libraries call."""

from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from evolution.controllers.controller import State, Structure, make_controller
from evolution.errors import RunError
from evolution.search.run import load_champion
from evolution.search.validation import Champion


class ChampionPolicy:
    """A policy that acts like the champion of a run; `predict` has the signature of stable-baselines3.

    Args:
        champion: champion of a run, or the path of one (folder or `champion.json`).
        structure: `observation_structure` of the environment in which it acts.

    Raises:
        RunError: no champion there, or the environment lacks a sensor that its controller reads.
    """

    def __init__(self, champion: Champion | str | Path, structure: Structure) -> None:
        self.champion = champion if isinstance(champion, Champion) else load_champion(champion)
        self._controller = make_controller(
            self.champion.controller, self.champion.modules, self.champion.controller_config
        )
        self._genotype = np.array(self.champion.genotype)
        self._controller.check(self._genotype)
        self._structure = structure
        missing = [name for name in self._controller.sensors if name not in structure]
        if missing:
            raise RunError(
                f"the observation lacks {', '.join(missing)}; make the environment with these sensors"
            )
        pitch = structure["pitch"]
        if pitch.stop - pitch.start != self.champion.modules:
            raise RunError(
                f"the champion has {self.champion.modules} modules, the environment {pitch.stop - pitch.start}"
            )

    def predict(
        self,
        observation: Float[np.ndarray, "*N O"],
        state: State | None = None,
        episode_start: Bool[np.ndarray, " N"] | None = None,
        deterministic: bool = True,
    ) -> tuple[Float[np.ndarray, "*N H"], State]:
        """Return the actions and the state to pass to the next call.

        Args:
            observation: observation of one environment, or one row for each of several.
            state: as returned by the previous call; None at the start.
            episode_start: True where an episode has just begun.
            deterministic: ignored, nothing is random; part of the signature.
        """
        rows = np.atleast_2d(observation)
        if state is None:
            state = self._controller.begin(len(rows))
        elif episode_start is not None:
            state = State(np.where(np.reshape(episode_start, (-1, 1)), 0, state.ticks_since_contact))
        action, state = self._controller.act(rows, self._genotype, self._structure, state)
        return (action if np.ndim(observation) == 2 else action[0]), state
