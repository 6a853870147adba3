"""Does what evolves hold elsewhere, beside doing nothing, one constant action, and chance?"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import gymnasium as gym
import numpy as np
from scipy import stats

import evolution as ev
import symbrion_gym as sg
from benchmarks.evidence.row import Figures, row
from evolution._src.experiments.train import choose_task, make_models
from evolution._src.search.validation import select_champion

GROUP = "Does what evolves hold elsewhere?"
EXAM_SEED = 20_261_123
"""Seed of the final trials; nothing before has used it."""
_STARTS = 60
_POLICIES = {"zero": 0.0, "plus": 1.0, "minus": -1.0, "random": None}


@row(GROUP, "SnakePit-v1, nothing evolved: successes with zero actions / all +1 / all -1 / drawn anew each step "
     f"(of {_STARTS} starts each)", "at most 10 %",
     lambda found: max(found[name] for name in _POLICIES) <= 0.1 * _STARTS)  # fmt: skip
def measure_trivial() -> Figures:
    """Measure what constant and random actions achieve."""
    found: Figures = dict.fromkeys(_POLICIES, 0)
    env: Any = gym.make("symbrion_gym/SnakePit-v1", arena="truth", modules=8)
    for name, value in _POLICIES.items():
        for seed in range(_STARTS):
            env.reset(seed=seed)
            env.action_space.seed(seed)
            ended = False
            while not ended:
                action = (
                    env.action_space.sample()
                    if value is None
                    else np.full(env.action_space.shape, value, np.float32)
                )
                *_, terminated, truncated, info = env.step(action)
                ended = terminated or truncated
            found[name] += bool(info["success"])
    return found | {"said": " / ".join(str(found[name]) for name in _POLICIES)}


@row(GROUP, "CMA-ES from zero on the scanned course (8 modules), on which the search was developed, five seeds: "
     "genotypes until a champion is confirmed, processor time; successes of 20 fresh trials on the scan and in the "
     "truth",
     "5 of 5 seeds with 18 of 20 in truth", lambda found: found["hold_in_truth"] == 5)  # fmt: skip
def measure_champions() -> Figures:
    """Measure evolution from zero, and judge the champions where evolution has never been."""
    rows = []
    for seed in range(5):
        begin = time.process_time()
        run = ev.evolve(ev.EvolutionConfig(arena="gsrm", seed=seed, generations=30, workers=2))
        seconds = time.process_time() - begin
        judged = {
            place: ev.judge(run.champion, place, trials=20, seed=EXAM_SEED + seed, workers=2)
            for place in ("gsrm", "truth")
        }
        rows.append(
            {
                "seed": seed,
                "genotypes": int(run.history["evaluations"][-1]),
                "confirmed": bool(run.is_solved),
                "cpu_s": seconds,
                **{place: outcome.successes for place, outcome in judged.items()},
            }
        )
    hold = sum(each["truth"] >= 18 for each in rows)
    said = ", ".join(f"{each['genotypes']} ({each['gsrm']}, {each['truth']})" for each in rows)
    cost = float(np.median([each["cpu_s"] for each in rows]))
    return {"rows": rows, "hold_in_truth": hold, "said": f"{hold} of 5: {said}; {cost:.0f} s each"}


@row(GROUP, "Twenty champions as they were after 1, 2, 3, 4 and 6 generations (four seeds) in a model of half a survey "
     "of the course, 20 trials each: rank correlation (Spearman) of the successes in the model of training, and in "
     "that of the other half, with those in the truth; mean difference from the truth",
     "the other half is the better forecast",
     lambda found: found["other"]["rank_correlation"] > found["training"]["rank_correlation"]
     and found["other"]["difference"] < found["training"]["difference"])  # fmt: skip
def measure_transfer() -> Figures:
    """Measure how well successes in the other half foretell those in the truth."""
    truth = sg.load_arena("truth")
    with TemporaryDirectory() as name:
        arenas = make_models(sg.survey(truth, seed=EXAM_SEED), Path(name), EXAM_SEED)
        config = choose_task(arenas, Path(name), sg.snake(8), None, None, 0, 2)
        places = {"training": arenas[0], "other": arenas[1], "truth": truth}
        counts = []
        for seed in range(4):
            run = ev.evolve(replace(config, seed=seed, folder=None, generations=6, stop_when_solved=False))
            for generations in (1, 2, 3, 4, 6):
                entries = [each for each in run.record.entries if each.generation <= generations]
                best = select_champion(entries)
                assert best is not None
                assert run.champion is not None
                champion = replace(run.champion, genotype=tuple(best.genotype.tolist()))
                outcomes = [
                    ev.judge(champion, arena, trials=20, seed=EXAM_SEED + k, workers=2)
                    for k, arena in enumerate(places.values())
                ]
                counts.append([outcome.successes for outcome in outcomes])
    training, other, true = np.array(counts).T
    found: Figures = {"successes": dict(zip(places, np.array(counts).T.tolist(), strict=True))}
    for place, half in (("training", training), ("other", other)):
        found[place] = {
            "rank_correlation": float(stats.spearmanr(half, true).statistic),
            "difference": float(np.mean(np.abs(half - true))),
        }
    said = (
        f"{name} {found[each]['rank_correlation']:.2f}, {found[each]['difference']:.1f} of 20"
        for each, name in (("training", "training"), ("other", "other half"))
    )
    return found | {"said": "; ".join(said)}
