"""What the simplest actions and the references reach in every environment of the package.

    python -m benchmarks.tasks [--ids Reach Climb-v0] [--starts 200] [--seeds 3] [--out tasks.json]

The family of simple actions: all zero; every action alone at +1 and -1; all at +1 and -1; tracks forward and back with
straight hinges; arcs to both sides; actions drawn anew at every step; with the tracks forward, targets of the hinges
that are drawn and held, and a wave along them; a follower of the way by the true pose, hinges straight. Each is tried
from a few starts, and from all of them where it succeeds in any of these. The reference is CMA-ES from zero, by
`evolution.evolve`, whose champion is tried from fresh starts; of `Reach-easy-v0` the follower.
"""

from __future__ import annotations

import argparse
import itertools
import json
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

import evolution as ev
from symbrion_gym._src.registration import ENVIRONMENTS
from symbrion_gym._src.robot.scout_constants import DEFAULT_SENSORS
from symbrion_gym._src.tasks.paths import PathRoute

_BATCH = 20  # Simulations side by side, and starts that are tried of an action that never succeeds
_SPACING, _POINTS_AHEAD = 0.05, 4
"""Distance of the points of a way [m], and how many of them ahead the follower heads for."""
_ARCS = (0.25, 0.5, 0.75)  # Share of the speed of the outer track that the inner one has
_FRESH, _FIRST_FRESH = (
    60,
    10_000,
)  # Starts of a reference, and seed of the first: no simple action has met them
_NOISE, _HELD = (0.3, 1.0), 25  # Largest random targets of the hinges, and for how many ticks they are held
GENERATIONS = 40  # Longest search
FOLLOWER = "follower"
LAWS = {"SnakePit": "path", "CrossGap": "path", "Climb": "path", "Traverse": "path"}
"""Law of the reference, by the family of ids; without one it is the follower."""
Policy = Callable[[np.ndarray], np.ndarray]  # from observations to the actions of all simulations
Begin = Callable[[int], Policy]  # from a seed to a policy at the start of its episodes


class Reached(NamedTuple):
    """What a policy reached."""

    successes: int
    starts: int
    episode_return: float  # mean
    genotypes: int = 0  # tried by the search until it confirmed a champion, or ended


def list_policies(envs: Any) -> Iterator[tuple[str, Begin]]:
    """Yield the family by name."""
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
        actions = np.tile(action, (shape[0], 1)).astype(np.float32)
        yield name, lambda seed, actions=actions: lambda observation: actions
    yield "random", lambda seed: partial(_draw, np.random.default_rng(seed), shape)
    if hinges:
        for largest in _NOISE:
            yield (
                f"noise ±{largest:g}",
                lambda seed, largest=largest: _drive(shape, _hold(largest, hinges, seed)),
            )
        yield "wave", lambda seed: _drive(shape, partial(_wave, envs.world.config.dt, np.arange(hinges)))
    if envs.world.config.track_control == "skid":
        yield FOLLOWER, lambda seed: partial(_follow, envs)


def _draw(rng: np.random.Generator, shape: tuple[int, ...], observation: np.ndarray) -> np.ndarray:
    return rng.uniform(-1.0, 1.0, shape).astype(np.float32)


def _drive(shape: tuple[int, ...], aim: Callable[[int], np.ndarray]) -> Policy:
    """Return the policy with the tracks forward and the targets of the hinges of every tick."""
    ticks = itertools.count()

    def act(observation: np.ndarray) -> np.ndarray:
        actions, targets = np.ones(shape, np.float32), aim(next(ticks))
        actions[:, : targets.shape[-1]] = targets
        return actions

    return act


def _hold(largest: float, hinges: int, seed: int) -> Callable[[int], np.ndarray]:
    """Return random targets, other ones in each simulation, held for a while."""
    rng, targets = np.random.default_rng(seed), np.zeros((_BATCH, hinges))

    def aim(tick: int) -> np.ndarray:
        if tick % _HELD == 0:
            targets[:] = rng.uniform(-largest, largest, targets.shape)
        return targets

    return aim


def _wave(dt: float, hinges: np.ndarray, tick: int) -> np.ndarray:
    return 0.15 * np.sin(np.pi * dt * tick - 1.6 * hinges)


def _follow(envs: Any, observation: np.ndarray) -> np.ndarray:
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


def make_batch(name: str, **options: Any) -> Any:
    """Return the simulations in which policies are tried."""
    usual: dict[str, Any] = {"vectorization_mode": "vector_entry_point", "autoreset_mode": "Disabled"}
    return gym.make_vec(name, _BATCH, **usual, **options).unwrapped


def measure(envs: Any, begin: Begin, starts: int, first: int = 0) -> Reached:
    """Return what a policy reaches, from all starts where it succeeds in one of the first."""
    successes, tried, gained = 0, 0, 0.0
    while tried < starts and (tried == 0 or successes > 0):
        seeds = range(first + tried, first + tried + _BATCH)
        observation, _ = envs.reset(seed=list(seeds))
        policy, ended = begin(seeds[0]), np.zeros(_BATCH, dtype=bool)
        while not ended.all():
            observation, reward, terminated, truncated, info = envs.step(policy(observation))
            gained += float(reward[~ended].sum())
            now = (terminated | truncated) & ~ended
            successes += int(np.asarray(info["success"])[now].sum())
            ended |= now
        tried += _BATCH
    return Reached(successes, tried, gained / tried)


def evolve(name: str, envs: Any, seed: int) -> Reached:
    """Return what the champion of a search reaches, in the arena and with the body of an environment."""
    usual = ENVIRONMENTS[name]
    with tempfile.TemporaryDirectory() as folder:
        envs.world.arena.save(f"{folder}/arena")
        run = ev.evolve(
            ev.EvolutionConfig(
                arena=f"{folder}/arena",
                organism=usual.get("default_organism", 8),
                task=usual.get("default_task"),
                start="pit" if envs.world.route.pit else None,
                controller=_find_law(name),
                environment={
                    "track_control": envs.world.config.track_control,
                    **usual.get("default_parameters", {}),
                },
                generations=GENERATIONS,
                seed=seed,
                workers=2,
            )
        )
    champion, genotypes = run.champion, int(run.history["evaluations"][-1])
    assert champion is not None

    def begin(seed: int) -> Policy:
        policy, state = ev.ChampionPolicy(champion, sensing.observation_structure), None

        def act(observation: np.ndarray) -> np.ndarray:
            nonlocal state
            actions, state = policy.predict(observation, state)
            return actions

        return act

    sensing = make_batch(name, sensors=(*DEFAULT_SENSORS, "track_odometry"))
    try:
        return measure(sensing, begin, _FRESH, _FIRST_FRESH)._replace(genotypes=genotypes)
    finally:
        sensing.close()


def _find_law(name: str) -> str | None:
    return LAWS.get(name.removeprefix("symbrion_gym/").partition("-")[0])


def measure_id(name: str, starts: int, seeds: int) -> tuple[dict[str, Reached], list[Reached]]:
    """Return what the family, and the reference with each seed, reach in an environment."""
    envs = make_batch(name)
    try:
        family = {label: measure(envs, begin, starts) for label, begin in list_policies(envs)}
        if _find_law(name) is None:
            return family, [measure(envs, lambda seed: partial(_follow, envs), _FRESH, _FIRST_FRESH)]
        return family, [evolve(name, envs, seed) for seed in range(seeds)]
    finally:
        envs.close()


def main() -> None:
    """Measure, print, and write the results."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--ids", nargs="+", default=[""], help="parts of ids; all unless given")
    parser.add_argument("--starts", type=int, default=200)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    found: dict[str, Any] = {}
    columns = [
        "id",
        "best simple action",
        "it",
        "zero",
        "random",
        "reference",
        "it, by seed",
        "genotypes, by seed",
    ]
    print(f"| {' | '.join(columns)} |\n|{'---|' * len(columns)}")
    for name in (each for each in ENVIRONMENTS if any(part in each for part in options.ids)):
        family, reference = measure_id(name, options.starts, options.seeds)
        found[name] = {"family": family, "reference": reference}
        label = max(
            family,
            key=lambda each: (family[each].successes / family[each].starts, family[each].episode_return),
        )
        simple = [f"{family[each].successes} of {family[each].starts}" for each in (label, "zero", "random")]
        law = _find_law(name)
        shown = [name.partition("/")[2], label, *simple, f"CMA-ES, {law}" if law else FOLLOWER]
        shown.append(", ".join(f"{each.successes} of {each.starts}" for each in reference))
        shown.append(", ".join(str(each.genotypes) for each in reference) if law else "")
        print(f"| {' | '.join(shown)} |", flush=True)
    if options.out:
        options.out.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
