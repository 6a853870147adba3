"""Confirmation of a champion: the reliable body wins, not the lucky one; stored, the same after any interruption."""

from dataclasses import replace

import made_bodies
import numpy as np
import pytest

import evolution as ev
from evolution._src.errors import RunError
from evolution._src.search.bodies.run import list_candidates
from evolution._src.search.record import CONFIRMATION

RELIABLE = 2
"""Modules of bodies that always succeed in fresh trials; the others succeed in three of four."""
FILES = ("record.npz", "bodies.csv", "champion.json")
COUNT = 8
"""Candidates."""


class Physics:
    """Larger bodies go farther, and do not hold; keeps its trials, and is killed after some."""

    def __init__(self, most=10**6):
        self.most, self.trials = most, []

    def __call__(self, jobs, threads):
        outcomes = []
        for job in jobs:
            modules, count = job.trials.find_organism().num_modules, job.trials.count
            self.trials.append(job.trials)
            if len(self.trials) > self.most:
                raise KeyboardInterrupt
            is_fresh = job.trials.seed[1] == CONFIRMATION
            won = count if modules == RELIABLE or not is_fresh else 3 * count // 4
            progress = 0.1 * modules + 1e-3 * float(job.genotype.sum())
            flags = (True,) * won + (False,) * (count - won)
            outcomes.append(ev.Outcome(progress, 0.0, flags, seconds=float(count)))
        return outcomes


def search(folder, physics=None, count=COUNT, **changes):
    physics = physics or Physics()
    bodies = ev.BodiesConfig(largest=3, children=4, population_size=4)
    config = made_bodies.make_config(**{"bodies": bodies, "iterations": 4, "folder": folder} | changes)
    run = ev.evolve(config, simulate=physics)
    ev.confirm(run, count, simulate=physics)
    return run


def read_files(folder):
    record = ev.load_run(folder).record.columns()
    return [(folder / name).read_bytes() for name in FILES[1:]], {
        name: str(each) for name, each in record.items()
    }


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return search(tmp_path_factory.mktemp("whole"))


def test_the_most_reliable_candidate_is_the_champion_and_stored(whole):
    assert whole.champion.modules == 3  # the fittest of the exams
    found = ev.load_run(whole.folder)
    assert (found.champion.modules, found.champion.successes, found.champion.trials) == (RELIABLE, 48, 48)
    assert found.confirmation.champion == ev.load_champion(whole.folder) == found.champion
    assert found.confirmation.result.body.num_modules == RELIABLE
    assert found.best == whole.best


def test_candidates_that_fail_get_no_further_round_and_trials_are_not_those_of_the_search(whole):
    physics = Physics()
    confirmed = ev.confirm(replace(whole, folder=None), 20, simulate=physics)
    candidates = list_candidates(whole.results)[:20]
    reliable = sum(each.body.num_modules == RELIABLE for each in candidates)
    assert confirmed.seconds == 48 * reliable + 8 * (len(candidates) - reliable)
    assert {trials.seed[:2] for trials in physics.trials} == {(0, CONFIRMATION)}
    draws = {
        trials.seed: tuple(trials.randomization.draw(trials.seed, 4)["yaw"]) for trials in physics.trials
    }
    assert len(set(draws.values())) == len(draws) == 4


@pytest.mark.parametrize(("start", "expected"), [("pit", "floor"), (None, None), ((0.1, 0.0), (0.1, 0.0))])
def test_trials_begin_where_those_of_the_final_test_do(start, expected):
    physics = Physics()
    search(None, physics, 2, task="cross_gap", start=start, iterations=1)
    fresh = [trials for trials in physics.trials if trials.seed[1] == CONFIRMATION]
    assert {trials.find_start() for trials in fresh} == {expected}


def test_each_body_is_a_candidate_once_with_its_fittest_examined_result(whole):
    better = whole.results[0]._replace(level=1, fitness=99.0)
    chosen = list_candidates([*whole.results, better])
    assert chosen[0] is better
    assert len({each.body.canonical_text for each in chosen}) == len(chosen)
    assert np.all(np.diff([each.fitness for each in chosen]) <= 0)
    untried = [result._replace(trials=0) for result in whole.results]
    assert list_candidates(untried)[0].fitness == max(result.fitness for result in untried)
    assert list_candidates([*untried, whole.results[0]]) == [whole.results[0]]


@pytest.mark.slow
def test_any_interruption_gives_the_same_files(whole, tmp_path):
    count = Physics()
    search(None, count)
    for workers, most in enumerate((5, len(count.trials) // 2, len(count.trials) - 2), start=1):
        folder = tmp_path / str(most)
        with pytest.raises(KeyboardInterrupt):
            search(folder, Physics(most), workers=workers)
        run = ev.resume(folder, simulate=Physics(), workers=4 - workers)
        ev.confirm(run, COUNT, simulate=Physics())
        assert read_files(folder) == read_files(whole.folder)


@pytest.mark.slow
def test_a_longer_run_is_confirmed_again_and_a_shorter_one_refused(whole, tmp_path):
    short = search(tmp_path / "parts", iterations=1)
    assert ev.load_run(tmp_path / "parts").confirmation is not None
    run = ev.resume(tmp_path / "parts", iterations=4, simulate=Physics())
    assert run.confirmation is None
    with pytest.raises(RunError, match="read it again"):
        ev.confirm(short, simulate=Physics())
    ev.confirm(run, COUNT, simulate=Physics())
    assert read_files(tmp_path / "parts") == read_files(whole.folder)
    again = ev.confirm(ev.load_run(tmp_path / "parts"), COUNT, ev.Validation(rounds=(4, 4)), Physics())
    assert again.champion.trials == ev.load_run(tmp_path / "parts").champion.trials == 8


def test_what_cannot_be_confirmed_is_refused(whole):
    with pytest.raises(RunError, match="no body has learned"):
        ev.confirm(replace(whole, results=()), simulate=Physics())
    with pytest.raises(RunError, match="candidates"):
        ev.confirm(whole, candidates=0, simulate=Physics())
