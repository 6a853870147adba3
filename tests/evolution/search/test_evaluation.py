"""Jobs and outcomes: equal on every backend, failures isolated."""

import numpy as np
import pytest
import toys
from evolution._src.backends.simulation import find_simulate, name_simulate

from evolution._src.backends.scoring import Scoring
from evolution._src.backends.settings import Randomization
from evolution._src.backends.trials import FAILED_PROGRESS, Outcome
from evolution._src.errors import RunError
from evolution._src.search.evaluation import evaluate, make_backend


@pytest.mark.parametrize("toy", [toys.fragile, toys.nonsense])
def test_a_failing_genotype_affects_no_other(toy):
    jobs = toys.make_jobs()
    outcomes = make_backend("batch", 2, simulate=toy).run(jobs)
    expected = toys.bowl(jobs, 1)
    is_bad = [job.genotype[0] > 0.3 for job in jobs]
    assert 0 < sum(is_bad) < len(jobs)
    for bad, outcome, good in zip(is_bad, outcomes, expected, strict=True):
        if bad:
            assert outcome.progress == FAILED_PROGRESS
            assert outcome.error
            assert outcome.succeeded == (False,) * 3
        else:
            assert outcome == good


def test_a_wrong_run_is_not_blamed_on_genotypes():
    with pytest.raises(RunError, match="no such arena"):
        make_backend("batch", 1, simulate=toys.wrong_run).run(toys.make_jobs())


def test_conditions_are_equal_for_equal_seeds_spread_and_within_their_ranges():
    randomization = Randomization()
    drawn = randomization.draw((1, 2), 10)
    again, other = randomization.draw((1, 2), 10), randomization.draw((1, 3), 10)
    low, high = randomization.friction
    for name in drawn:
        assert np.array_equal(drawn[name], again[name])
        assert not np.array_equal(drawn[name], other[name])
    tenths = np.floor((drawn["friction"] - low) / (high - low) * 10)
    assert sorted(tenths) == list(range(10))


def test_patch_friction_is_drawn_last_and_within_its_interval():
    plain, moved = Randomization(), Randomization(patch_friction=(-1.0, 1.0))
    before, after = plain.draw((1, 2), 10), moved.draw((1, 2), 10)
    assert set(after) - set(before) == {"patch_friction"}
    for name in before:
        np.testing.assert_array_equal(before[name], after[name])
    assert after["patch_friction"].min() < -0.8
    assert after["patch_friction"].max() > 0.8
    with pytest.raises(RunError, match="patch_friction"):
        Randomization(patch_friction=(-2.0, 2.0))


def test_fitness_is_progress_success_effort_and_body():
    outcome = Outcome(progress=1.2, effort=0.5, succeeded=(True, False))
    assert Scoring(success=2.0, effort=0.1, module=0.01).score(outcome, 8) == pytest.approx(
        1.2 + 1.0 - 0.05 - 0.08
    )


def test_evaluate_returns_one_fitness_and_outcome_each():
    fitness, outcomes = evaluate(np.zeros((3, 8)), trials=4, seed=1, simulate=toys.bowl)
    assert fitness.shape == (3,)
    assert fitness[0] == fitness[1]
    assert [outcome.trials for outcome in outcomes] == [4, 4, 4]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"genotypes": np.zeros((2, 7))}, "reads 8"),
        ({"genotypes": np.full(8, np.nan)}, "not finite"),
        ({"genotypes": np.zeros(8), "controller": "psychic"}, "there are: path, reactive"),
        ({"genotypes": np.zeros(8), "backend": "cloud"}, "there are: batch"),
        ({"genotypes": np.zeros(8), "workers": 0}, "at least 1"),
    ],
)
def test_evaluate_refuses(arguments, message):
    with pytest.raises(RunError, match=message):
        evaluate(simulate=toys.bowl, **arguments)


def test_workers_find_a_function_by_its_name():
    assert find_simulate(name_simulate(toys.bowl)) is toys.bowl
    with pytest.raises(RunError, match="function of a module"):
        name_simulate(lambda jobs, threads: [])
