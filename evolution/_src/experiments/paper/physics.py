"""Table II: the time of a physics step and its collision detection while the snake crosses."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import reconstruction as rc
import symbrion_gym as sg
from evolution._src.champions.policy import ChampionPolicy
from evolution._src.controllers.controller import make_controller
from evolution._src.experiments.paper.arenas import RECIPES, load_arena
from evolution._src.experiments.paper.config import PaperConfig
from evolution._src.experiments.paper.statistics import find_ratio, summarize
from evolution._src.search.validation import Champion

COSTS = ("physics_us", "collision_us")


@dataclass(frozen=True)
class CrossingConfig:
    """Which part of a crossing is timed, and what differs between the runs.

    Attributes:
        friction: range of the friction coefficient; the same as in the trials that judge a champion.
        yaw: range of the initial heading [rad]; small, as a run that leaves the course does not cross the pit.
        start_offset: range of the initial offset along the course [m].
        pit_edge: position of the head from which a run is timed [m]; just behind the edge of the pit.
        lead_ticks: number of ticks after which a run is timed in any case, if the head has not reached the pit.
        rest_ticks: ticks after the timed ones, for the body to be completely across: in 17.5 s it moves 1.75 m at
            most.
        max_wait: a tick whose wall time exceeds its processor time by more [s] was interrupted by other work, and is
            left out.
    """

    friction: tuple[float, float] = (0.55, 0.9)
    yaw: tuple[float, float] = (-0.05, 0.05)
    start_offset: tuple[float, float] = (-0.05, 0.05)
    pit_edge: float = -0.2
    lead_ticks: int = 400
    rest_ticks: int = 1000
    max_wait: float = 50e-6

    @property
    def conditions(self) -> dict[str, tuple[float, float]]:
        """What an environment randomizes at the start of a run."""
        return {"friction": self.friction, "yaw": self.yaw, "start_offset": self.start_offset}


def measure_physics(
    folder: Path,
    champion: Champion,
    config: PaperConfig,
    progress: rc.Progress = rc.silent,
    crossing: CrossingConfig | None = None,
) -> dict[str, Any]:
    """Time the champion's crossings in every arena, by MuJoCo's own timers.

    The arenas alternate run by run, so that a machine that slows down slows all of them down; run i has the
    same conditions in all of them.

    Args:
        folder: contains the arenas.
        champion: controls the body.
        config: runs, steps and seed.
        progress: called with a message and the share that is done.
        crossing: the part of a crossing that is timed, and the differences between the runs.

    Returns:
        `rows`, one for each arena: `physics_us` of a whole step and `collision_us` within it (mean, deviation and
        median over the runs), `contacts` per step, number of `crossed` runs, `pieces`; `interrupted`, the share of
        ticks that were interrupted by other work and left out; `ratios` of arenas to the hand-made model, with 95 %
        intervals; `samples`, as `time_crossings` returns them.
    """
    arenas = {name: load_arena(folder, name) for name in RECIPES}
    samples = time_crossings(champion, arenas, config, progress, crossing)
    rows = [
        {
            "arena": name,
            "text": RECIPES[name].text,
            "pieces": len(arena.pieces),
            "triangles": len(arena.surface.faces),
            **{cost: summarize(samples[name][cost]) for cost in COSTS},
            "contacts": float(np.mean(samples[name]["contacts"])),
            "crossed": int(np.sum(samples[name]["crossed"])),
        }
        for name, arena in arenas.items()
    ]
    ratios = {
        name: {cost: find_ratio(samples[name][cost], samples["simple"][cost], config.seed) for cost in COSTS}
        for name in RECIPES
        if name != "simple"
    }
    interrupted = float(np.mean([sample["interrupted"] for sample in samples.values()]))
    return {
        "runs": config.runs,
        "steps": config.steps,
        "interrupted": interrupted,
        "rows": rows,
        "ratios": ratios,
        "samples": samples,
    }


def time_crossings(
    champion: Champion,
    arenas: Mapping[str, sg.Arena],
    config: PaperConfig,
    progress: rc.Progress = rc.silent,
    crossing: CrossingConfig | None = None,
) -> dict[str, dict[str, list[float]]]:
    """Return arena -> cost -> one value per run: `physics_us`, `collision_us`, `contacts`, `crossed`, `interrupted`.

    Args:
        champion: controls the body.
        arenas: name -> arena.
        config: runs, steps and seed.
        progress: called with a message and the share that is done.
        crossing: the part of a crossing that is timed, and the differences between the runs.
    """
    crossing = crossing or CrossingConfig()
    sensors = make_controller(champion.controller, champion.modules).sensors
    environments = {
        name: sg.SnakePitEnv(
            arena=arena, modules=champion.modules, sensors=sensors, start="pit", timers=True, stuck_time=1e3
        )
        for name, arena in arenas.items()
    }
    samples = {name: {cost: [] for cost in (*COSTS, "contacts", "crossed", "interrupted")} for name in arenas}
    for run in range(config.runs):
        progress(f"run {run + 1} of {config.runs}", run / config.runs)
        for name, environment in environments.items():
            measured = _time_crossing(environment, champion, config.steps, config.seed + run, crossing)
            for cost, value in measured.items():
                samples[name][cost].append(value)
    for environment in environments.values():
        environment.close()
    return samples


def _time_crossing(
    environment: sg.SnakePitEnv, champion: Champion, steps: int, seed: int, crossing: CrossingConfig
) -> dict[str, float]:
    """Time `steps` physics steps from when the head is above the pit; then continue until the body has crossed."""
    policy = ChampionPolicy(champion, environment.observation_structure)
    observation, info = environment.reset(seed=seed, options=crossing.conditions)
    state, crossed = None, False
    timed: list[tuple[float, float, int]] = []
    waits: list[float] = []
    ticks = max(1, steps // environment.config.frame_skip)
    for tick in range(crossing.lead_ticks + ticks + crossing.rest_ticks):
        action, state = policy.predict(observation, state)
        waited_before = time.perf_counter() - time.thread_time()
        observation, _, _, _, info = environment.step(action)
        wait = time.perf_counter() - time.thread_time() - waited_before
        crossed = crossed or info["success"]
        if len(timed) < ticks and (tick >= crossing.lead_ticks or info["x_position"] > crossing.pit_edge):
            timed.append((info["physics_us"], info["collision_us"], environment.data.ncon))
            waits.append(wait)
        if crossed and len(timed) == ticks:
            break
    is_undisturbed = np.array(waits) < crossing.max_wait
    counted = np.array(timed)[is_undisturbed if is_undisturbed.any() else slice(None)]
    physics, collision, contacts = np.mean(counted, axis=0)
    return {
        "physics_us": float(physics),
        "collision_us": float(collision),
        "contacts": float(contacts),
        "crossed": bool(crossed),
        "interrupted": float(1 - is_undisturbed.mean()),
    }
