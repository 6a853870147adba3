"""Runs side by side are those that `evolve` gives, and their samples are tried in one batch."""

from dataclasses import replace

import numpy as np
import pytest
import toys

import evolution as ev
from evolution._src.backends import rollout
from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve
from evolution._src.search.record import VALIDATION
from evolution._src.search.side_by_side import evolve_side_by_side

CONFIG = EvolutionConfig(arena="truth", generations=4, stop_when_solved=False)
CONFIGS = [replace(CONFIG, seed=seed, generations=3 + seed, population_size=6 + seed) for seed in range(3)]


def list_entries(run):
    return [(e.generation, e.kind, e.index, e.genotype.tolist(), e.outcome) for e in run.record.entries]


def test_each_run_is_that_of_evolve():
    together = evolve_side_by_side(CONFIGS, simulate=toys.Observed({4: 3}))
    alone = [evolve(config, simulate=toys.Observed({4: 3})) for config in CONFIGS]
    assert [len(run.history) for run in together] == [3, 4, 5]
    for one, other in zip(together, alone, strict=True):
        assert list_entries(one) == list_entries(other)


def test_samples_of_all_share_a_batch():
    sizes = []

    def simulate(jobs, threads):
        kinds = {job.trials.seed[1:2] == (VALIDATION,) for job in jobs}
        if kinds == {False}:
            sizes.append(len(jobs))
        return toys.Observed()(jobs, threads)

    evolve_side_by_side(CONFIGS, simulate=simulate)
    assert sum(config.population_size for config in CONFIGS) in sizes
    assert max(sizes) <= sum(config.population_size for config in CONFIGS)


def test_on_a_device_candidates_are_tried_on_the_c_engine(monkeypatch):
    from evolution._src.backends import making

    device, exact = toys.Observed(), toys.Observed()
    monkeypatch.setattr(making, "require_extras", lambda *_: None)
    monkeypatch.setattr(rollout, "simulate_on_device", device)
    monkeypatch.setattr(rollout, "simulate", exact)
    evolve_side_by_side([replace(config, backend="warp") for config in CONFIGS])
    assert device.jobs
    assert {job.trials.seed[1] for job in exact.jobs} == {VALIDATION}
    assert VALIDATION not in {job.trials.seed[1] for job in device.jobs}


def test_a_run_that_fails_holds_up_no_other():
    calls = []

    def simulate(jobs, threads):
        calls.append(len(jobs))
        if len(calls) == 1:
            raise RunError("no physics today")
        return toys.Observed()(jobs, threads)

    with pytest.raises(RunError, match="no physics today"):
        evolve_side_by_side(CONFIGS, simulate=simulate)


def test_physics_gives_the_same_bits_side_by_side():
    configs = [
        EvolutionConfig(
            arena="truth",
            modules=2,
            population_size=4,
            generations=1,
            trials=1,
            controller="posture",
            seed=seed,
            start="pit",
            environment={"duration": 0.5, "pit": 0.2},  # pyright: ignore[reportArgumentType]
        )
        for seed in range(2)
    ]
    together, alone = ev.evolve_side_by_side(configs), [ev.evolve(config) for config in configs]
    for one, other in zip(together, alone, strict=True):
        assert list_entries(one) == list_entries(other)
        assert np.isfinite(one.history["best"]).all()


@pytest.mark.parametrize(
    "configs", [[], [replace(CONFIG, backend="processes")], [CONFIG, replace(CONFIG, backend="warp")]]
)
def test_backends_that_cannot_share_a_batch_are_refused(configs):
    with pytest.raises(RunError, match="runs side by side need one of batch and warp"):
        evolve_side_by_side(configs)
