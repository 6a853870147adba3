"""The search: where it begins, when and where it restarts, and how bodies become shorter."""

from dataclasses import replace

import numpy as np
import pytest
import toys
from histories import TOY, find_samples, without_times

from evolution._src.controllers.controller import REACTIVE_HINT
from evolution._src.errors import RunError
from evolution._src.search.cmaes import Stage
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve, resume
from evolution._src.search.record import SAMPLE, VALIDATION


def test_a_search_may_begin_from_zero():
    config = replace(TOY, generations=1, sigma=1e-6)
    hint, zero = (evolve(replace(config, origin=origin), simulate=toys.bowl) for origin in ("hint", "zero"))
    assert np.allclose(zero.record.columns()["genotype"], 0.0, atol=1e-4)
    assert np.allclose(hint.record.columns()["genotype"], REACTIVE_HINT, atol=1e-4)


@pytest.mark.parametrize("where", ["alone", "stages"])
def test_the_genotype_at_which_a_search_begins_is_tried_if_asked(where):
    changes = {"stages": (Stage("truth"),)} if where == "stages" else {}
    plain = replace(TOY, generations=2, origin="zero", **changes)
    tried = replace(plain, is_start_tried=True)
    runs = [evolve(config, simulate=toys.bowl) for config in (plain, tried)]
    first = [np.array([entry.genotype for entry in find_samples(run, range(1))]) for run in runs]
    assert np.abs(first[0]).max(axis=1).min() > 0.01
    assert np.flatnonzero(np.abs(first[1]).max(axis=1) < 1e-12).tolist() == [0]
    second = np.array([entry.genotype for entry in find_samples(runs[1], range(1, 2))])
    assert np.abs(second).max(axis=1).min() > 1e-3  # once, not in each generation


def test_a_run_that_tries_its_start_resumes_to_the_bit(tmp_path):
    config = replace(TOY, generations=6, origin="zero", is_start_tried=True)
    whole = evolve(config, simulate=toys.bowl)
    evolve(replace(config, generations=2, folder=str(tmp_path)), simulate=toys.bowl)
    again = resume(tmp_path, generations=6, simulate=toys.bowl)
    np.testing.assert_array_equal(again.record.columns()["genotype"], whole.record.columns()["genotype"])
    assert config.digest() != replace(config, is_start_tried=False).digest()


def test_a_search_begins_at_the_genes_of_a_champion():
    genes = tuple(0.1 * value for value in REACTIVE_HINT)
    config = replace(TOY, generations=1, sigma=1e-6, initial_genotype=genes)
    assert np.allclose(evolve(config, simulate=toys.bowl).record.columns()["genotype"], genes, atol=1e-4)
    assert EvolutionConfig.from_json(config.to_json()) == config
    assert config.digest() != replace(config, initial_genotype=()).digest()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"initial_genotype": (0.0, 0.0)}, "initial_genotype has 2 genes; reactive has 8 for this body: "),
        ({"initial_genotype": (99.0,) * 8}, "initial_genotype: .* is 99; .* is needed"),
        ({"initial_genotype": (float("nan"),) * 8}, "initial_genotype must be a number .* got nan"),
        ({"initial_genotype": (0.0,) * 8, "body_lengths": (4, 5)}, "the genes of one body"),
    ],
)
def test_genes_of_something_else_are_refused(changes, message):
    with pytest.raises(RunError, match=message):
        replace(TOY, **changes)


def test_a_search_without_success_restarts_where_it_began():
    run = evolve(replace(TOY, generations=11, restart_after=5), simulate=toys.hopeless)
    assert run.history["restarts"].tolist() == 5 * [0] + 5 * [1] + [2]
    assert set(run.history["population_size"]) == {TOY.population_size}
    first, again = (
        np.array([entry.genotype for entry in find_samples(run, range(start, start + 1))]) for start in (0, 5)
    )
    assert np.abs(again.mean(axis=0) - REACTIVE_HINT).max() < 4 * TOY.sigma / np.sqrt(len(again))
    assert run.history["sigma"][5] == pytest.approx(TOY.sigma, rel=0.3)
    assert not np.allclose(first, again)


@pytest.mark.parametrize("what", ["stages", "bodies"])
def test_a_search_with_stages_or_bodies_restarts_around_its_fittest(what):
    changes = {"stages": (Stage("truth"),)} if what == "stages" else {"body_lengths": (4, 5)}
    run = evolve(replace(TOY, generations=6, restart_after=5, **changes), simulate=toys.hopeless)
    fittest = max(find_samples(run, range(5)), key=lambda entry: entry.fitness)
    drawn = np.array([entry.genotype for entry in find_samples(run, range(5, 6))])
    mean, genes = drawn.mean(axis=0)[: len(REACTIVE_HINT)], fittest.genotype[: len(REACTIVE_HINT)]
    assert np.abs(mean - genes).max() < 4 * TOY.stage_sigma / np.sqrt(len(drawn))
    assert run.history["sigma"][5] == pytest.approx(TOY.stage_sigma, rel=0.3)


def test_a_search_with_rising_successes_does_not_restart():
    plain = evolve(TOY, simulate=toys.bowl)
    successes = np.zeros(TOY.generations, dtype=int)
    for entry in find_samples(plain, range(TOY.generations)):
        successes[entry.generation] += entry.outcome.successes
    records = [
        -1,
        *(g for g in range(TOY.generations) if successes[g] > successes[:g].max(initial=0)),
        TOY.generations,
    ]
    longest = max(np.diff(records)) - 1  # generations in a row without a record
    patient = evolve(replace(TOY, restart_after=longest + 1), simulate=toys.bowl)
    assert without_times(patient.history) == without_times(plain.history)
    impatient = evolve(replace(TOY, restart_after=longest // 2), simulate=toys.bowl)
    assert impatient.history["restarts"][-1] >= 1


def test_the_shortest_successful_body_is_found():
    for seed in range(3):
        config = replace(TOY, body_lengths=(4, 10), generations=40, seed=seed)
        run = evolve(config, simulate=toys.shortest)
        assert run.champion is not None
        assert run.champion.modules == 6
        assert run.champion.successes > 0.85 * run.champion.trials


def test_bodies_are_shorter_than_any_that_succeeded_reliably():
    run = evolve(replace(TOY, body_lengths=(4, 10), generations=40), simulate=toys.shortest)
    longest = 10
    for entries, row in run.record.generations():
        samples = [entry for entry in entries if entry.kind == SAMPLE]
        assert max(entry.modules for entry in samples) <= longest
        if row["champion_trials"] == run.config.validation.trials and row["champion_successes"] >= 46:
            longest = min([longest, *(entry.modules - 1 for entry in entries if entry.kind == VALIDATION)])
    assert longest == 5


def test_a_search_among_shorter_bodies_restarts_around_one_of_them():
    config = replace(TOY, body_lengths=(4, 10), generations=40, restart_after=10)
    run = evolve(config, simulate=toys.shortest)
    too_long = [entry.generation for entry in find_samples(run, range(40)) if entry.modules > 5]
    began = max(too_long) + 1
    restarts = run.history["restarts"]
    restart = began + int(np.flatnonzero(restarts[began:] > restarts[began])[0])
    assert restart == began + 10
    fittest = max(find_samples(run, range(began, restart)), key=lambda entry: entry.fitness)
    genes = np.array([entry.genotype[:-1] for entry in find_samples(run, range(restart, restart + 1))])
    assert np.abs(genes.mean(axis=0) - fittest.genotype[:-1]).max() < 4 * TOY.stage_sigma / np.sqrt(
        len(genes)
    )
    assert run.champion is not None
    assert run.champion.modules == 6
