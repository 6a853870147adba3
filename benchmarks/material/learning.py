"""Learning of registered environments by CMA-ES, PPO and SAC (of stable-baselines3), each until it succeeds.

A run ends when a policy has succeeded in 40 of 50 episodes from fresh starts, or when its budget is spent. Only
promising policies are judged on fresh starts, as that costs as much as learning; the judging is not counted.
"""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np

import symbrion_gym as sg
from benchmarks.material.learning_run import FRESH_SEED, Budget, Policy, Run
from benchmarks.material.simple_policy import GoalPolicy
from evolution._src.backends.parts import count_tracks
from evolution._src.controllers.controller import make_law
from evolution._src.controllers.protocol import Controller
from evolution._src.search.cmaes import Space, Strategy

FRAME_SKIP = 20
"""Physics steps of a decision of PPO and SAC: 0.1 s instead of 0.02."""
ALGORITHMS = ("cmaes", "ppo", "sac")
LAWS = {"Recover": "posture", "Reach": "goal", "Explore": "goal"}
"""Beginning of an id -> what CMA-ES searches the genotype of, where it is not the law `path`."""
_POPULATION, _TRIALS, _SIGMA = 16, 2, 0.5
_NUM_ENVS = {"ppo": 32, "sac": 16}
_RECENT = 100
"""Episodes of which the share of successes is taken while learning."""


def learn(name: str, algorithm: str, seed: int, budget: Budget) -> dict[str, Any]:
    """Learn an environment once; return what it took.

    Args:
        name: id of the environment.
        algorithm: one of `ALGORITHMS`.
        seed: of all random numbers.
        budget: what the run may spend.
    """
    run = Run(name, budget)
    if algorithm == "cmaes":
        return {**_evolve(run, seed), **run.describe()}
    _train(run, algorithm, seed)
    return run.describe()


def _find_controller(name: str) -> Controller:
    """Return what CMA-ES searches the genotype of, for the body of an id."""
    env: Any = gym.make(name).unwrapped
    short = name.removeprefix("symbrion_gym/")
    law = next((law for start, law in LAWS.items() if short.startswith(start)), "path")
    tracks = count_tracks(env.config.track_control, env.world.num_modules)
    body = env.world.organism
    return GoalPolicy(tracks) if law == "goal" else make_law(law, body, None, tracks)


def _evolve(run: Run, seed: int) -> dict[str, Any]:
    """Evolve genotypes from zero, each tried twice a generation on fresh starts."""
    controller = _find_controller(run.name)
    genes = len(controller.parameters)
    space = Space(controller.parameters, controller.lower, controller.upper, (0.0,) * genes, (1.0,) * genes)
    strategy = Strategy(space, _SIGMA, _POPULATION, seed)
    options: dict[str, Any] = {"sensors": tuple(controller.sensors)}
    envs: Any = None
    generation = 0
    while not run.is_over:
        genotypes = strategy.ask()
        rows = np.repeat(genotypes, _TRIALS, axis=0)
        if envs is None or envs.num_envs != len(rows):
            envs = gym.make_vec(
                run.name,
                num_envs=len(rows),
                vectorization_mode="vector_entry_point",
                autoreset_mode="Disabled",
                num_threads=1,
                **options,
            )
        scores, successes = _try(run, envs, controller, rows, FRESH_SEED * (seed + 2) + 1000 * generation)
        fitness = scores.reshape(-1, _TRIALS).mean(axis=1)
        strategy.tell(genotypes, fitness)
        best, generation = genotypes[int(np.argmax(fitness))], generation + 1
        share = float(successes.reshape(-1, _TRIALS).mean(axis=1)[np.argmax(fitness)])
        structure = envs.observation_structure
        run.note(
            share if share == 1.0 else 0.5 * share,
            lambda count, best=best, structure=structure: _follow(controller, best, structure, count),
            **options,
        )
    return {"controller": controller.name, "genes": genes, "generations": generation}


def _follow(controller: Controller, genotypes: np.ndarray, structure: Any, count: int) -> Policy:
    state: Any = controller.begin(count)
    genotypes = np.broadcast_to(genotypes, (count, genotypes.shape[-1]))

    def act(observation: np.ndarray) -> np.ndarray:
        nonlocal state
        actions, state = controller.act(observation, genotypes, structure, state)
        return actions

    return act


def _try(
    run: Run, envs: Any, controller: Controller, genotypes: np.ndarray, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return progress with 1 more for a success, and successes, of one genotype in each simulation."""
    observation, info = envs.reset(seed=seed)
    act = _follow(controller, genotypes, envs.observation_structure, len(genotypes))
    is_over = np.zeros(len(genotypes), dtype=bool)
    while not is_over.all():
        observation, _, terminated, truncated, info = envs.step(act(observation))
        is_over |= terminated | truncated
    run.robot_seconds += float(info["time"].sum())
    run.decisions += round(float(info["time"].sum()) / envs.config.dt)
    return info["progress"] + info["success"], info["success"].astype(float)


def _train(run: Run, algorithm: str, seed: int) -> None:
    """Train a policy of stable-baselines3 with ten decisions a second."""
    import torch
    from stable_baselines3 import PPO, SAC
    from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

    from benchmarks.material.learning_callback import Watcher

    torch.set_num_threads(1)
    adapted = sg.make_sb3_env(run.name, _NUM_ENVS[algorithm], seed=seed, frame_skip=FRAME_SKIP, num_threads=1)
    envs = VecNormalize(VecMonitor(adapted, info_keywords=("is_success",)), clip_obs=5.0, gamma=0.99)
    common = {"gamma": 0.99, "seed": seed, "device": "cpu"}
    if algorithm == "ppo":
        model: Any = PPO(
            "MlpPolicy", envs, n_steps=128, batch_size=1024, policy_kwargs={"log_std_init": -1.0}, **common
        )
    else:
        model = SAC("MlpPolicy", envs, learning_starts=2000, batch_size=256, gradient_steps=4, **common)
    seconds = adapted.envs.config.dt  # type: ignore[attr-defined]
    model.learn(10**9, callback=Watcher(run, envs, seconds, _RECENT, FRAME_SKIP))
    envs.close()
