"""How fast is a step, the loop around it, a vector, a scan, a swarm, an evaluation?"""

from __future__ import annotations

import subprocess
import sys
import time
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np

import evolution as ev
import symbrion_gym as sg
from benchmarks.evidence.row import Figures, row

GROUP = "How fast is it? (processor time, one core)"
ID = "symbrion_gym/SnakePit-v1"
_TICKS = 150
_ARENAS = ("truth", "gsrm", "gg")


def _make_actions(env: Any, ticks: int) -> np.ndarray:
    """Return a wave along the hinges, `[ticks, A]`."""
    place, time_ = np.arange(env.action_space.shape[-1]), np.arange(ticks)[:, None]
    return (0.4 * np.sin(0.1 * time_ - 0.8 * place)).astype(np.float32)


@row(GROUP, "The snake of 8 modules on truth (boxes) / gsrm / gg: robot-seconds a second through `env.step`, and "
     "its time over the bare steps of the engine", "at most 1.15",
     lambda found: max(found[arena]["over_bare"] for arena in _ARENAS) <= 1.15)  # fmt: skip
def measure_env_step() -> Figures:
    """Measure one environment, in turns with the bare steps that it makes."""
    found: Figures = {}
    for arena in _ARENAS:
        env: Any = gym.make(ID, arena=arena, modules=8).unwrapped
        pairs = []
        for _ in range(5):
            env.reset(seed=0)
            actions = _make_actions(env, _TICKS)
            model, bare = env.model, mujoco.MjData(env.model)
            mujoco.mj_copyData(bare, model, env.data)
            controls, skip = [], round(env.dt / model.opt.timestep)
            begin = time.thread_time()
            for action in actions:
                env.step(action)
                controls.append(env.data.ctrl.copy())
            middle = time.thread_time()
            for control in controls:
                bare.ctrl[:] = control
                mujoco.mj_step(model, bare, skip)
            pairs.append((middle - begin, time.thread_time() - middle))
        loop, steps = (float(np.median(part)) for part in zip(*pairs, strict=True))
        found[arena] = {
            "robot_s_per_s": _TICKS * env.dt / loop,
            "step_us": 1e6 * steps / (_TICKS * skip),
            "over_bare": loop / steps,
        }
        env.close()
    said = ", ".join(f"{each['robot_s_per_s']:.0f} ({each['over_bare']:.2f})" for each in found.values())
    return found | {"said": said}


@row(GROUP, "16 snakes at once on truth, one thread: robot-seconds a second", "at least 100",
     lambda found: found["robot_s_per_s"] >= 100.0)  # fmt: skip
def measure_vector() -> Figures:
    """Measure a vector environment."""
    options: dict[str, Any] = {"arena": "truth", "modules": 8, "num_threads": 1}
    envs: Any = gym.make_vec(ID, num_envs=16, vectorization_mode="vector_entry_point", **options)
    envs.reset(seed=0)
    wave = 0.4 * np.sin(0.1 * np.arange(_TICKS)[:, None] - 0.8 * np.arange(envs.single_action_space.shape[0]))
    rounds = []
    for _ in range(3):
        begin = time.process_time()
        for action in wave:
            envs.step(np.tile(action.astype(np.float32), (16, 1)))
        rounds.append(time.process_time() - begin)
    dt = gym.make(ID, arena="truth", modules=8).unwrapped.dt  # pyright: ignore[reportAttributeAccessIssue]
    found = {"robot_s_per_s": 16 * _TICKS * dt / float(np.median(rounds))}
    return found | {"said": f"{found['robot_s_per_s']:.0f}"}


@row(GROUP, "One laser scan (361 beams) on the growing grid's mesh over one on the model made by hand (paper: 66)",
     "at most 1.5", lambda found: found["ratio"] <= 1.5)  # fmt: skip
def measure_laser() -> Figures:
    """Measure laser scans in turns."""
    finders = {}
    for arena in ("gg", "simple"):
        env: Any = gym.make(ID, arena=arena, modules=1).unwrapped
        env.reset(seed=0)
        finders[arena] = (sg.RangeFinder(env.model, "module_0", groups=(2,)), env.data)
    times: dict[str, list[float]] = {name: [] for name in finders}
    for _ in range(200):
        for name, (finder, data) in finders.items():
            begin = time.thread_time()
            finder.read(data)
            times[name].append(time.thread_time() - begin)
    median = {name: float(np.median(each)) for name, each in times.items()}
    ratio = median["gg"] / median["simple"]
    return {"ratio": ratio, "gg_us": 1e6 * median["gg"], "said": f"{ratio:.2f} ({1e6 * median['gg']:.0f} µs)"}


@row(GROUP, "A swarm of 24 and of 50 kinematic robots through `swarm_v0.parallel_env`: times real time",
     "at least 20 for 50", lambda found: found["50"].get("times_real_time", 0.0) >= 20.0)  # fmt: skip
def measure_swarm_speed() -> Figures:
    """Measure the PettingZoo environment."""
    from symbrion_gym import swarm_v0

    found: Figures = {}
    for robots in (24, 50):
        try:
            env: Any = swarm_v0.parallel_env(arena="gsrm", num_robots=robots)
            env.reset(seed=0)
        except ValueError as error:
            found[str(robots)] = {"failed": str(error)[:100]}
            continue
        actions = [{name: env.action_space(name).sample() for name in env.agents} for _ in range(20)]
        for each in actions[:5]:
            env.step(each)
        rounds = []
        for _ in range(5):
            begin = time.process_time()
            for each in actions:
                env.step(each)
            rounds.append(time.process_time() - begin)
        seconds = float(np.median(rounds))
        dt = float(getattr(env.unwrapped, "dt", 0.1))
        found[str(robots)] = {"times_real_time": len(actions) * dt / seconds, "dt": dt}
        env.close()
    said = ", ".join(
        f"{name}: {each.get('times_real_time', float('nan')):.1f}" for name, each in found.items()
    )
    return found | {"said": said}


@row(GROUP, "Evaluation of 36 genotypes, 8 modules, one thread: simulated seconds a second")
def measure_evaluation() -> Figures:
    """Measure the evaluator that every search calls."""
    genotypes = np.random.default_rng(0).normal(0.0, 0.4, (36, 12))
    with ev.Evaluator(arena="gsrm", modules=8, controller="path") as evaluator:
        evaluator(genotypes[:12])
        begin = time.process_time()
        outcome = evaluator(genotypes)
        seconds = time.process_time() - begin
    simulated = sum(each.seconds for each in outcome.outcomes)
    return {"ratio": simulated / seconds, "said": f"{simulated / seconds:.0f}"}


@row(GROUP, "A fresh process: `import symbrion_gym`, and until the first `gym.make` is there [s]", "")
def measure_start() -> Figures:
    """Measure imports and the first environment."""
    programs = {
        "import_s": "import symbrion_gym",
        "make_s": f"import gymnasium, symbrion_gym; gymnasium.make('{ID}', arena='gsrm').reset()",
    }
    found: Figures = {}
    for name, program in programs.items():
        times = []
        for _ in range(3):
            begin = time.perf_counter()
            subprocess.run([sys.executable, "-c", program], check=True, capture_output=True)
            times.append(time.perf_counter() - begin)
        found[name] = float(np.median(times))
    return found | {"said": f"{found['import_s']:.2f}, {found['make_s']:.2f}"}
