"""Champions: rules known by hand."""

from collections import defaultdict

import numpy as np
import pytest
import toys

from evolution._src.backends.scoring import Outcome
from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve
from evolution._src.search.record import SAMPLE, VALIDATION, Entry
from evolution._src.search.validation import Champion, Validation, pool_trials, select_champion


def make_entry(index: int, kind: int, successes: str, generation: int = 0, fitness: float = 0.0) -> Entry:
    outcome = Outcome(0.0, 0.0, tuple(flag == "1" for flag in successes))
    return Entry(generation, kind, index, np.full(2, float(index)), fitness, outcome)


@pytest.mark.parametrize(
    ("entries", "expected"),
    [
        pytest.param(
            [
                make_entry(0, SAMPLE, "11", fitness=9.0),
                make_entry(2, SAMPLE, "00", fitness=99.0),
                make_entry(0, VALIDATION, "1111000000"),
                make_entry(1, VALIDATION, "1111111111"),
                make_entry(1, VALIDATION, "1111111110"),
            ],
            (1, 0, "1" * 19 + "0"),
            id="the best fresh trials, not the luckiest sample",
        ),
        pytest.param(
            [make_entry(0, SAMPLE, "01", fitness=1.0), make_entry(1, SAMPLE, "00", fitness=3.0)],
            (1, 0, "00"),
            id="without fresh trials the fittest sample",
        ),
        pytest.param(
            [make_entry(0, VALIDATION, "1" * 8), make_entry(1, VALIDATION, "1" * 47 + "0")],
            (1, 0, "1" * 47 + "0"),
            id="many trials count for more than a few lucky ones",
        ),
        pytest.param(
            [make_entry(g, VALIDATION, "1" * 8, generation=g) for g in range(3)],
            (2, 2, "1" * 8),
            id="of equal ones the later",
        ),
    ],
)
def test_the_champion_is(entries, expected):
    found = select_champion(entries)
    flags = "".join("01"[each] for each in found.outcome.succeeded)
    assert (found.index, found.generation, flags) == expected
    assert select_champion([]) is None


def test_candidates_are_the_fittest_that_succeeded_in_all_trials_and_the_mean_where_enough_did():
    def select(fitness, successes, **rules):
        outcomes = [Outcome(0.0, 0.0, each) for each in successes]
        return Validation(**rules).select_candidates(np.array(fitness), outcomes)

    yes, no = (True, True), (True, False)
    assert select([1.0, 9.0, 3.0, 2.0], [yes, no, yes, yes], candidates=2, mean_share=2) == [2, 3]
    assert select([1.0, 3.0, 1.0, 3.0], [yes] * 4, candidates=3, mean_share=2) == [1, 3, 0]
    assert select(np.zeros(4), [yes] * 4, candidates=0, mean_share=1) == [4]
    assert select(np.arange(4.0), [yes, no, no, no], mean_share=0.25) == [4, 0]
    assert select(np.arange(4.0), [yes, no, no, no], mean_share=0.5) == [0]
    assert select(np.arange(3.0), [no] * 3) == []


def test_fresh_trials_of_all_rounds_are_pooled():
    first = make_entry(3, VALIDATION, "")._replace(
        outcome=Outcome(1.0, 0.4, (True, True, True, False), 10.0, 1)
    )
    second = make_entry(3, VALIDATION, "")._replace(outcome=Outcome(4.0, 0.1, (True, True), 5.0, 2))
    other = make_entry(3, VALIDATION, "1", generation=1)
    pooled, alone = pool_trials([first, other, second])
    assert alone is other
    assert pooled.outcome.succeeded == (True, True, True, False, True, True)
    assert (pooled.outcome.progress, pooled.outcome.effort) == pytest.approx((2.0, 0.3))
    assert (pooled.outcome.seconds, pooled.outcome.diverged) == (15.0, 3)


@pytest.mark.parametrize(
    "arguments",
    [
        {"candidates": -1},
        {"rounds": ()},
        {"rounds": (8, 0)},
        {"continue_share": 1.5},
        {"solved_share": -0.1},
        {"mean_share": 0.0},
        {"start": "sky"},
    ],
)
def test_validation_refuses(arguments):
    with pytest.raises(RunError, match=next(iter(arguments))):
        Validation(**arguments)


def test_a_run_is_solved_by_enough_successes_in_all_rounds():
    validation = Validation(rounds=(8, 8), solved_share=0.75)
    for successes, trials, is_solved in ((12, 16, True), (11, 16, False), (15, 15, False), (24, 32, True)):
        assert validation.is_solved(successes, trials) is is_solved


def test_no_candidate_and_no_round_has_conditions_that_were_used_before():
    """Genotypes of a generation share theirs; all others differ."""
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
    run = evolve(EvolutionConfig(generations=1, validation=validation), simulate=toys.Observed(successes))
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
    tried = pool_trials(entry for entry in run.record.entries if entry.kind == VALIDATION)
    assert sorted(entry.outcome.trials for entry in tried) == [Validation().rounds[0], Validation().trials]


@pytest.mark.parametrize(("samples", "fresh"), [("pit", "floor"), ("floor", "pit"), ("floor", "floor")])
def test_fresh_trials_begin_where_validation_says(samples, fresh):
    observed = toys.Observed()
    config = EvolutionConfig(generations=1, start=samples, validation=Validation(start=fresh))
    run = evolve(config, simulate=observed)
    for entry, job in zip(run.record.entries, observed.jobs, strict=True):
        assert job.trials.start == (fresh if entry.kind == VALIDATION else samples)
    assert any(entry.kind == VALIDATION for entry in run.record.entries)


def make_champion(**changes):
    usual = {"genotype": (0.1,), "names": ("a",), "controller": "posture", "modules": 3, "arena": "truth"}
    return Champion(**usual | {"generation": 4, "fitness": 1.5} | changes)


def test_champions_survive_json():
    champion = make_champion(successes=15, trials=16, environment=(("pit", 0.3), ("bottomless", True)))
    content = champion.to_json()
    assert content["environment"] == {"pit": 0.3, "bottomless": True}
    assert Champion.from_json(content) == champion
    again = Champion.from_json(content | {"genotype": [1], "names": ["b"]})
    assert (again.genotype, again.names) == ((1.0,), ("b",))
    with pytest.raises(RunError, match="wings"):
        Champion.from_json(content | {"wings": 2})


@pytest.mark.parametrize(
    "change",
    [
        *({"names": ("a", "b")}, {"genotype": (np.nan,)}, {"genotype": ("x",)}, {"names": 3}),
        *({"successes": 9}, {"modules": 51}),
    ],
)
def test_invalid_champions_are_refused(change):
    with pytest.raises(RunError, match=r"^(genotype|names|successes|modules)"):
        Champion.from_json(make_champion().to_json() | change)
    with pytest.raises(RunError, match="controller"):
        Champion.from_json({"genotype": (0.1,), "names": ("a",)})
