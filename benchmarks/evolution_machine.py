"""Overhead of evolution, speedup by workers, equality of backends, resuming after SIGKILL."""

import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from evolution._src.backends.making import make_backend
from evolution._src.backends.rollout import simulate
from evolution._src.backends.trials import Job, Trials
from evolution._src.controllers.controller import REACTIVE_HINT
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve, load_run, resume
from evolution._src.search.run import format_history
from symbrion_gym._src.environment import organism_vector_env as vector

BASE_TRIALS = EvolutionConfig().trials
_ENDLESS = (("duration", 10.0), ("stuck_time", 20.0))
_SMALL = EvolutionConfig(
    arena="truth",
    modules=4,
    generations=6,
    population_size=4,
    trials=1,
    stop_when_solved=False,
    environment=(("duration", 3.0),),
)
_PROGRAM = """
import json, sys
from evolution._src.search.loop import evolve
from evolution._src.search.config import EvolutionConfig
evolve(EvolutionConfig.from_json(json.loads(sys.argv[1])))
"""


class _TimedBatch(vector.Batch):
    """A batch of simulations that measures the time of its steps."""

    seconds = 0.0

    def step(self, *arguments: Any, **options: Any) -> Any:
        began = time.thread_time()
        try:
            return super().step(*arguments, **options)
        finally:
            _TimedBatch.seconds += time.thread_time() - began


def measure_overhead(repeats: int) -> dict[str, Any]:
    """Return the overhead over the steps of `mujoco.batch`, on one thread.

    Processor time, so that other processes have little influence; median over repeats.
    """
    original, vector.Batch = vector.Batch, _TimedBatch
    try:
        parts = {
            "a generation of 12 genotypes": Trials(arena="gsrm", count=BASE_TRIALS),
            "none of which ends before the others": Trials(
                arena="gsrm", count=BASE_TRIALS, environment=_ENDLESS
            ),
        }
        return {name: _measure_overhead(trials, repeats) for name, trials in parts.items()}
    finally:
        vector.Batch = original


def _measure_overhead(trials: Trials, repeats: int) -> float:
    jobs = [Job(np.array(REACTIVE_HINT) + 0.01 * index, trials) for index in range(12)]
    shares = []
    for _ in range(repeats + 1):  # the first one compiles
        began, _TimedBatch.seconds = time.thread_time(), 0.0
        simulate(jobs, 1)
        shares.append((time.thread_time() - began) / _TimedBatch.seconds - 1)
    return round(statistics.median(shares[1:]), 3)


def measure_workers(repeats: int) -> dict[str, Any]:
    """Compare two threads with one on the same jobs, alternating."""
    jobs = [
        Job(np.array(REACTIVE_HINT) + 0.01 * index, Trials(arena="gsrm", count=BASE_TRIALS))
        for index in range(12)
    ]
    seconds: dict[int, list[float]] = {1: [], 2: []}
    outcomes = {}
    load = os.getloadavg()[0]
    for _ in range(repeats + 1):
        for workers in seconds:
            backend = make_backend("batch", workers)
            began = time.perf_counter()
            outcomes[workers] = backend.run(jobs)
            seconds[workers].append(time.perf_counter() - began)
    ratios = [one / two for one, two in zip(seconds[1][1:], seconds[2][1:], strict=True)]
    return {
        "speedup_of_two": round(statistics.median(ratios), 2),
        "best": round(min(seconds[1][1:]) / min(seconds[2][1:]), 2),
        "equal_results": outcomes[1] == outcomes[2],
        "load": round(load, 1),
    }


def measure_backends() -> dict[str, Any]:
    """Run the same evolution on 1, 2 and 4 threads and on processes; compare the histories without times."""
    histories: dict[str, str] = {}
    for backend, workers in (("batch", 1), ("batch", 2), ("batch", 4), ("processes", 2)):
        run = evolve(replace(_SMALL, backend=backend, workers=workers))
        history = run.history.copy()
        history["wall_seconds"] = 0.0
        histories[f"{backend}, {workers}"] = format_history(history)
    equal = [text == histories["batch, 1"] for text in histories.values()]
    return {"compared": "; ".join(histories), "of": len(equal), "equal": sum(equal)}


def measure_kills(count: int) -> dict[str, Any]:
    """Kill runs by SIGKILL at random moments, resume them, and compare champion and history with a complete run."""
    equal, cut_off = 0, 0
    with tempfile.TemporaryDirectory() as name:
        began = time.perf_counter()
        whole = _run_program(Path(name) / "whole", None)
        seconds, expected = time.perf_counter() - began, load_run(Path(name) / "whole")
        assert whole == 0
        for number, share in enumerate(np.random.default_rng(0).uniform(0.3, 1.0, count)):
            folder = Path(name) / f"run_{number}"
            cut_off += _run_program(folder, share * seconds) == -signal.SIGKILL
            run = resume(folder) if (folder / "config.json").exists() else evolve(_in_folder(folder))
            equal += run.champion == expected.champion and _is_equal(run.history, expected.history)
    return {"kills": count, "really_cut_off": cut_off, "same_champion_and_history": equal}


def _is_equal(one: np.ndarray, other: np.ndarray) -> bool:
    names = [name for name in one.dtype.names or () if name != "wall_seconds"]
    return len(one) == len(other) and all(np.array_equal(one[name], other[name]) for name in names)


def _in_folder(folder: Path) -> EvolutionConfig:
    return replace(_SMALL, folder=str(folder))


def _run_program(folder: Path, seconds: float | None) -> int:
    """Evolve in a separate process, killed after `seconds`; return its exit status."""
    config = json.dumps(_in_folder(folder).to_json())
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen([sys.executable, "-c", _PROGRAM, config], env=environment)
    try:
        return process.wait(seconds)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGKILL)
        return process.wait()
