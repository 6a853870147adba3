"""The environment: difficulty of the task, validity of its physics, speed.

python -m benchmarks.environment [--quick] [--only NAME ...] [--more]

The parts "cheats" and "robustness" run in rounds: `--minutes` limits them, and `--more` adds to their last results
instead of starting again.
"""

import argparse
import gc
import resource
import time
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import mujoco
import numpy as np

from benchmarks.material.cheats import try_evolved, try_random
from benchmarks.material.crossings import cross, draw_conditions, draw_controllers
from benchmarks.material.robustness import step_at_random
from benchmarks.report import load_record, write_results
from symbrion_gym import ArenaError, load_arena
from symbrion_gym._src.environment.snake_pit import SnakePitEnv
from symbrion_gym._src.environment.vector import SnakePitVectorEnv

RANDOM_EPISODES = 10_000
EVOLVED_EPISODES = 2_000
RANDOM_STEPS = 10_000_000
MINUTES = 60.0
_TICKS = 100
_FINE = {"timestep": 0.001, "frame_skip": 20}


def run(
    quick: bool = False, only: tuple[str, ...] = (), minutes: float = MINUTES, more: bool = False
) -> dict:
    """Run the parts and return what they measured; parts left out keep their last results.

    Args:
        quick: smaller sizes and fewer repetitions.
        only: names of parts; all by default.
        minutes: limit of each of the parts that run in rounds.
        more: those parts add to their last results.
    """
    for name, part in PARTS.items():
        if not only or name in only:
            start = time.perf_counter()
            last = load_record("environment")["results"].get(name, {}) if more else {}
            options = {"minutes": minutes, "last": last} if name in ROUNDS else {}
            result = part(quick, **options)
            print(f"{name} ({time.perf_counter() - start:.0f} s)")
            for key, value in result.items():
                print(f"  {key:32s} {value}")
            write_results("environment", {name: result})
    return load_record("environment")["results"]


def measure_task(quick: bool) -> dict:
    """Measure which bodies cross which pits with zero actions, from the floor at friction 0.7."""
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


def measure_cheats(quick: bool, minutes: float, last: dict) -> dict:
    """Audit every success of random and of evolved controllers."""
    wanted = {"random": 200 if quick else RANDOM_EPISODES, "evolved": 100 if quick else EVOLVED_EPISODES}
    rounds, counts = Counter(last.get("rounds", {})), Counter(last.get("counts", {}))
    faults, limit = list(last.get("faults", [])), time.perf_counter() + 60 * minutes
    tries = {"random": try_random, "evolved": try_evolved}
    while time.perf_counter() < limit:
        open_kinds = [kind for kind in tries if counts[f"{kind} episodes"] < wanted[kind]]
        if not open_kinds:
            break
        kind = min(open_kinds, key=lambda kind: counts[f"{kind} episodes"] / wanted[kind])
        found, new = tries[kind](rounds[kind])
        rounds[kind] += 1
        counts.update(found)
        faults += new
    cheats = counts["random cheats"] + counts["evolved cheats"]
    return {"cheats": cheats, "faults": faults[:5], "counts": dict(counts), "rounds": dict(rounds)}


def measure_tracks(quick: bool) -> dict:
    """Compare sphere tracks with wheels on joints and with the authors' cylinders, 30 controllers.

    The cylinders also at 1 ms, as contacts of upright cylinders do not converge at 5 ms.
    """
    count, result = 6 if quick else 30, {}
    for pit in (0.30, 0.35, 0.40):
        reference = _cross_with(count, {"pit": pit})
        result[f"pit {pit:.2f}: spheres"] = f"{sum(reference)} successes of {count}"
        models = {"wheels": {"tracks": "wheels"}, "cylinders": {"tracks": "cylinders"}}
        models["cylinders at 1 ms"] = {"tracks": "cylinders", **_FINE}
        for name, options in models.items():
            outcome = _cross_with(count, {"pit": pit, **options})
            agreed = f"{_count_equal(reference, outcome)} of {count} agree"
            result[f"pit {pit:.2f}: {name}"] = f"{agreed}, {sum(outcome)} successes"
    return result


def measure_timestep(quick: bool) -> dict:
    """Compare physics steps of 5 ms with a reference of 1 ms, 30 controllers."""
    count, result = 6 if quick else 30, {}
    for pit in (0.30, 0.35):
        coarse = _cross_with(count, {"pit": pit})
        fine = _cross_with(count, {"pit": pit, **_FINE})
        successes = f"{sum(coarse)} successes at 5 ms, {sum(fine)} at 1 ms"
        result[f"pit {pit:.2f}"] = f"{_count_equal(coarse, fine)} of {count} agree, {successes}"
    return result


def measure_speed(quick: bool) -> dict:
    """Measure the real-time factor of one thread, and the overhead over the physics steps.

    The processor time of each tick is measured in many rounds, side by side. The median of each tick over the rounds
    is used (and the fastest), so that an interruption affects only one tick.
    """
    result = {}
    for arena in _find_arenas():
        figures = _measure_speed(arena, 10 if quick else 60)
        result |= {f"{arena}: {name}": value for name, value in figures.items()}
    return result


def _measure_speed(arena: str, rounds: int) -> dict[str, float]:
    env, action = SnakePitEnv(arena=arena, modules=8), np.zeros(7)
    envs, actions = SnakePitVectorEnv(16, num_threads=1, arena=arena, modules=8), np.zeros((16, 7))
    controls = _record_controls(env, action, _TICKS)
    spent: dict[str, list[np.ndarray]] = {"reset": [], "whole": [], "bare": [], "many": []}
    for number in range(rounds):
        spent["reset"].append(_time_ticks(lambda seed: env.reset(seed=seed), [0]))
        spent["whole"].append(_time_ticks(env.step, [action] * _TICKS))
        env.reset(seed=0)
        spent["bare"].append(_time_ticks(partial(_step_bare, env), controls))
        if number % 4 == 0:
            envs.reset(seed=0)
            spent["many"].append(_time_ticks(envs.step, [actions] * _TICKS) / 16)
    figures, seconds = {}, _TICKS * env.dt
    for name, pick in (("", np.median), ("fastest, ", np.min)):
        reset, whole, bare, many = (float(pick(ticks, axis=0).sum()) for ticks in spent.values())
        figures[f"{name}robot-seconds per second"] = round(seconds / whole, 1)
        figures[f"{name}over bare mj_step"] = round(whole / bare, 3)
        figures[f"{name}16 at once, one thread"] = round(seconds / many, 1)
        figures[f"{name}16 at once over bare"] = round(many / bare, 3)
        figures[f"{name}reset [ms]"] = round(1e3 * reset, 2)
    return figures


def _time_ticks(step: Callable[[Any], Any], arguments: Sequence[Any]) -> np.ndarray:
    """Return the processor time of each call [s], `[ticks]`."""
    marks = [time.process_time()]
    for argument in arguments:
        step(argument)
        marks.append(time.process_time())
    return np.diff(marks)


def _step_bare(env: SnakePitEnv, control: np.ndarray) -> None:
    env.data.ctrl[:] = control
    mujoco.mj_step(env.model, env.data, nstep=4)


def measure_threads(quick: bool) -> dict:
    """Compare the speed of the vector environment with two threads and one, side by side."""
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


def measure_robustness(quick: bool, minutes: float, last: dict) -> dict:
    """Step with random options and with invalid actions."""
    rounds, counts = int(last.get("rounds", 0)), Counter(last.get("counts", {}))
    limit = time.perf_counter() + 60 * minutes
    while counts["steps"] < (100_000 if quick else RANDOM_STEPS) and time.perf_counter() < limit:
        counts.update(step_at_random(rounds))
        rounds += 1
    return {"counts": dict(counts), "rounds": rounds}


def measure_memory(quick: bool) -> dict:
    """Measure the memory growth over 1,000 resets and 200 environments."""
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


ROUNDS = ("cheats", "robustness")
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


def _cross_with(count: int, options: dict) -> list[bool]:
    """Return whether each of the seeded random controllers crosses."""
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


def _record_controls(env: SnakePitEnv, action: np.ndarray, ticks: int) -> list[np.ndarray]:
    """Return the commands of the servos from the start on, tick by tick, `[nu]` each."""
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
    parser.add_argument(
        "--minutes", type=float, default=MINUTES, help="limit of each of: " + ", ".join(ROUNDS)
    )
    parser.add_argument("--more", action="store_true", help="add to the last results of these parts")
    options = parser.parse_args()
    run(options.quick, tuple(options.only), options.minutes, options.more)


if __name__ == "__main__":
    main()
