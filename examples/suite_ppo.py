"""Submit to the benchmark suite: train PPO (stable-baselines3) on each task, and write what it learns as a submission.

    pip install "symbrion-gym[rl]"
    python examples/suite_ppo.py --out ppo.json
    cd examples && symbrion bench-suite board ../ppo.json --allow-code policy_network --out ../board.html

The policy is a network of 2 x 32 units (tanh). It is trained on the scanned arena alone, for the budget of the suite.
Its weights are the genotype of the controller in `policy_network.py` beside this file, in pure NumPy,
so that it is tried without PyTorch.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from policy_network import HOLD, UNITS, PolicyNetwork
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper, VecNormalize

from evolution._src.backends.rollout import make_environment_options
from evolution._src.search.run import describe_origin
from evolution._src.suite.baselines import LEARNING_SEED
from evolution.suite import BUDGET, SEEDS, SUITE, Entry, SuiteTask, fill_submission, find_suite_task
from symbrion_gym._src.environment.config import count_tracks
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym._src.environment.stable_baselines_env import StableBaselinesEnv
from symbrion_gym._src.robot.body_plans import organism_to_text

CONTROLLER = "policy_network:PolicyNetwork"
TICK, NUM_ENVS, STEPS = (
    0.02,
    8,
    64,
)  # Seconds of a tick; simulations side by side, decisions of each between updates
POLICY = {"net_arch": list(UNITS), "log_std_init": -1.0, "activation_fn": torch.nn.Tanh}
SETTINGS: dict[str, Any] = {"n_steps": STEPS, "batch_size": 128, "gamma": 0.995, "learning_rate": 1e-3}


class Steered(VecEnvWrapper):
    """An environment whose actions are the outputs of the network: hinges, a change of the speed ahead, a turn."""

    def __init__(self, envs: VecEnv, network: PolicyNetwork) -> None:
        super().__init__(envs, action_space=spaces.Box(-1.0, 1.0, (network.sizes[-1],)))
        self._network = network

    def step_async(self, actions: np.ndarray) -> None:
        """Drive the tracks as the controller will."""
        self.venv.step_async(self._network.find_actions(actions))

    def step_wait(self):
        """Step all environments."""
        return self.venv.step_wait()

    def reset(self):
        """Reset all environments."""
        return self.venv.reset()


def make_envs(task: SuiteTask, trials: Any, network: PolicyNetwork, seed: int) -> VecNormalize:
    """Return the environments of a task: its scanned arena, under the conditions of its trials."""
    random = trials.randomization
    ranges = {name: getattr(random, name) for name in ("friction", "torque_scale", "start_offset", "yaw")}
    options = make_environment_options(trials) | {"frame_skip": 4 * HOLD, "randomize": ranges}
    envs = StableBaselinesEnv(
        OrganismVectorEnv(NUM_ENVS, num_threads=1, autoreset_mode=AutoresetMode.SAME_STEP, **options)
    )
    envs.seed(1000 * (seed + 1))
    return VecNormalize(Steered(envs, network), clip_obs=np.inf, gamma=SETTINGS["gamma"])


def train(task: SuiteTask, seed: int, seconds: float = BUDGET) -> Entry:
    """Return what PPO learns within a simulated time."""
    trials = task.make_trials(task.find_scan(), task.body, CONTROLLER, 1, (LEARNING_SEED,))
    organism = trials.find_organism()
    tracks = count_tracks(task.make_options()["track_control"], organism.num_modules)
    network = PolicyNetwork(organism, tracks)
    envs = make_envs(task, trials, network, seed)
    model = PPO("MlpPolicy", envs, policy_kwargs=POLICY, seed=seed, device="cpu", **SETTINGS)
    model.learn(int(seconds / (HOLD * TICK)) // (STEPS * NUM_ENVS) * STEPS * NUM_ENVS)  # whole rollouts
    spent = model.num_timesteps * HOLD * TICK
    genes = extract_weights(model, envs)
    envs.close()
    return Entry(task.name, seed, organism_to_text(organism), CONTROLLER, tuple(genes.tolist()), spent)


def extract_weights(model: PPO, envs: VecNormalize) -> np.ndarray:
    """Return the weights of the policy, layer by layer, with the scaling of the observations in the first."""
    actor = model.policy
    layers = [*(each for each in actor.mlp_extractor.policy_net if hasattr(each, "weight")), actor.action_net]
    pairs = [(each.weight.detach().numpy(), each.bias.detach().numpy()) for each in layers]
    (weight, bias), rest = pairs[0], pairs[1:]
    scale = 1.0 / np.sqrt(envs.obs_rms.var + envs.epsilon)
    first = weight * scale, bias - (weight * scale) @ envs.obs_rms.mean
    return np.concatenate([np.concatenate([w.ravel(), b]) for w, b in (first, *rest)]).astype(float)


def main() -> None:
    """Train on tasks with seeds, and write the submission after each."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, nargs="+", help="all of each task unless given")
    parser.add_argument("--tasks", nargs="+", default=[task.name for task in SUITE])
    parser.add_argument("--out", type=Path, default=Path("ppo.json"))
    options = parser.parse_args()
    torch.set_num_threads(1)
    tasks = [find_suite_task(name) for name in options.tasks]
    pairs = [(task, seed) for task in tasks for seed in options.seeds or SEEDS]
    provenance = describe_origin() | {"method": "ppo", "settings": SETTINGS, "budget": BUDGET}
    done = fill_submission("ppo", train, pairs, provenance, options.out, lambda what, share: print(what))
    print(f"{options.out}: {len(done.entries)} entries")


if __name__ == "__main__":
    main()
