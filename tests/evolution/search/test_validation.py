"""Champions: rules known by hand."""

from collections import defaultdict

import numpy as np
import pytest
import toys

from evolution._src.backends.trials import Outcome
from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve
from evolution._src.search.record import HISTORY, SAMPLE, VALIDATION, Entry, Record
from evolution._src.search.validation import Champion, Validation, find_candidates, select_champion


def make_entry(index: int, kind: int, successes: str, generation: int = 0, fitness: float = 0.0) -> Entry:
    outcome = Outcome(0.0, 0.0, tuple(flag == "1" for flag in successes))
    return Entry(generation, kind, index, np.full(2, float(index)), fitness, outcome)


def make_record(*entries: Entry) -> Record:
    record = Record()
    last = max(entry.generation for entry in entries)
    for generation in range(last + 1):
        row = dict.fromkeys([*(HISTORY.names or ())], 0.0) | {"generation": generation}
        record.add_generation([entry for entry in entries if entry.generation == generation], row)
    return record


def test_the_champion_is_the_one_with_the_best_fresh_trials_not_the_luckiest_sample():
    record = make_record(
        make_entry(0, SAMPLE, "11", fitness=9.0),
        make_entry(1, SAMPLE, "11", fitness=2.0),
        make_entry(2, SAMPLE, "00", fitness=99.0),
        make_entry(0, VALIDATION, "1111000000"),
        make_entry(1, VALIDATION, "1111111111"),
        make_entry(1, VALIDATION, "1111111110"),
    )
    selected = select_champion(record)
    assert selected is not None
    assert selected.index == 1
    assert (selected.outcome.successes, selected.outcome.trials) == (19, 20)


def test_without_fresh_trials_the_fittest_sample_stands_in():
    record = make_record(make_entry(0, SAMPLE, "01", fitness=1.0), make_entry(1, SAMPLE, "00", fitness=3.0))
    selected = select_champion(record)
    assert selected is not None
    assert (selected.index, selected.kind) == (1, SAMPLE)


def test_candidates_are_those_that_succeeded_in_all_trials():
    outcomes = [
        Outcome(0.0, 0.0, successes)
        for successes in ((True, True), (True, False), (True, True), (True, True))
    ]
    fitness = np.array([1.0, 9.0, 3.0, 2.0])
    assert Validation(candidates=2, mean_share=2).select_candidates(fitness, outcomes) == [2, 3]


def test_the_mean_of_the_search_is_a_candidate_where_enough_genotypes_succeed():
    outcomes = [Outcome(0.0, 0.0, (successes,)) for successes in (True, False, False, False)]
    fitness = np.arange(4.0)
    assert Validation(mean_share=0.25).select_candidates(fitness, outcomes) == [4, 0]
    assert Validation(mean_share=0.5).select_candidates(fitness, outcomes) == [0]
    assert Validation().select_candidates(fitness, outcomes[1:]) == []


def test_validation_refuses():
    for arguments in (
        {"candidates": -1},
        {"rounds": ()},
        {"rounds": (8, 0)},
        {"continue_share": 1.5},
        {"solved_share": -0.1},
        {"solved_share": 1.1},
        {"continue_share": -0.1},
        {"mean_share": 0.0},
    ):
        with pytest.raises(RunError):
            Validation(**arguments)


def test_records_survive_bytes():
    record = make_record(make_entry(0, SAMPLE, "10"), make_entry(1, SAMPLE, "11", generation=1))
    again, digest = Record.from_bytes(record.to_bytes("abc"), "a file")
    assert digest == "abc"
    assert np.array_equal(again.history, record.history)
    for ours, theirs in zip(again.entries, record.entries, strict=True):
        assert ours.outcome == theirs.outcome
        assert np.array_equal(ours.genotype, theirs.genotype)
    assert [len(entries) for entries, _ in again.generations()] == [1, 1]


def make_champion(**changes):
    usual = {"genotype": (0.1,), "names": ("a",), "controller": "posture", "modules": 3, "arena": "truth"}
    return Champion(**usual | {"generation": 4, "fitness": 1.5} | changes)


def test_champions_survive_json():
    champion = make_champion(
        genotype=(0.1, 0.2), names=("a", "b"), successes=15, trials=16, environment=(("pit", 0.3),)
    )
    assert Champion.from_dict(champion.as_dict()) == champion
    assert champion.score == pytest.approx(16 / 18)
    with pytest.raises(RunError, match="wings"):
        Champion.from_dict(champion.as_dict() | {"wings": 2})


def test_no_candidate_and_no_round_has_conditions_that_were_used_before():
    """Genotypes of a generation share theirs, so do re-evaluations; all others differ."""
    observed = toys.Observed()
    validation = Validation(candidates=2, rounds=(3, 3))
    config = EvolutionConfig(generations=3, stop_when_solved=False, validation=validation)
    run = evolve(config, simulate=observed)
    groups, rounds = defaultdict(set), defaultdict(int)
    for entry, job in zip(run.record.entries, observed.jobs, strict=True):
        group = (entry.generation, entry.kind)
        if entry.kind == VALIDATION:
            candidate = (*group, entry.index)
            group = (*candidate, rounds[candidate])
            rounds[candidate] += 1
        groups[group].add(toys.find_conditions(job))
    assert {group[1] for group in groups} == {SAMPLE, VALIDATION}
    assert len(rounds) == 9  # two genotypes and the mean, in each of three generations
    assert all(len(conditions) == 1 for conditions in groups.values())
    values = [value for conditions in groups.values() for each in conditions for value in each]
    assert len(set(values)) == len(values)


@pytest.mark.parametrize(
    ("successes", "tried"),
    [
        ({10: 8}, (10,)),
        ({10: 9}, (10, 5, 4)),
        ({10: 9, 5: 4}, (10, 5)),
        ({10: 10, 5: 4}, (10, 5, 4)),
        ({10: 10, 5: 3}, (10, 5)),
    ],
)
def test_a_candidate_continues_while_enough_of_all_its_trials_succeed(successes, tried):
    validation = Validation(rounds=(10, 5, 4), continue_share=0.9)
    config = EvolutionConfig(generations=1, trials=3, validation=validation)
    run = evolve(config, simulate=toys.Observed(successes))
    entries = [entry for entry in run.record.entries if entry.kind == VALIDATION]
    for index in {entry.index for entry in entries}:
        assert tuple(entry.outcome.trials for entry in entries if entry.index == index) == tried
    assert len({entry.index for entry in entries}) == 2  # the fittest and the mean


def test_one_candidate_that_drops_out_takes_no_other_with_it():
    class FirstFails(toys.Observed):
        def __call__(self, jobs, threads):
            outcomes = super().__call__(jobs, threads)
            if jobs[0].trials.start == "floor" and len(jobs) == 2:
                outcomes[0] = Outcome(0.0, 0.0, (False,) * outcomes[0].trials)
            return outcomes

    run = evolve(EvolutionConfig(generations=1), simulate=FirstFails())
    tried = defaultdict(int)
    for entry in run.record.entries:
        if entry.kind == VALIDATION:
            tried[entry.index] += entry.outcome.trials
    assert sorted(tried.values()) == [Validation().rounds[0], Validation().trials]


@pytest.mark.parametrize(("samples", "fresh"), [("pit", "floor"), ("floor", "pit"), ("floor", "floor")])
def test_fresh_trials_begin_where_validation_says(samples, fresh):
    observed = toys.Observed()
    run = evolve(
        EvolutionConfig(generations=1, start=samples, validation=Validation(start=fresh)), simulate=observed
    )
    for entry, job in zip(run.record.entries, observed.jobs, strict=True):
        assert job.trials.start == (fresh if entry.kind == VALIDATION else samples)
    assert any(entry.kind == VALIDATION for entry in run.record.entries)


def test_a_run_is_solved_by_enough_successes_in_all_rounds():
    validation = Validation(rounds=(8, 8), solved_share=0.75)
    for successes, trials, is_solved in ((12, 16, True), (11, 16, False), (15, 15, False), (24, 32, True)):
        assert validation.is_solved(successes, trials) is is_solved


def test_validation_takes_its_limits():
    for arguments in (
        {"candidates": 0},
        {"rounds": (1,)},
        {"continue_share": 0, "solved_share": 0},
        {"continue_share": 1, "solved_share": 1},
        {"mean_share": 0.01},
    ):
        assert Validation(**arguments)
    assert Validation(rounds=(3, 4)).trials == 7


def test_of_equally_fit_genotypes_the_first_are_candidates():
    outcomes = [Outcome(0.0, 0.0, (True,))] * 4
    assert Validation(candidates=2, mean_share=2).select_candidates(
        np.array([1.0, 3.0, 1.0, 3.0]), outcomes
    ) == [1, 3]
    assert Validation(candidates=3, mean_share=2).select_candidates(
        np.array([1.0, 3.0, 1.0, 3.0]), outcomes
    ) == [1, 3, 0]
    assert Validation(candidates=0, mean_share=1).select_candidates(np.zeros(4), outcomes) == [4]


def test_fresh_trials_of_all_rounds_are_pooled():
    first = make_entry(3, VALIDATION, "1110")._replace(
        outcome=Outcome(1.0, 0.4, (True, True, True, False), 10.0, 1)
    )
    second = make_entry(3, VALIDATION, "11")._replace(outcome=Outcome(4.0, 0.1, (True, True), 5.0, 2))
    other = make_entry(3, VALIDATION, "1", generation=1)
    pooled, alone = find_candidates([first, make_entry(3, SAMPLE, "11"), other, second])
    assert alone is other
    assert pooled.outcome.succeeded == (True, True, True, False, True, True)
    assert (pooled.outcome.progress, pooled.outcome.effort) == pytest.approx((2.0, 0.3))
    assert (pooled.outcome.seconds, pooled.outcome.diverged) == (15.0, 3)
    assert (pooled.index, pooled.generation, pooled.kind) == (3, 0, VALIDATION)


def test_many_trials_count_for_more_than_a_few_lucky_ones():
    few, many = make_entry(0, VALIDATION, "1" * 8), make_entry(1, VALIDATION, "1" * 47 + "0")
    assert getattr(select_champion(make_record(few, many)), "index", None) == 1


def test_of_equal_champions_the_later_one_is_selected():
    entries = [make_entry(g, VALIDATION, "1" * 8, generation=g) for g in range(3)]
    entries += [make_entry(9, SAMPLE, "1", generation=g, fitness=float(g)) for g in range(3)]
    record = make_record(*entries)
    found = select_champion(record)
    assert found is not None
    assert (found.generation, found.kind) == (2, VALIDATION)


def test_a_champion_as_plain_content():
    champion = make_champion(environment=(("pit", 0.3), ("bottomless", True)))
    content = champion.as_dict()
    assert content["environment"] == {"pit": 0.3, "bottomless": True}
    assert content["genotype"] == [0.1]
    assert champion.score == 0.0
    again = Champion.from_dict(content | {"genotype": [1], "names": ["b"]})
    assert again.genotype == (1.0,)
    assert isinstance(again.genotype[0], float)
    assert again.names == ("b",)
    assert again.environment == (("bottomless", True), ("pit", 0.3))


@pytest.mark.parametrize(
    "change",
    [
        {"names": ("a", "b")},
        {"genotype": (np.nan,)},
        {"genotype": (np.inf,)},
        {"genotype": ("x",)},
        {"names": 3},
    ],
)
def test_invalid_champions_are_refused(change):
    champion = make_champion()
    (name,) = change
    with pytest.raises(RunError, match=rf"^(genotype|{name})"):
        Champion.from_dict(champion.as_dict() | change)
    with pytest.raises(RunError, match="controller"):
        Champion.from_dict({"genotype": (0.1,), "names": ("a",)})
