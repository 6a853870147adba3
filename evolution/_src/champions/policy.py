"""A champion as a policy, in the form that reinforcement-learning libraries call."""

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from evolution._src.controllers.protocol import Structure, check_genotypes, reset_rows
from evolution._src.errors import RunError
from evolution._src.search.run import load_champion
from evolution._src.search.stored_config import restore
from evolution._src.search.validation import Champion


class ChampionPolicy:
    """A policy that acts like the champion of a run; `predict` has the signature of stable-baselines3.

    Args:
        champion: champion of a run, or the path of one (folder or `champion.json`).
        structure: `observation_structure` of the environment in which it acts.
        allow: modules of yours that a champion from a file names and that may be imported.

    Raises:
        RunError: no champion there, or the environment lacks a sensor that its controller reads.
    """

    def __init__(
        self, champion: Champion | str | Path, structure: Structure, allow: Collection[str] = ()
    ) -> None:
        loaded = champion if isinstance(champion, Champion) else load_champion(champion)
        self.champion = restore(loaded, allow)
        self._organism = self.champion.body.find_organism()
        self._controller = self.champion.control.make_controller(self._organism, self.champion.episode)
        self._genotype = np.array(self.champion.genotype)
        check_genotypes(self._controller, self._genotype)
        self._structure = structure
        missing = [name for name in self._controller.sensors if name not in structure]
        if missing:
            raise RunError(
                f"the observation lacks {', '.join(missing)}; make the environment with these sensors"
            )
        self._check_body(structure)

    def _check_body(self, structure: Structure) -> None:
        """Refuse an environment whose body has another number of modules or hinges."""
        counts = {"pitch": self._organism.num_modules, "hinge_angle": len(self._organism.servos)}
        for name, count in counts.items():
            part = structure.get(name, slice(0, count))
            if part.stop - part.start != count:
                what = "modules" if name == "pitch" else "joints"
                raise RunError(f"the champion has {count} {what}, the environment {part.stop - part.start}")

    def predict(
        self,
        observation: Float[np.ndarray, "*N O"],
        state: Any = None,
        episode_start: Bool[np.ndarray, " N"] | None = None,
        deterministic: bool = True,
    ) -> tuple[Float[np.ndarray, "*N A"], Any]:
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
            state = reset_rows(self._controller, state, np.reshape(episode_start, -1).astype(bool))
        genotypes = np.broadcast_to(self._genotype, (len(rows), len(self._genotype)))
        action, state = self._controller.act(rows, genotypes, self._structure, state)
        return (action if np.ndim(observation) == 2 else action[0]), state
