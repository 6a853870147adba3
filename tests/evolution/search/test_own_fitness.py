"""A fitness of a user's own: used, kept and restored, or refused by name before anything is written."""

import json
from dataclasses import replace

import fitnesses
import numpy as np
import pytest
import toys
from histories import TOY, without_times

from evolution._src.backends.scoring import Scoring
from evolution._src.backends.settings import Randomization
from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.evaluation import evaluate
from evolution._src.search.loop import evolve, load_run, resume

SHORT = replace(TOY, generations=3)
OWN = {
    "function": {"scoring": fitnesses.minus_effort},
    "name": {"scoring": "fitnesses:progress_alone"},
    "subclass": {"scoring": fitnesses.Squared(factor=3.0)},
}


@pytest.mark.parametrize("own", OWN)
def test_a_run_with_an_own_part_is_resumed_as_if_it_had_never_stopped(own, tmp_path):
    config = replace(SHORT, **OWN[own])
    whole = evolve(config, simulate=toys.bowl)
    evolve(replace(config, generations=1, folder=str(tmp_path / "run")), simulate=toys.bowl)
    parts = resume(tmp_path / "run", generations=3, simulate=toys.bowl, allow=("fitnesses",))
    assert without_times(parts.history) == without_times(whole.history)
    assert without_times(load_run(tmp_path / "run").history) == without_times(whole.history)
    assert without_times(whole.history) != without_times(evolve(SHORT, simulate=toys.bowl).history)


def test_the_fitness_is_that_of_the_function():
    run = evolve(replace(SHORT, scoring=fitnesses.minus_effort), simulate=toys.bowl)
    assert all(entry.fitness == 8 - entry.outcome.effort for entry in run.record.entries)


@pytest.mark.parametrize("own", OWN)
def test_own_parts_decide_the_digest_and_survive_json(own):
    config = replace(SHORT, **OWN[own])
    assert config.digest() != SHORT.digest()
    again = EvolutionConfig.from_json(json.loads(json.dumps(config.to_json())))
    assert again.digest() == config.digest()
    assert again.restore(("fitnesses",)) == config
    assert hash(again)


@pytest.mark.parametrize(
    "changes",
    [
        {"scoring": lambda outcome, body: 0.0},
        {"scoring": fitnesses.Remembering(3.0)},
        {"randomization": type("Local", (Randomization,), {})()},
        {"environment": {"sensor_noise": Randomization()}},
    ],
)
def test_what_no_file_can_keep_is_refused_before_anything_is_written(changes, tmp_path):
    config = replace(SHORT, **changes, folder=str(tmp_path / "run"))
    with pytest.raises(RunError, match=next(iter(changes))):
        evolve(config, simulate=toys.bowl)
    assert not (tmp_path / "run").exists()
    assert len(evolve(replace(config, folder=None), simulate=toys.bowl).history) == 3


def test_a_changed_function_is_refused_by_name_and_nothing_is_written(tmp_path, monkeypatch):
    folder = tmp_path / "run"
    evolve(replace(SHORT, scoring=fitnesses.minus_effort, folder=str(folder)), simulate=toys.bowl)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    monkeypatch.setattr(fitnesses.minus_effort, "version", "2")
    with pytest.raises(RunError, match="scoring fitnesses:minus_effort has changed: version '2', not '1'"):
        resume(folder, generations=5, simulate=toys.bowl, allow=("fitnesses",))
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    assert len(load_run(folder).history) == 3


def test_reading_a_run_imports_nothing(tmp_path):
    folder = tmp_path / "run"
    evolve(replace(SHORT, scoring=fitnesses.minus_effort, folder=str(folder)), simulate=toys.bowl)
    path = folder / "config.json"
    content = json.loads(path.read_text())
    content["config"]["scoring"]["name"] = "absent_module:f"
    path.write_text(json.dumps(content))
    with pytest.raises(RunError, match="belongs to another configuration"):
        load_run(folder)
    config = EvolutionConfig.from_json(content["config"])
    with pytest.raises(RunError, match="absent_module:f cannot be imported"):
        config.restore(("absent_module",))


@pytest.mark.parametrize(
    ("scoring", "message"),
    [
        (fitnesses.one_argument, r"a function of \(outcome, body\)"),
        (7, "a function of"),
        ("fitnesses:absent", "no function"),
        (fitnesses.Remembering, "without arguments"),
    ],
)
def test_scorings_that_cannot_be_are_refused(scoring, message):
    with pytest.raises(RunError, match=message):
        EvolutionConfig(scoring=scoring)


def fails(outcome, body):
    raise KeyError("nothing")


@pytest.mark.parametrize(
    ("scoring", "message"),
    [(fitnesses.not_a_number, "returned nan; a finite number"), (fails, "raised KeyError: 'nothing'")],
)
def test_a_scoring_that_fails_ends_the_run(scoring, message):
    with pytest.raises(RunError, match=message):
        evolve(replace(SHORT, scoring=scoring), simulate=toys.bowl)


def test_evaluate_takes_any_scoring():
    genotypes = np.zeros((2, 8))
    fitness, outcomes = evaluate(genotypes, scoring=lambda outcome, body: 7.0, simulate=toys.bowl)
    assert fitness.tolist() == [7.0, 7.0]
    plain = evaluate(genotypes, simulate=toys.bowl)
    assert plain.fitness.tolist() == [Scoring(module=0.0).score(outcome, 8) for outcome in outcomes]
