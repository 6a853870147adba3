"""Champions tried again: judged by fresh randomised trials, or played back once and filmed."""

import logging
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from evolution.backends.rollout import make_environment_options
from evolution.backends.trials import Job, Outcome, Randomisation, Trials
from evolution.controllers.controller import make_controller
from evolution.search.evaluation import make_backend
from evolution.search.validation import Champion
from symbrion_gym.environment.snake_pit import SnakePitEnv

AS_IT_IS = Randomisation(stretch=(1.0,))
"""Conditions of a judgement: the arena is not in doubt."""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Recording:
    """One trial, as it was seen.

    Attributes:
        success: whether the strict test held.
        progress: of the whole body [m].
        seconds: simulated [s].
        positions: `[T, n, 3]` centres of the modules, head first, at every tick [m].
        rotations: `[T, n, 3, 3]` module -> world.
        frames: `[H, W, 3]` images; empty where nothing was filmed.
        fps: frames a second at which the film runs at `speed` times real time.
    """

    success: bool
    progress: float
    seconds: float
    positions: np.ndarray
    rotations: np.ndarray
    frames: list[np.ndarray]
    fps: int


def judge(
    champion: Champion,
    arena: Any = "truth",
    trials: int = 20,
    seed: int = 0,
    *,
    start: str = "floor",
    randomisation: Randomisation = AS_IT_IS,
    workers: int = 1,
) -> Outcome:
    """Put a champion to randomised trials: start, yaw, friction and torque.

    Args:
        champion: genotype, controller and body.
        arena: where; a name, folder or `Arena`.
        trials: how many.
        seed: of the conditions.
        start: "floor" or "pit".
        randomisation: ranges of the conditions; the arena is as it is, unless they say otherwise.
        workers: threads.

    Returns:
        What happened; `successes` of `trials` held.
    """
    conditions = Trials(
        arena=arena,
        modules=champion.modules,
        controller=champion.controller,
        start=start,
        count=trials,
        seed=(seed, _JUDGE),
        randomisation=randomisation,
        environment=champion.environment,
    )
    backend = make_backend("batch", workers)
    (outcome,) = backend.run([Job(np.array(champion.genotype), conditions)])
    return outcome


_JUDGE = 0x6A75
"""Set apart from the seeds that a run draws its own conditions from."""


def play(
    champion: Champion,
    arena: Any = "truth",
    seed: int = 0,
    *,
    start: str = "floor",
    film: bool = False,
    window: bool = False,
    speed: float = 5.0,
    fps: int = 20,
    size: tuple[int, int] = (640, 400),
) -> Recording:
    """Play one trial under nominal conditions and keep what was seen.

    Args:
        champion: genotype, controller and body.
        arena: where; a name, folder or `Arena`.
        seed: of the environment.
        start: "floor" or "pit".
        film: also render; where there is no OpenGL, a warning is logged and there are no frames.
        window: show it in MuJoCo's viewer instead; where there is no display, a warning is logged.
        speed: film and window run so many times faster than the robot.
        fps: frames a second.
        size: width and height of a frame [pixel].
    """
    conditions = Trials(
        arena=arena,
        modules=champion.modules,
        controller=champion.controller,
        start=start,
        environment=champion.environment,
    )
    environment = SnakePitEnv(
        render_mode="human" if window else "rgb_array",
        width=size[0],
        height=size[1],
        **make_environment_options(conditions),
    )
    try:
        return _run(environment, champion, seed, film and not window, speed, fps)
    finally:
        environment.close()


def _run(
    environment: SnakePitEnv, champion: Champion, seed: int, film: bool, speed: float, fps: int
) -> Recording:
    controller = make_controller(champion.controller, champion.modules)
    genotype = np.array(champion.genotype)
    observation, info = environment.reset(seed=seed)
    state = controller.begin(1)
    positions, rotations, frames = [], [], []
    ticks_per_frame = max(1, round(speed / (fps * environment.dt)))
    progress, ended = 0.0, False
    is_shown, began = environment.render_mode == "human", time.perf_counter()
    while not ended:
        if is_shown:  # a window shows the robot at its pace
            time.sleep(max(0.0, float(info["time"]) / speed - (time.perf_counter() - began)))
        if film and len(positions) % ticks_per_frame == 0:
            film = _shoot(environment, frames)
        actions, state = controller.act(observation[None], genotype, environment.observation_structure, state)
        observation, _, terminated, truncated, info = environment.step(actions[0])
        physics = environment.physics
        positions.append(physics.position[0].copy())
        rotations.append(physics.rotation[0].reshape(-1, 3, 3).copy())
        progress, ended = float(info["progress"]), terminated or truncated
    return Recording(
        success=bool(info["success"]),
        progress=progress,
        seconds=float(info["time"]),
        positions=np.array(positions),
        rotations=np.array(rotations),
        frames=frames,
        fps=fps,
    )


def _shoot(environment: SnakePitEnv, frames: list[np.ndarray]) -> bool:
    """Add a frame; return whether to go on filming."""
    try:
        frame = environment.render()
    except Exception as error:  # whatever a graphics driver raises
        log.warning("no video: OpenGL cannot be used here (%s: %s)", type(error).__name__, error)
        return False
    frames.append(np.asarray(frame))
    return True
