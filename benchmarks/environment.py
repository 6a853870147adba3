"""The environment: is the task neither trivial nor impossible, is its physics honest, is it fast?

python -m benchmarks.environment [--quick] [--only NAME ...]
"""

import argparse
import gc
import json
import resource
import time
from collections.abc import Callable

import mujoco
import numpy as np

from benchmarks.material.crossings import cross, draw_conditions, draw_controllers, evolve
from benchmarks.report import RESULTS, write_results
from symbrion_gym import ArenaError, load_arena
from symbrion_gym.environment.snake_pit import SnakePitEnv
from symbrion_gym.environment.vector import SnakePitVectorEnv

RANDOM_EPISODES = 10_000
MINUTES = 20.0


def run(
    quick: bool = False,
    only: tuple[str, ...] = (),
    episodes: int = RANDOM_EPISODES,
    minutes: float = MINUTES,
) -> dict:
    """Run the parts and return what they measured; parts left out keep their last results.

    Args:
        quick: smaller sizes and fewer repetitions.
        only: names of parts; all by default.
        episodes: random episodes to judge twice.
        minutes: limit of the test of robustness.
    """
    results = _load_last()
    special = {"cheats": {"episodes": episodes}, "robustness": {"minutes": minutes}}
    for name, part in PARTS.items():
        if not only or name in only:
            start = time.perf_counter()
            results[name] = {**part(quick, **special.get(name, {})), "is_quick": quick}
            print(f"{name} ({time.perf_counter() - start:.0f} s)")
            for key, value in results[name].items():
                print(f"  {key:32s} {value}")
            results = {**_load_last(), name: results[name]}
            write_results("environment", results)
    return results


def measure_task(quick: bool) -> dict:
    """Let the zero controller try: which bodies cross which pits from the floor at friction 0.7."""
    outcomes = {}
    for pit in (0.20, 0.30, 0.40):
        for modules in (4, 5, 6, 7, 8, 9, 10) if pit == 0.40 else (6, 7, 8):
            env = SnakePitEnv(pit=pit, modules=modules, friction=0.7)
            env.reset(seed=0)
            while True:
                *_, terminated, truncated, info = env.step(np.zeros(modules - 1))
                if terminated or truncated:
                    break
            outcomes[f"pit {pit:.2f}, {modules} modules"] = bool(info["success"])
    return outcomes


def measure_cheats(quick: bool, episodes: int = RANDOM_EPISODES) -> dict:
    """Judge every success of random and of evolved controllers a second time."""
    random_trials, generations = (240, 4) if quick else (episodes, 22)
    rng, counts = np.random.default_rng(0), {"random": 0, "evolved": 0}
    successes, cheats = {"random": 0, "evolved": 0}, []
    bodies = {
        m: SnakePitVectorEnv(40, modules=m, start="pit", stuck_time=4.0, autoreset_mode="Disabled", pit=pit)
        for m, pit in ((4, 0.30), (5, 0.35), (6, 0.40), (8, 0.40))
    }
    while counts["random"] < random_trials:
        for envs in bodies.values():
            genotypes = np.clip(rng.normal(0.0, 0.5, (envs.num_envs, 12)), -1.5, 1.5)
            outcomes = cross(envs, genotypes, draw_conditions(rng, envs.num_envs))
            counts["random"] += len(outcomes)
            successes["random"] += sum(one.success for one in outcomes)
            cheats += [one.faults for one in outcomes if one.faults]
    envs = SnakePitVectorEnv(24, modules=8, start="pit", stuck_time=6.0, autoreset_mode="Disabled")
    for _, one in evolve(envs, 3, generations):
        counts["evolved"] += 1
        successes["evolved"] += one.success
        cheats += [one.faults] if one.faults else []
    return {"episodes": counts, "successes": successes, "cheats": len(cheats), "faults": cheats[:5]}


def measure_tracks(quick: bool) -> dict:
    """Compare sphere tracks with wheels on joints and with the authors' cylinders, 30 controllers."""
    count, result = 6 if quick else 30, {}
    for pit in (0.30, 0.35):
        reference = _cross_with(count, {"pit": pit})
        result[f"pit {pit:.2f}: spheres"] = f"{sum(reference)} successes of {count}"
        for tracks in ("wheels", "cylinders"):
            outcome = _cross_with(count, {"pit": pit, "tracks": tracks})
            agreed = f"{_count_equal(reference, outcome)} of {count} agree"
            result[f"pit {pit:.2f}: {tracks}"] = f"{agreed}, {sum(outcome)} successes"
    return result


def measure_timestep(quick: bool) -> dict:
    """Compare physics steps of 5 ms with a reference of 1 ms, 30 controllers."""
    count, result = 6 if quick else 30, {}
    for pit in (0.30, 0.35):
        coarse = _cross_with(count, {"pit": pit})
        fine = _cross_with(count, {"pit": pit, "timestep": 0.001, "frame_skip": 20})
        successes = f"{sum(coarse)} successes at 5 ms, {sum(fine)} at 1 ms"
        result[f"pit {pit:.2f}"] = f"{_count_equal(coarse, fine)} of {count} agree, {successes}"
    return result


def measure_speed(quick: bool) -> dict:
    """Robot-seconds per second of one thread, and what the loop in Python adds to bare steps.

    Processor time, side by side; the fastest of many short rounds each, as other work on the machine only
    ever adds.
    """
    result, ticks, rounds = {}, 100, 10 if quick else 60
    for arena in _find_arenas():
        env, action = SnakePitEnv(arena=arena, modules=8), np.zeros(7)
        whole, bare, resets = [], [], []
        controls = _record_controls(env, action, ticks)
        for _ in range(rounds):
            start = time.process_time()
            env.reset(seed=0)
            resets.append(time.process_time() - start)
            start = time.process_time()
            for _ in range(ticks):
                env.step(action)
            whole.append(time.process_time() - start)
            env.reset(seed=0)
            start = time.process_time()
            for control in controls:
                env.data.ctrl[:] = control
                mujoco.mj_step(env.model, env.data, nstep=4)
            bare.append(time.process_time() - start)
        result[f"{arena}: robot-seconds per second"] = round(ticks * env.dt / min(whole), 1)
        result[f"{arena}: median of them"] = round(ticks * env.dt / float(np.median(whole)), 1)
        result[f"{arena}: over bare mj_step"] = round(min(whole) / min(bare), 3)
        result[f"{arena}: median over bare"] = round(float(np.median(np.array(whole) / bare)), 3)
        result[f"{arena}: reset [ms]"] = round(1e3 * min(resets), 2)
    return result


def measure_threads(quick: bool) -> dict:
    """Speed of the vector environment with two threads over one, side by side."""
    ratios = []
    envs = {k: SnakePitVectorEnv(16, modules=8, num_threads=k, autoreset_mode="Disabled") for k in (1, 2)}
    for _ in range(3 if quick else 7):
        spent = {}
        for threads, env in envs.items():
            env.reset(seed=0)
            start = time.perf_counter()
            for _ in range(50 if quick else 150):
                env.step(np.zeros((16, 7)))
            spent[threads] = time.perf_counter() - start
        ratios.append(spent[1] / spent[2])
    return {"two threads over one": round(float(np.median(ratios)), 2), "best": round(max(ratios), 2)}


def measure_robustness(quick: bool, minutes: float = MINUTES) -> dict:
    """Random steps over random options and actions that no one should send."""
    wanted, rng, steps, refused, ended = 20_000 if quick else 10_000_000, np.random.default_rng(0), 0, 0, 0
    start, limit = time.perf_counter(), np.inf if quick else minutes * 60
    while steps < wanted and time.perf_counter() - start < limit:
        env = _draw_environment(rng)
        observation, _ = env.reset(seed=int(rng.integers(1 << 30)))
        for _ in range(2000):
            action = _draw_action(rng, env.action_space.shape[0])
            try:
                observation, reward, terminated, truncated, _ = env.step(action)
            except ValueError:
                refused += 1
                continue
            steps += 1
            if not (np.isfinite(observation).all() and np.isfinite(reward)):
                return {"steps": steps, "not finite": True}
            if terminated or truncated:
                ended += 1
                env.reset(options={"friction": (0.1, 1.5), "yaw": (-1.0, 1.0), "torque_scale": (0.2, 3.0)})
    return {"steps": steps, "wrong shapes refused": refused, "episodes": ended, "not finite": False}


def measure_memory(quick: bool) -> dict:
    """Growth of the process over 1,000 resets and 200 environments."""
    env = SnakePitEnv(modules=8)
    for _ in range(100):
        env.reset(seed=0)
    before = _find_memory()
    for _ in range(1000):
        env.reset(seed=0)
    resets = _find_memory() - before
    for _ in range(20 if quick else 80):
        SnakePitEnv(modules=4).reset(seed=0)
    gc.collect()
    before = _find_memory()
    for _ in range(40 if quick else 200):
        SnakePitEnv(modules=4).reset(seed=0)
    gc.collect()
    return {"after resets [MB]": round(resets, 2), "after creations [MB]": round(_find_memory() - before, 2)}


PARTS: dict[str, Callable[..., dict]] = {
    "task": measure_task,
    "cheats": measure_cheats,
    "tracks": measure_tracks,
    "timestep": measure_timestep,
    "speed": measure_speed,
    "threads": measure_threads,
    "robustness": measure_robustness,
    "memory": measure_memory,
}


def _load_last() -> dict:
    path = RESULTS / "environment.json"
    return json.loads(path.read_text())["results"] if path.exists() else {}


def _cross_with(count: int, options: dict) -> list[bool]:
    """Whether each of the seeded random controllers crosses."""
    envs = SnakePitVectorEnv(
        count, modules=6, start="pit", stuck_time=6.0, autoreset_mode="Disabled", **options
    )
    conditions = draw_conditions(np.random.default_rng(1), count)
    return [one.success for one in cross(envs, draw_controllers(2, count), conditions)]


def _count_equal(one: list[bool], other: list[bool]) -> int:
    return sum(a == b for a, b in zip(one, other, strict=True))


def _find_arenas() -> list[str]:
    """Names of the arenas that are there."""
    names = []
    for name in ("truth", "gsrm", "gg"):
        try:
            load_arena(name)
        except ArenaError:
            continue
        names.append(name)
    return names


def _draw_environment(rng: np.random.Generator) -> SnakePitEnv:
    return SnakePitEnv(
        modules=int(rng.integers(2, 5)),
        pit=float(rng.choice([0.0, 0.2, 0.4])),
        friction=float(rng.uniform(0.1, 1.5)),
        track_speed=float(rng.uniform(0.0, 0.5)),
        hinge_torque=float(rng.uniform(0.5, 30.0)),
        start=str(rng.choice(["floor", "pit"])),
        noise=float(rng.choice([0.0, 1.0])),
        abyss=bool(rng.integers(2)),
        track_control=str(rng.choice(["constant", "body", "modules"])),
        frame_skip=int(rng.integers(1, 6)),
    )


def _draw_action(rng: np.random.Generator, size: int) -> np.ndarray:
    kind = rng.integers(20)
    if kind == 0:
        return np.full(size, rng.choice([np.nan, np.inf, -np.inf, 1e300]))
    if kind == 1:
        return np.zeros(size + 1)
    if kind == 2:
        return rng.uniform(-100, 100, size).astype(np.float32)
    if kind == 3:
        return np.where(rng.random(size) < 0.5, np.nan, 1.0)
    return rng.uniform(-1, 1, size)


def _record_controls(env: SnakePitEnv, action: np.ndarray, ticks: int) -> list[np.ndarray]:
    """Return what the servos are told from the start on, tick by tick, `[nu]` each."""
    env.reset(seed=0)
    controls = []
    for _ in range(ticks):
        env.step(action)
        controls.append(env.data.ctrl.copy())
    return controls


def _find_memory() -> float:
    """Resident memory of this process [MB]."""
    try:
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * resource.getpagesize() / 1e6
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def main() -> None:
    """Read the command line and run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.environment", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="smaller sizes and fewer repetitions")
    parser.add_argument("--only", nargs="*", default=(), choices=list(PARTS), help="parts (default: all)")
    parser.add_argument("--episodes", type=int, default=RANDOM_EPISODES, help="random episodes judged twice")
    parser.add_argument("--minutes", type=float, default=MINUTES, help="limit of the test of robustness")
    options = parser.parse_args()
    run(options.quick, tuple(options.only), options.episodes, options.minutes)


if __name__ == "__main__":
    main()
