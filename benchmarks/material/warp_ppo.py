"""The learning curve of PPO on a device: `examples/train_ppo_gpu.py`, judged on MuJoCo's C engine as it learns."""

import importlib.util
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

EXAMPLE = Path(__file__).parents[2] / "examples" / "train_ppo_gpu.py"
TRIALS = 50
"""Fresh starts on which policies are judged."""


class Size(NamedTuple):
    """How much is learned.

    Attributes:
        num_envs: simulations.
        updates: of the policy.
        rate: learning rate.
        epochs: of an update.
        every: updates between two judgments on the C engine.
    """

    num_envs: int
    updates: int
    rate: float
    epochs: int
    every: int


ON_GPU = Size(1024, 40, 1e-3, 6, 10)
ON_PROCESSOR = Size(64, 55, 1e-3, 6, 5)
"""Chosen on the C engine, where 64 simulations and 50 updates gave 44 successes of 50 with seed 0."""
QUICK = Size(4, 2, 1e-3, 2, 1)


def measure_ppo(
    device: str, size: Size, put: Callable[[dict[str, Any]], None], seed: int = 0, **options: Any
) -> dict[str, Any]:
    """Train, and judge the policy every few updates and at the end; return the curve and the baselines.

    Args:
        device: of Warp; "mujoco" stands for the C engine on one thread.
        size: how much is learned.
        put: called with the figures so far after each judgment, so that nothing is lost.
        seed: of all random numbers.
        options: of the environment, as those of the example.
    """
    example = load_example()
    settings = example.Settings(rate=size.rate, epochs=size.epochs)
    found: dict[str, Any] = {"device": device, "seed": seed, "trials": TRIALS, **size._asdict(), "curve": []}

    def look(learner: Any, curve: list[dict[str, float]]) -> None:
        if len(curve) % size.every and len(curve) < size.updates:
            return
        if "zero" not in found:
            baselines = example.make_baselines(len(learner.weights["spread"]))
            found.update({name: example.count_successes(each, **options) for name, each in baselines.items()})
        curve[-1]["processor_seconds"] = time.process_time()
        curve[-1]["judged"] = found["judged"] = example.judge(learner, trials=TRIALS, **options)
        print(f"  on the C engine {found['judged']} of {TRIALS}", flush=True)
        put(found | {"curve": [dict(row) for row in curve]})

    _, curve = example.train(
        backend="mujoco" if device == "mujoco" else "warp",
        device=None if device == "mujoco" else device,
        num_envs=size.num_envs,
        updates=size.updates,
        seed=seed,
        settings=settings,
        on_update=look,
        **options,
    )
    return found | {"curve": curve}


def load_example() -> ModuleType:
    """Return the example as a module."""
    spec = importlib.util.spec_from_file_location("train_ppo_gpu", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
