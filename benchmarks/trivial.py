"""What the simplest actions reach in every environment of the package.

    python -m benchmarks.trivial [--ids Reach Climb-v0] [--starts 200] [--markdown]

The family: all zero; every action alone at +1 and -1; all at +1 and -1; tracks forward and back with straight hinges;
arcs to both sides; actions drawn anew at every step; a follower of the way by the true pose, hinges straight. Each is
tried from a few starts, and from all of them where it succeeds in any of these.
"""

from __future__ import annotations

import argparse
import itertools
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from symbrion_gym._src.registration import ENVIRONMENTS
from symbrion_gym._src.tasks.paths import PathRoute

_BATCH = 20  # Simulations side by side, and starts that are tried of an action that never succeeds
_SPACING, _POINTS_AHEAD = 0.05, 4
"""Distance of the points of a way [m], and how many of them ahead the follower heads for."""
_ARCS = (0.25, 0.5, 0.75)  # Share of the speed of the outer track that the inner one has
Policy = Callable[[Any, np.random.Generator], np.ndarray]


class Trivial(NamedTuple):
    """What a simple action reached."""

    successes: int
    starts: int
    episode_return: float  # mean


def list_policies(envs: Any) -> Iterator[tuple[str, Policy]]:
    """Yield the family by name; a policy returns the actions of all simulations."""
    shape = envs.action_space.shape
    size, hinges = shape[1], len(envs.world.organism.servos)
    constant = {"zero": np.zeros(size), "all +1": np.ones(size), "all -1": -np.ones(size)}
    for row in range(size):
        for sign in (1.0, -1.0):
            constant[f"action {row} {sign:+.0f}"] = sign * np.eye(size)[row]
    if size > hinges:
        tracks = np.arange(size) >= hinges
        constant |= {"forward": 1.0 * tracks, "backward": -1.0 * tracks}
        if envs.world.config.track_control == "skid":
            left = tracks & ((np.arange(size) - hinges) % 2 == 0)
            for share in _ARCS:
                constant[f"arc left {share}"] = np.where(left, share, 1.0) * tracks
                constant[f"arc right {share}"] = np.where(left, 1.0, share) * tracks
    for name, action in constant.items():
        yield name, lambda envs, rng, action=action: np.tile(action, (shape[0], 1)).astype(np.float32)
    yield "random", lambda envs, rng: rng.uniform(-1.0, 1.0, shape).astype(np.float32)
    if envs.world.config.track_control == "skid":
        yield "follower", _follow


def _follow(envs: Any, rng: np.random.Generator) -> np.ndarray:
    """Head for a place a little farther along the way than the head is."""
    route, physics = envs.world.route, envs._physics
    place, forward = physics.position[:, 0, :2], physics.rotation[:, 0][:, [0, 3]]
    if isinstance(route, PathRoute):
        points = _sample([route.place(route.start), *route.corners])
        nearest = np.argmin(np.linalg.norm(points - place[:, None], axis=2), axis=1)
        target = points[np.minimum(nearest + _POINTS_AHEAD, len(points) - 1)]
    else:
        along = place @ route.direction + _POINTS_AHEAD * _SPACING
        target = np.stack(route.place(along), axis=-1)
    x, y = (target - place).T
    turn = np.arctan2(forward[:, 0] * y - forward[:, 1] * x, forward[:, 0] * x + forward[:, 1] * y)
    speed = np.maximum(0.0, np.cos(turn)) ** 2
    actions = np.zeros(envs.action_space.shape, np.float32)
    hinges = len(envs.world.organism.servos)
    actions[:, hinges::2], actions[:, hinges + 1 :: 2] = (speed - turn)[:, None], (speed + turn)[:, None]
    return np.clip(actions, -1.0, 1.0)


def _sample(corners: list[Any]) -> np.ndarray:
    """Return points along straight legs between corners."""
    legs = [
        np.linspace(one, other, max(2, int(np.hypot(*np.subtract(other, one)) / _SPACING)))
        for one, other in itertools.pairwise(corners)
    ]
    return np.concatenate(legs)


def measure(envs: Any, policy: Policy, starts: int) -> Trivial:
    """Return what a policy reaches, from all starts where it succeeds in one of the first."""
    successes, tried, gained = 0, 0, 0.0
    while tried < starts and (tried == 0 or successes > 0):
        rng = np.random.default_rng(tried)
        envs.reset(seed=list(range(tried, tried + _BATCH)))
        ended = np.zeros(_BATCH, dtype=bool)
        while not ended.all():
            _, reward, terminated, truncated, info = envs.step(policy(envs, rng))
            gained += float(reward[~ended].sum())
            now = (terminated | truncated) & ~ended
            successes += int(np.asarray(info["success"])[now].sum())
            ended |= now
        tried += _BATCH
    return Trivial(successes, tried, gained / tried)


def measure_id(name: str, starts: int) -> dict[str, Trivial]:
    """Return what the family reaches in an environment."""
    mode = "vector_entry_point"
    envs: Any = gym.make_vec(name, num_envs=_BATCH, vectorization_mode=mode, autoreset_mode="Disabled")
    envs = envs.unwrapped
    try:
        return {label: measure(envs, policy, starts) for label, policy in list_policies(envs)}
    finally:
        envs.close()


def main() -> None:
    """Measure, print, and write the results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ids", nargs="+", default=[""], help="parts of ids; all unless given")
    parser.add_argument("--starts", type=int, default=200)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    found: dict[str, dict[str, Trivial]] = {}
    print("| id | best simple action | successes | its return | zero | random |\n|---|---|---|---|---|---|")
    for name in (each for each in ENVIRONMENTS if any(part in each for part in options.ids)):
        found[name] = table = measure_id(name, options.starts)
        label, best = max(
            table.items(), key=lambda each: (each[1].successes / each[1].starts, each[1].episode_return)
        )
        others = [f"{table[each].successes} of {table[each].starts}" for each in ("zero", "random")]
        shown = [
            name.partition("/")[2],
            label,
            f"{best.successes} of {best.starts}",
            f"{best.episode_return:.2f}",
        ]
        print(f"| {' | '.join((*shown, *others))} |", flush=True)
    if options.out:
        options.out.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
