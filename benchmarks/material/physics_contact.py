"""The price of elliptic contacts: time of a step, and what changes in crossings and champions."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

import evolution as ev
from benchmarks.material.crossings import cross, draw_conditions, draw_controllers
from benchmarks.report import load_record
from symbrion_gym._src.environment.config import CONTACTS
from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv

_TICKS = 100


def measure_step_ratio(arena: str, rounds: int) -> float:
    """Return the processor time of a step with elliptic contacts over that with pyramidal ones.

    Side by side, the same action; medians over rounds, as the machine is shared.
    """
    envs = {contact: OrganismEnv(arena=arena, modules=8, contact=contact) for contact in CONTACTS}
    spent: dict[str, list[float]] = {contact: [] for contact in CONTACTS}
    for _ in range(rounds):
        for contact, env in envs.items():
            env.reset(seed=0)
            start = time.process_time()
            for _ in range(_TICKS):
                env.step(np.zeros(7))
            spent[contact].append(time.process_time() - start)
    return float(np.median(spent["elliptic"]) / np.median(spent["pyramidal"]))


def compare_crossings(count: int, pit: float) -> dict[str, int]:
    """Return how many random controllers cross a pit with either contact, and for how many the outcome is the same."""
    outcomes = []
    for contact in CONTACTS:
        envs = OrganismVectorEnv(
            count, modules=6, start="pit", stuck_time=6.0, autoreset_mode="Disabled", pit=pit, contact=contact
        )
        conditions = draw_conditions(np.random.default_rng(1), count)
        outcomes.append([one.success for one in cross(envs, draw_controllers(2, count), conditions)])
    agreed = sum(one == other for one, other in zip(*outcomes, strict=True))
    return {"pyramidal": sum(outcomes[0]), "elliptic": sum(outcomes[1]), "agreed": agreed, "of": count}


def compare_champions(trials: int, seed: int = 1) -> dict[str, list[int] | int]:
    """Return how often each champion of the benchmark of evolution succeeds in the true arena with either contact."""
    runs = load_record("evolution")["results"]["champions"]["runs"]
    champions = [ev.Champion.from_dict(run["champions"][-1]["champion"]) for run in runs]
    successes: dict[str, list[int] | int] = {"of": trials}
    for contact in CONTACTS:
        bodies = [
            replace(each, environment=tuple({**dict(each.environment), "contact": contact}.items()))
            for each in champions
        ]
        successes[contact] = [ev.judge(each, "truth", trials=trials, seed=seed).successes for each in bodies]
    return successes
