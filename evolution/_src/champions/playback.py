"""Champions after a run: judged by new randomized trials, or played back once and filmed."""

import logging
import time
from collections.abc import Collection
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float, UInt8

from evolution._src.backends.cluster import make_backend
from evolution._src.backends.rollout import make_environment_options
from evolution._src.backends.scoring import Outcome
from evolution._src.backends.settings import BodyConfig, EpisodeConfig, Randomization, take_fields
from evolution._src.backends.trials import Job, Trials, find_trial_controller
from evolution._src.controllers.protocol import Structure, check_genotypes, reset_rows
from evolution._src.errors import RunError
from evolution._src.references import MAX_TRIALS
from evolution._src.search.run import load_champion
from evolution._src.search.validation import Champion
from reconstruction._src.base.range_checks import as_integers
from symbrion_gym._src.environment.organism_env import OrganismEnv

if TYPE_CHECKING:
    from evolution._src.backends.settings import Point
    from evolution._src.backends.trials import ArenaSource

UNSTRETCHED = Randomization(stretch=(1.0,))  # Conditions of `judge`: the length of the arena is known
_JUDGE_SEED = 0x6A75
"""Second word of the seed of `judge`: a run draws the conditions of its own trials from other seeds."""

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Recording:
    """One trial, tick by tick.

    Attributes:
        success: whether the strict success check passed.
        progress: progress of the whole body [m].
        seconds: simulated [s].
        positions: centers of the modules, head first, at every tick [m].
        rotations: module -> world, at every tick.
        frames: images; empty where nothing was filmed.
        fps: frames a second at which the film runs at `speed` times real time.
    """

    success: bool
    progress: float
    seconds: float
    positions: Float[np.ndarray, "T n 3"]
    rotations: Float[np.ndarray, "T n 3 3"]
    frames: list[UInt8[np.ndarray, "H W 3"]]
    fps: int


def judge(
    champion: Champion,
    arena: "ArenaSource" = "truth",
    trials: int = 20,
    seed: int = 0,
    *,
    start: "str | Point | None" = None,
    randomization: Randomization = UNSTRETCHED,
    workers: int = 1,
    allow: Collection[str] = (),
) -> Outcome:
    """Try a champion in randomized trials: start, yaw, friction and torque differ.

    Args:
        champion: champion to try, with genotype, controller and body.
        arena: a name, folder or `Arena`.
        trials: number of trials.
        seed: seed of the conditions.
        start: "floor", "pit" or (x, y) [m]; None: as in the run where that had a place or a task, else "floor".
        randomization: ranges of the conditions; by default the arena is not stretched.
        workers: number of threads.
        allow: modules of yours that a champion from a file names and that may be imported.

    Returns:
        The outcome; `successes` of its `trials` succeeded.

    Raises:
        RunError: the environment cannot be made, or trials or seed is out of range.
    """
    (trials,) = as_integers("trials", [trials], 1, MAX_TRIALS, RunError)
    (seed,) = as_integers("seed", [seed], 0, np.inf, RunError)
    conditions = make_champion_trials(
        champion,
        arena,
        start,
        count=trials,
        seed=(seed, _JUDGE_SEED),
        randomization=randomization,
        allow=allow,
    )
    backend = make_backend("batch", workers)
    (outcome,) = backend.run([Job(np.array(champion.genotype), conditions)])
    return outcome


def play(
    champion: Champion,
    arena: "ArenaSource" = "truth",
    seed: int = 0,
    *,
    start: "str | Point | None" = None,
    film: bool = False,
    window: bool = False,
    speed: float = 5.0,
    fps: int = 20,
    size: tuple[int, int] = (640, 400),
    allow: Collection[str] = (),
) -> Recording:
    """Play one trial under nominal conditions and record it.

    Args:
        champion: champion to try, with genotype, controller and body.
        arena: a name, folder or `Arena`.
        seed: seed of the environment.
        start: as of `judge`.
        film: also render; where there is no OpenGL, a warning is logged and there are no frames.
        window: show it in MuJoCo's viewer instead; where there is no display, a warning is logged.
        speed: speed of film and window, relative to the robot.
        fps: frames a second.
        size: width and height of a frame [pixel].
        allow: as of `judge`.

    Raises:
        ValueError: the environment cannot be made; `ArenaError` and `OrganismError` are among them.
    """
    conditions = make_champion_trials(champion, arena, start, allow)
    controller, genotype = find_trial_controller(conditions), np.array(champion.genotype)[None]
    mode, (width, height) = "human" if window else "rgb_array", size
    options = make_environment_options(conditions)
    positions, rotations, frames = [], [], []
    film, ended = film and not window, False
    with closing(OrganismEnv(mode, width, height, **options)) as environment:
        observation, info = environment.reset(seed=seed)
        state = controller.begin(1)
        ticks_per_frame = max(1, round(speed / (fps * environment.dt)))
        began = time.perf_counter()
        while not ended:
            if window:  # wait for the time of the film
                time.sleep(max(0.0, float(info["time"]) / speed - (time.perf_counter() - began)))
            if film and len(positions) % ticks_per_frame == 0:
                try:
                    frames.append(np.asarray(environment.render()))
                except Exception as error:  # whatever a graphics driver raises
                    reason = type(error).__name__, error
                    logger.warning("no video: OpenGL cannot be used here (%s: %s)", *reason)
                    film = False
            actions, state = controller.act(
                observation[None], genotype, environment.observation_structure, state
            )
            observation, _, terminated, truncated, info = environment.step(actions[0])
            physics = environment.physics
            positions.append(physics.position[0].copy())
            rotations.append(physics.rotation[0].reshape(-1, 3, 3).copy())
            ended = terminated or truncated
    return Recording(
        success=bool(info["success"]),
        progress=float(info["progress"]),
        seconds=float(info["time"]),
        positions=np.array(positions),
        rotations=np.array(rotations),
        frames=frames,
        fps=fps,
    )


def make_champion_trials(
    champion: Champion,
    arena: "ArenaSource",
    start: "str | Point | None" = None,
    allow: Collection[str] = (),
    **others: Any,
) -> Trials:
    """Return trials of a champion: its body, its controller and its task, all found again in the arena."""
    champion = champion.restore(allow)
    settings = take_fields(champion, EpisodeConfig, BodyConfig) | {"arena": arena}
    if start is None and isinstance(champion.find_start(), str):
        start = "floor"
    if start is not None:
        settings["start"] = start
    return Trials(**settings, **others)


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
        self.champion = loaded.restore(allow)
        self._organism = self.champion.find_organism()
        self._controller = self.champion.make_controller(self._organism)
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
