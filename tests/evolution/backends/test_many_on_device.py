"""Islands, MAP-Elites and grids of genes on Warp's device: one batch for each generation, the same interface."""

from dataclasses import replace
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest

import evolution as ev
from evolution._src.backends import rollout
from evolution._src.search.record import VALIDATION

pytestmark = pytest.mark.slow
OPTIONS: dict[str, Any] = {
    "modules": 3,
    "trials": 1,
    "controller": "travelling",
    "start": "pit",
    "randomization": ev.Randomization(stretch=(1.0,)),
}
ENVIRONMENT: dict[str, Any] = {"pit": 0.2, "duration": 1.0}
CONFIG = ev.EvolutionConfig(
    arena="truth",
    generations=2,
    population_size=4,
    backend="warp",
    stop_when_solved=False,
    validation=ev.Validation(rounds=(2,)),
    environment=ENVIRONMENT,  # pyright: ignore[reportArgumentType]
    **OPTIONS,
)
ARCHIVE = ev.ArchiveConfig(("effort", "seconds"), (4, 4), (0.0, 0.0), (0.1, 4.0))


@pytest.fixture
def batches(monkeypatch):
    """Numbers of jobs that were tried on the device, call by call."""
    pytest.importorskip("mujoco_warp", reason="needs the extra gpu")
    sizes, simulate = [], rollout.simulate_on_device

    def observed(jobs, threads=1):
        sizes.append(len(jobs))
        assert (VALIDATION,) not in {job.trials.seed[1:2] for job in jobs}
        return simulate(jobs, threads)

    monkeypatch.setattr(rollout, "simulate_on_device", observed)
    return sizes


def check(run):
    assert len(run.history) == 2
    assert not any(entry.outcome.error for entry in run.record.entries)
    assert all(entry.outcome.seconds > 0.0 for entry in run.record.entries)


def test_islands_share_a_batch(batches):
    check(ev.evolve(replace(CONFIG, islands=ev.IslandsConfig(2, interval=1))))
    assert batches == [8, 8]


def test_elites_are_sorted_by_what_the_device_tells(batches):
    if find_spec("ribs") is None:
        pytest.skip("the extra ribs is not installed")
    run = ev.evolve(replace(CONFIG, archive=ARCHIVE))
    check(run)
    assert batches == [4, 4]
    elites = ev.find_elites(run)
    assert elites
    places = [ARCHIVE.measure(entry.outcome) for entry in elites]
    assert np.isfinite(places).all()


def test_a_grid_is_one_batch(batches):
    name = ev.Evaluator(**OPTIONS).controller.parameters[0]
    grid = ev.evaluate_grid({name: [0.0, 0.2, 0.4]}, arena="truth", backend="warp", **OPTIONS, **ENVIRONMENT)
    assert batches == [3]
    exact = ev.evaluate_grid({name: [0.0, 0.2, 0.4]}, arena="truth", **OPTIONS, **ENVIRONMENT)
    assert np.abs(grid.fitness - exact.fitness).max() < 0.3
    assert [each.seconds for each in grid.outcomes] == pytest.approx(
        [e.seconds for e in exact.outcomes], abs=0.2
    )
