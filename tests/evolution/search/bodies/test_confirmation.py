"""Confirmation of a champion: the reliable body wins, not the lucky one."""

import made_bodies
import numpy as np
import pytest
from evolution._src.search.bodies.record import BodyRecord

import evolution as ev
from evolution._src.backends.trials import Outcome
from evolution._src.errors import RunError
from evolution._src.search.bodies.genome import genome_of
from evolution._src.search.bodies.run import BodyRun
from evolution._src.search.record import CONFIRMATION, confirm, find_candidates

RELIABLE = 2
"""Modules of bodies that always succeed."""


def simulate(jobs, threads):
    """Larger bodies go farther; outside of the search, bodies of two modules alone succeed, those of one by half."""
    outcomes = []
    for job in jobs:
        modules, count = genome_of(job.trials.find_organism()).num_modules, job.trials.count
        shares = {1: 0.5, RELIABLE: 1.0}
        is_confirmation = job.trials.seed[1] == CONFIRMATION
        won = round(shares.get(modules, 0.0) * count) if is_confirmation else count
        outcomes.append(Outcome(0.1 * modules, 0.0, (True,) * won + (False,) * (count - won), seconds=count))
    return outcomes


@pytest.fixture
def run():
    return ev.evolve(made_bodies.make_config(), simulate=simulate)


def test_the_most_reliable_candidate_is_the_champion(run):
    assert run.champion.modules == 3  # the fittest of the exams
    confirmed = confirm(run, candidates=20, simulate=simulate)
    assert confirmed.champion.modules == RELIABLE
    assert (confirmed.champion.successes, confirmed.champion.trials) == (48, 48)
    assert confirmed.result.body.num_modules == RELIABLE


def test_candidates_that_fail_get_no_further_round(run):
    bodies = len(run.results)
    reliable = sum(each.body.num_modules == RELIABLE for each in run.results)
    confirmed = confirm(run, candidates=bodies, simulate=simulate)
    assert confirmed.seconds == 48 * reliable + 8 * (bodies - reliable)


def test_trials_are_not_those_of_the_search(run):
    seen = []

    def watch(jobs, threads):
        seen.extend(job.trials for job in jobs)
        return simulate(jobs, threads)

    confirm(run, candidates=20, simulate=watch)
    assert {trials.seed[:2] for trials in seen} == {(0, CONFIRMATION)}
    assert {trials.arena for trials in seen} == {run.config.arena}
    draws = {trials.seed: trials.randomization.draw(trials.seed, 4)["yaw"].tolist() for trials in seen}
    assert len({tuple(values) for values in draws.values()}) == len(draws) == 4


@pytest.mark.parametrize(("start", "expected"), [("pit", "floor"), (None, None), ((0.1, 0.0), (0.1, 0.0))])
def test_trials_begin_where_those_of_the_final_test_do(start, expected):
    config = made_bodies.make_config(task="cross_gap", start=start)
    found = ev.evolve(config, simulate=simulate)
    seen = set()

    def watch(jobs, threads):
        seen.update(job.trials.find_start() for job in jobs)
        return simulate(jobs, threads)

    confirm(found, candidates=2, simulate=watch)
    assert seen == {expected}


def test_each_body_is_a_candidate_once_with_its_fittest_result(run):
    results = run.results
    better = results[0]._replace(level=1, fitness=99.0)
    chosen = find_candidates([*results, better], 3)
    assert chosen[0] is better
    assert len({each.body.canonical_text for each in chosen}) == 3
    assert np.all(np.diff([each.fitness for each in chosen]) <= 0)


def test_without_exams_the_best_of_learning_counts(run):
    untried = [result._replace(trials=0, successes=0) for result in run.results]
    examined = run.results[0]._replace(fitness=-5.0)
    assert find_candidates(untried, 1)[0].fitness == max(result.fitness for result in untried)
    assert find_candidates([*untried, examined], 4) == [examined]


def test_what_cannot_be_confirmed_is_refused(run):
    with pytest.raises(RunError, match="no body has learned"):
        confirm(BodyRun(run.config, BodyRecord(), ()), simulate=simulate)
    with pytest.raises(RunError, match="candidates"):
        confirm(run, candidates=0, simulate=simulate)
