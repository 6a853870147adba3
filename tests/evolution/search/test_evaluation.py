"""Fitness of genotypes once or call after call: failures isolated, workers warm, and what does not fit refused."""

import numpy as np
import pytest
import toys

from evolution._src.backends import rollout
from evolution._src.backends.cluster import make_backend
from evolution._src.backends.pool import find_simulate, name_simulate
from evolution._src.backends.scoring import Outcome, Scoring
from evolution._src.backends.settings import Randomization
from evolution._src.backends.trials import FAILED_PROGRESS
from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.evaluation import Evaluator, evaluate
from symbrion_gym._src.robot.organism import cross, snake

SHORT = {"modules": 4, "trials": 2, "duration": 1.0, "controller": "reactive"}


@pytest.mark.parametrize("toy", [toys.fragile, toys.nonsense])
def test_a_failing_genotype_affects_no_other(toy):
    jobs = toys.make_jobs()
    outcomes = make_backend("batch", 2, simulate=toy).run(jobs)
    is_bad = [job.genotype[0] > 0.3 for job in jobs]
    assert 0 < sum(is_bad) < len(jobs)
    for bad, outcome, good in zip(is_bad, outcomes, toys.bowl(jobs, 1), strict=True):
        if bad:
            assert (outcome.progress, outcome.succeeded) == (FAILED_PROGRESS, (False,) * 3)
            assert outcome.error
        else:
            assert outcome == good


def test_a_wrong_run_is_not_blamed_on_genotypes():
    with pytest.raises(RunError, match="no such arena"):
        make_backend("batch", 1, simulate=toys.wrong_run).run(toys.make_jobs())


def test_conditions_are_equal_for_equal_seeds_spread_and_within_their_ranges():
    plain, moved = Randomization(), Randomization(patch_friction=(-1.0, 1.0))
    drawn, again, other = plain.draw((1, 2), 10), plain.draw((1, 2), 10), plain.draw((1, 3), 10)
    low, high = plain.friction
    for name in drawn:
        assert np.array_equal(drawn[name], again[name])
        assert not np.array_equal(drawn[name], other[name])
    assert sorted(np.floor((drawn["friction"] - low) / (high - low) * 10)) == list(range(10))
    after = moved.draw((1, 2), 10)
    np.testing.assert_equal({name: after[name] for name in drawn}, drawn)  # patches are drawn last
    assert np.ptp(after["patch_friction"]) > 1.6
    with pytest.raises(RunError, match="patch_friction"):
        Randomization(patch_friction=(-2.0, 2.0))


def test_fitness_is_progress_success_effort_and_body():
    outcome = Outcome(progress=1.2, effort=0.5, succeeded=(True, False))
    scoring = Scoring(success=2.0, effort=0.1, module=0.01)
    assert scoring.score(outcome, 8) == pytest.approx(1.2 + 1.0 - 0.05 - 0.08)


def test_workers_find_a_function_by_its_name():
    assert find_simulate(name_simulate(toys.bowl)) is toys.bowl
    with pytest.raises(RunError, match="function of a module"):
        name_simulate(lambda jobs, threads: [])


def test_evaluate_returns_one_fitness_and_outcome_each():
    fitness, outcomes = evaluate(np.zeros((3, 8)), trials=4, seed=1, simulate=toys.bowl)
    assert fitness.shape == (3,)
    assert fitness[0] == fitness[1]
    assert [outcome.trials for outcome in outcomes] == [4, 4, 4]


@pytest.fixture
def compiled(monkeypatch):
    """Sizes of the vector environments made."""
    sizes = []
    original = rollout.OrganismVectorEnv

    def make(**options):
        sizes.append(options["num_envs"])
        return original(**options)

    monkeypatch.setattr(rollout, "OrganismVectorEnv", make)
    monkeypatch.setattr(rollout, "_environments", type(rollout._environments)())
    return sizes


@pytest.mark.slow
def test_the_second_call_compiles_nothing(compiled):
    genotypes = np.random.default_rng(0).uniform(-0.5, 0.5, (10, 8))
    with Evaluator(**SHORT) as evaluator:
        first = evaluator(genotypes)
        assert evaluator(genotypes).outcomes == first.outcomes
        assert evaluator(genotypes[:3]).outcomes == first.outcomes[:3]
    assert compiled == [12, 12]  # one for each stretch


@pytest.mark.slow
def test_worker_processes_stay_between_calls():
    with Evaluator(backend="processes", workers=2, simulate=toys.bowl) as evaluator:
        one = evaluator(np.zeros((4, 8)))
        ids = evaluator._backend.process_ids
        two = evaluator(list(np.zeros((4, 8))))
        assert evaluator._backend.process_ids == ids
    assert one.outcomes == two.outcomes == evaluate(np.zeros((4, 8)), simulate=toys.bowl).outcomes


def test_genes_beyond_the_bounds_are_tried_as_they_are():
    observed, far = toys.Observed(), np.zeros((2, 8))
    far[1, 3] = -2.0
    with Evaluator(simulate=observed) as evaluator:
        evaluator(far)
    assert [job.genotype.tolist() for job in observed.jobs] == far.tolist()


@pytest.mark.parametrize("modules", [8, 6])
def test_two_bodies_are_refused_by_name(modules):
    for make in (Evaluator, EvolutionConfig):
        with pytest.raises(
            RunError, match=rf"modules is {modules} and organism, too, is given, of 7 modules"
        ):
            make(modules=modules, organism="H")
    config = EvolutionConfig(modules=7, organism="H")
    assert EvolutionConfig.from_json(config.to_json()) == config == EvolutionConfig(organism="H")
    assert Evaluator(organism="H").trials.modules == 7
    assert Evaluator(organism=3).trials.find_organism() == snake(3)


def test_seeds_give_conditions():
    with Evaluator(simulate=toys.bowl, seed=3) as evaluator:
        default, same = evaluator(np.zeros(8)), evaluator(np.zeros(8))
        other, again = evaluator(np.zeros(8), seed=1), evaluator(np.zeros(8), seed=1)
        with pytest.raises(RunError, match="seed must be"):
            evaluator(np.zeros(8), seed=-1)
    assert default.fitness == same.fitness == evaluate(np.zeros(8), seed=3, simulate=toys.bowl).fitness
    assert other.fitness == again.fitness != default.fitness
    with pytest.raises(RunError, match="closed"):
        evaluator(np.zeros(8))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"wings": 2}, "no 'wings'; there are: modules"),
        ({"controller": "psychic"}, "there are: path"),
        ({"modules": cross(1), "organism": cross(1)}, "leave out one"),
        ({"scoring": 7}, "scoring"),
        ({"trials": 0}, "trials must be a whole number from 1"),
        ({"seed": -1}, "seed must be a whole number from 0"),
        ({"backend": "cloud"}, "there are: batch"),
        ({"workers": 0}, "at least 1"),
        ({"genotypes": np.zeros((2, 7))}, "reads 8"),
        ({"genotypes": np.full(8, np.nan)}, "not finite"),
    ],
)
def test_evaluate_refuses(options, message):
    with pytest.raises(RunError, match=message):
        evaluate(**{"genotypes": np.zeros(8), "simulate": toys.bowl} | options)


@pytest.mark.slow
def test_bodies_are_numbers_or_organisms():
    by_number = evaluate(np.zeros(8), **SHORT)
    assert by_number.outcomes == evaluate(np.zeros(8), **SHORT | {"modules": snake(4)}).outcomes
    options = SHORT | {"modules": cross(1), "scoring": lambda outcome, body: body.num_modules}
    fitness, outcomes = evaluate(np.zeros(8), **options)
    assert fitness == 5
    assert not outcomes[0].error


@pytest.mark.parametrize("track_control", ["body", "modules"])
def test_controllers_drive_the_tracks_where_these_are_part_of_the_action(track_control):
    options = SHORT | {"track_control": track_control}
    with Evaluator(**options) as evaluator:
        count = len(evaluator.controller.parameters)
        assert count == len(evaluator.controller.lower) == len(evaluator.controller.initial)
        _, outcomes = evaluator(np.zeros(count))
    assert not outcomes[0].error
    with pytest.raises(RunError, match="genotypes of 2 numbers"):
        evaluate(np.zeros(2), **options)
