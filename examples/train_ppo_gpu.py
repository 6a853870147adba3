"""Train PPO on a GPU: thousands of environments, policy and updates stay on the device, all in JAX.

    pip install "symbrion-gym[gpu]" "jax[cuda12]"
    python examples/train_ppo_gpu.py --device cuda:0
    python examples/train_ppo_gpu.py --backend mujoco --envs 64 --updates 50  # without a GPU

Without a GPU, MuJoCo's C engine steps the simulations several times as fast as Warp on a processor (`--device cpu`).
After training, the policy is judged on the C engine of MuJoCo, on starts that it has never met, beside zero and random
actions.
"""

import argparse
import time
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import gymnasium as gym
import jax
import jax.numpy as jnp
import numpy as np

import symbrion_gym as sg  # noqa: F401  registers the environments

ID = "symbrion_gym/SnakePit-v1"
OPTIONS: dict[str, Any] = {
    "modules": 8,
    "pit": 0.40,
    "start": "pit",
    "duration": 30.0,
    "stuck_time": 6.0,
    "frame_skip": 20,  # ten decisions per second
    "sensors": ("hinge_angle", "pitch", "roll", "ir", "contact", "odometry"),
    "randomize": {"friction": (0.55, 0.7), "start_offset": (-0.05, 0.05), "yaw": (-0.05, 0.05)},
}
FRESH_SEED = 10_000
"""Seeds of the starts on which policies are judged; training uses small ones."""


class Settings(NamedTuple):
    """Parameters of PPO (Schulman et al. 2017), with generalized advantages (Schulman et al. 2016)."""

    horizon: int = 32
    epochs: int = 6
    minibatches: int = 8
    discount: float = 0.995
    smoothing: float = 0.95
    clip: float = 0.2
    rate: float = 1e-3
    largest_gradient: float = 0.5
    entropy: float = 1e-3


class Learner(NamedTuple):
    """Weights, their moments (Kingma and Ba 2015: Adam), and the mean and variance of observations."""

    weights: Any
    first: Any
    second: Any
    count: Any
    mean: Any
    variance: Any
    seen: Any


class Batch(NamedTuple):
    """What a rollout leaves, `[horizon, envs, ...]` each."""

    observation: Any
    action: Any
    likelihood: Any
    advantage: Any
    wanted: Any


def make_learner(key: Any, observations: int, actions: int, hidden: int = 64) -> Learner:
    """Return fresh networks of two hidden layers, one for actions and one for values."""

    def make(key: Any, last: int, scale: float) -> list[Any]:
        keys, sizes = jax.random.split(key, 3), (observations, hidden, hidden, last)
        scales = (1.0, 1.0, scale)
        return [
            (
                jax.random.normal(keys[i], sizes[i : i + 2]) * scales[i] / sizes[i] ** 0.5,
                jnp.zeros(sizes[i + 1]),
            )
            for i in range(3)
        ]

    keys = jax.random.split(key)
    weights = {
        "actor": make(keys[0], actions, 0.1),
        "critic": make(keys[1], 1, 1.0),
        "spread": jnp.full(actions, -1.0),
    }
    zeros = jax.tree.map(jnp.zeros_like, weights)
    return Learner(weights, zeros, zeros, 0, jnp.zeros(observations), jnp.ones(observations), 1e-4)


def apply(layers: list[Any], x: Any) -> Any:
    """Return what a network computes."""
    for weight, bias in layers[:-1]:
        x = jnp.tanh(x @ weight + bias)
    return x @ layers[-1][0] + layers[-1][1]


def normalize(learner: Learner, observation: Any) -> Any:
    """Return observations of about mean 0 and variance 1."""
    return jnp.clip((observation - learner.mean) / jnp.sqrt(learner.variance + 1e-8), -5.0, 5.0)


def find_likelihood(weights: Any, normal: Any, action: Any) -> Any:
    """Return the logarithms of the likelihoods of actions, but for a constant."""
    deviation = (action - apply(weights["actor"], normal)) / jnp.exp(weights["spread"])
    return -(0.5 * deviation**2 + weights["spread"]).sum(axis=-1)


@jax.jit
def act(learner: Learner, observation: Any, key: Any) -> tuple[Any, Any]:
    """Return random actions and the logarithms of their likelihoods."""
    normal, weights = normalize(learner, observation), learner.weights
    noise = jax.random.normal(key, (*observation.shape[:-1], len(weights["spread"])))
    action = apply(weights["actor"], normal) + jnp.exp(weights["spread"]) * noise
    return action, find_likelihood(weights, normal, action)


@jax.jit
def find_value(learner: Learner, observation: Any) -> Any:
    """Return the values of observations."""
    return apply(learner.weights["critic"], normalize(learner, observation))[..., 0]


@partial(jax.jit, static_argnums=0)
def learn(settings: Settings, learner: Learner, steps: Any, last: Any, key: Any) -> Learner:
    """Return the learner after the updates on a rollout.

    Args:
        settings: parameters.
        learner: before.
        steps: observations, actions, likelihoods, rewards with what a truncation cuts off, and endings.
        last: the observations after it.
        key: for the order of the minibatches.
    """
    observation, action, likelihood, reward, ended = steps
    value = find_value(learner, observation)
    after = jnp.concatenate([value[1:], find_value(learner, last)[None]])

    def look_back(advantage: Any, each: Any) -> tuple[Any, Any]:
        gain, now, then, is_over = each
        error = gain + settings.discount * then * ~is_over - now
        advantage = error + settings.discount * settings.smoothing * ~is_over * advantage
        return advantage, advantage

    parts = reward, value, after, ended
    _, advantage = jax.lax.scan(look_back, jnp.zeros(reward.shape[1]), parts, reverse=True)
    batch = Batch(observation, action, likelihood, advantage, advantage + value)
    flat = jax.tree.map(lambda each: each.reshape(-1, *each.shape[2:]), batch)
    size = reward.size // settings.minibatches

    def improve(learner: Learner, rows: Any) -> tuple[Learner, None]:
        part = jax.tree.map(lambda each: each[rows], flat)
        gradient = jax.grad(find_loss)(learner.weights, learner, part, settings)
        return follow(settings, learner, gradient), None

    keys = jax.random.split(key, settings.epochs)
    orders = jax.vmap(lambda each: jax.random.permutation(each, reward.size))(keys)
    rows = orders[:, : size * settings.minibatches].reshape(-1, size)
    learner, _ = jax.lax.scan(improve, learner, rows)
    return watch(learner, flat.observation)


def find_loss(weights: Any, learner: Learner, part: Batch, settings: Settings) -> Any:
    """Return the clipped loss of PPO with that of the values and a bonus for spread."""
    normal = normalize(learner, part.observation)
    ratio = jnp.exp(find_likelihood(weights, normal, part.action) - part.likelihood)
    advantage = (part.advantage - part.advantage.mean()) / (part.advantage.std() + 1e-8)
    clipped = jnp.clip(ratio, 1.0 - settings.clip, 1.0 + settings.clip)
    gain = jnp.minimum(ratio * advantage, clipped * advantage).mean()
    error = apply(weights["critic"], normal)[:, 0] - part.wanted
    return 0.5 * (error**2).mean() - gain - settings.entropy * weights["spread"].sum()


def follow(settings: Settings, learner: Learner, gradient: Any) -> Learner:
    """Return the learner after a step of Adam."""
    norm = jnp.sqrt(sum((each**2).sum() for each in jax.tree.leaves(gradient)))
    factor = jnp.minimum(1.0, settings.largest_gradient / (norm + 1e-8))
    count = learner.count + 1
    first = jax.tree.map(lambda m, g: 0.9 * m + 0.1 * factor * g, learner.first, gradient)
    second = jax.tree.map(lambda v, g: 0.999 * v + 0.001 * (factor * g) ** 2, learner.second, gradient)
    scale = settings.rate * jnp.sqrt(1.0 - 0.999**count) / (1.0 - 0.9**count)
    weights = jax.tree.map(
        lambda w, m, v: w - scale * m / (jnp.sqrt(v) + 1e-8), learner.weights, first, second
    )
    return learner._replace(weights=weights, first=first, second=second, count=count)


def watch(learner: Learner, observation: Any) -> Learner:
    """Return the learner with these observations in its mean and variance."""
    total = learner.seen + len(observation)
    share, off = len(observation) / total, observation.mean(axis=0) - learner.mean
    variance = learner.variance * (1 - share) + observation.var(axis=0) * share
    return learner._replace(
        mean=learner.mean + share * off, variance=variance + off**2 * share * (1 - share), seen=total
    )


def take_step(envs: Any, action: Any) -> tuple[Any, ...]:
    """Return observations, those at the ends of episodes, rewards, endings, truncations and successes, in JAX."""
    is_on_device = getattr(envs, "array", "numpy") == "jax"
    observation, reward, terminated, truncated, info = envs.step(
        action if is_on_device else np.asarray(action)
    )
    ended = terminated | truncated
    if is_on_device:
        return observation, info["final_obs"], reward, ended, truncated, info["final_info"]["success"]
    final, won = observation.copy(), np.zeros_like(ended)
    if ended.any():
        final[ended] = np.stack(list(info["final_obs"][ended]))
        won[ended] = np.asarray(info["final_info"]["success"])[ended]
    found = (jnp.asarray(each, dtype=jnp.float32) for each in (observation, final, reward))
    return *found, *(jnp.asarray(each) for each in (ended, truncated, won))


def train(
    arena: str = "truth",
    device: str | None = None,
    num_envs: int = 1024,
    updates: int = 40,
    seed: int = 0,
    settings: Settings | None = None,
    on_update: Callable[[Learner, list[dict[str, float]]], None] | None = None,
    backend: str = "warp",
    **options: Any,
) -> tuple[Learner, list[dict[str, float]]]:
    """Return a trained learner, and for every update the time [s], decisions, episodes and successes.

    The time begins before the environments are made, and leaves out what `on_update` takes.
    """
    settings, began = settings or Settings(), time.perf_counter()
    engine = (
        {"backend": "warp", "array": "jax", "device": device} if backend == "warp" else {"num_threads": 1}
    )
    envs: Any = gym.make_vec(
        ID,
        num_envs=num_envs,
        vectorization_mode="vector_entry_point",
        arena=arena,
        **engine | {"autoreset_mode": "SameStep"} | OPTIONS | options,
    )
    observation = jnp.asarray(envs.reset(seed=seed)[0], dtype=jnp.float32)
    key = jax.random.key(seed)
    key, own = jax.random.split(key)
    learner = watch(make_learner(own, observation.shape[1], envs.action_space.shape[1]), observation)
    curve = []
    for update in range(updates):
        steps, episodes, successes = [], 0, 0
        for _ in range(settings.horizon):
            key, own = jax.random.split(key)
            action, likelihood = act(learner, observation, own)
            before = observation
            observation, final, reward, ended, truncated, won = take_step(envs, action)
            cut = find_value(learner, final)  # what a truncation cuts off
            reward = reward + settings.discount * cut * truncated
            steps.append((before, action, likelihood, reward, ended))
            episodes, successes = episodes + ended.sum(), successes + won.sum()
        key, own = jax.random.split(key)
        whole = tuple(jnp.stack(each) for each in zip(*steps, strict=True))
        learner = learn(settings, learner, whole, observation, own)
        found = {"episodes": int(episodes), "successes": int(successes)}
        decisions = (update + 1) * settings.horizon * num_envs
        jax.block_until_ready(learner)
        curve.append({"seconds": time.perf_counter() - began, "decisions": decisions, **found})
        print(curve[-1], flush=True)
        if on_update is not None:
            paused = time.perf_counter()
            on_update(learner, curve)
            began += time.perf_counter() - paused
    envs.close()
    return learner, curve


def judge(learner: Learner, arena: str = "truth", trials: int = 50, **options: Any) -> int:
    """Return the strict successes of the policy without noise; see `count_successes`."""
    find_action = jax.jit(lambda each: apply(learner.weights["actor"], normalize(learner, each)))
    return count_successes(
        lambda each: np.asarray(find_action(np.asarray(each, dtype=np.float32))), arena, trials, **options
    )


def make_baselines(num_hinges: int, seed: int = 0) -> dict[str, Callable[[np.ndarray], np.ndarray]]:
    """Return what a policy has to beat: zero and random actions."""
    rng = np.random.default_rng(seed)
    return {
        "zero": lambda each: np.zeros((len(each), num_hinges)),
        "random": lambda each: rng.uniform(-1.0, 1.0, (len(each), num_hinges)),
    }


def count_successes(
    find_action: Callable[[np.ndarray], np.ndarray], arena: str = "truth", trials: int = 50, **options: Any
) -> int:
    """Return the strict successes of a policy on the C engine and on fresh starts."""
    envs = gym.make_vec(
        ID,
        num_envs=trials,
        vectorization_mode="vector_entry_point",
        arena=arena,
        **{"autoreset_mode": "Disabled"} | OPTIONS | options,
    )
    observation, info = envs.reset(seed=FRESH_SEED)
    finished = np.zeros(trials, dtype=bool)
    while not finished.all():
        actions = np.asarray(find_action(observation), dtype=float)
        observation, _, terminated, truncated, info = envs.step(actions)
        finished |= terminated | truncated
    envs.close()
    return int(info["success"].sum())


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--arena", default="truth")
    parser.add_argument("--device", help="cuda:0, cpu and so on (default: a GPU if there is one)")
    parser.add_argument("--backend", choices=("warp", "mujoco"), default="warp", help="engine of the physics")
    parser.add_argument("--envs", type=int, default=1024)
    parser.add_argument("--updates", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rate", type=float, default=Settings().rate, help="learning rate")
    parser.add_argument("--epochs", type=int, default=Settings().epochs, help="of an update")
    given = parser.parse_args()
    chosen = Settings(rate=given.rate, epochs=given.epochs)
    trained, _ = train(
        given.arena, given.device, given.envs, given.updates, given.seed, chosen, backend=given.backend
    )
    baselines = make_baselines(len(trained.weights["spread"]))
    scores = {"PPO": judge(trained, given.arena)}
    scores |= {name: count_successes(each, given.arena) for name, each in baselines.items()}
    print("successes of 50 on the C engine:", ", ".join(f"{name} {found}" for name, found in scores.items()))
