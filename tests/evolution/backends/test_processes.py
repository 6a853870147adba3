"""Processes: equal results, and workers that die are replaced."""

import os
import signal

import numpy as np
import pytest
import toys

from evolution._src.backends.processes import ProcessBackend
from evolution._src.errors import RunError


@pytest.fixture
def make_pool():
    made = []

    def make(simulate, workers=2):
        made.append(ProcessBackend(simulate, workers))
        return made[-1]

    yield make
    for pool in made:
        pool.close()


@pytest.mark.slow
def test_processes_give_what_the_batch_gives_and_genotypes_travel_exactly(make_pool):
    jobs = toys.make_jobs()
    jobs[0] = jobs[0]._replace(genotype=np.nextafter(jobs[0].genotype, 1.0))
    pool = make_pool(toys.bowl, 3)
    expected = toys.bowl(jobs, 1)
    assert pool.run(jobs) == expected
    assert pool.run(jobs[:1]) == expected[:1]
    assert pool.run([]) == []


@pytest.mark.slow
def test_a_worker_that_dies_costs_nothing(make_pool, tmp_path, monkeypatch):
    monkeypatch.setenv(toys.MARK, str(tmp_path / "mark"))
    jobs = toys.make_jobs()
    assert make_pool(toys.dies_once).run(jobs) == toys.bowl(jobs, 1)
    assert (tmp_path / "mark").exists()


@pytest.mark.slow
def test_a_worker_killed_between_generations_is_replaced(make_pool):
    jobs = toys.make_jobs()
    pool = make_pool(toys.bowl)
    pool.run(jobs)
    victim = pool.process_ids[0]
    os.kill(victim, signal.SIGKILL)
    assert pool.run(jobs) == toys.bowl(jobs, 1)
    assert victim not in pool.process_ids


@pytest.mark.slow
def test_a_genotype_that_kills_its_workers_is_recorded(make_pool):
    jobs = toys.make_jobs(6)
    outcomes = make_pool(toys.deadly).run(jobs)
    for job, outcome, good in zip(jobs, outcomes, toys.bowl(jobs, 1), strict=True):
        assert outcome.error == "its worker died 2 times" if job.genotype[0] > 0.3 else outcome == good
    assert any(outcome.error for outcome in outcomes)


@pytest.mark.slow
def test_what_is_wrong_with_the_run_comes_through_from_a_worker(make_pool, monkeypatch):
    with pytest.raises(RunError, match="no such arena"):
        make_pool(toys.wrong_run).run(toys.make_jobs())
    pool = make_pool(toys.bowl)
    monkeypatch.setattr(pool, "_simulate", "no_such_module:simulate")
    with pytest.raises(RunError, match="ended at its start"):
        pool.run(toys.make_jobs())
