"""Configurations: they survive JSON with what a user wrote, keep their digest, and refuse what cannot be.

What a user wrote is used, kept by name and version, restored as it was, or refused by name before anything is written.
"""

import json
from dataclasses import replace

import fitnesses
import numpy as np
import own_task
import pytest
import toys
from histories import TOY, without_times

from evolution._src.backends.scoring import RECORDERS, Scoring, check_descriptors
from evolution._src.backends.settings import Randomization, RolloutConfig
from evolution._src.champions.playback import judge, make_champion_trials
from evolution._src.errors import RunError
from evolution._src.references import Stored, find_object, store
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.evaluation import evaluate
from evolution._src.search.loop import evolve, load_run, resume
from evolution._src.search.run import load_champion

SHORT = replace(TOY, generations=3)
REAL = EvolutionConfig(
    arena="truth", modules=3, generations=1, population_size=4, trials=2, stop_when_solved=False, duration=1.0
)
ALLOW = ("fitnesses", "own_task", __name__)


def find_head(state):
    """The position of the head."""
    return state.position[:, 0]


OWN = {
    "function": {"scoring": fitnesses.minus_effort},
    "name": {"scoring": "fitnesses:progress_alone"},
    "instance": {"scoring": fitnesses.Squared(factor=3.0)},
    "task": {"task": own_task.TASK},
    "descriptors": {"descriptors": (RECORDERS["pose"], find_head)},
}


def reload(config):
    return EvolutionConfig.from_json(json.loads(json.dumps(config.to_json())))


@pytest.mark.parametrize("own", OWN)
def test_own_parts_decide_the_digest_and_are_stored_until_they_are_restored(own):
    (name,) = OWN[own]
    config = replace(SHORT, **OWN[own])
    again = reload(config)
    assert isinstance(getattr(again, name), Stored)
    assert again.digest() == config.digest() != SHORT.digest()
    assert again.restore(ALLOW) == config
    assert hash(again)
    with pytest.raises(RunError, match="--allow-code"):
        again.restore()


@pytest.mark.parametrize("own", ["function", "name", "instance"])
def test_a_run_with_an_own_scoring_is_resumed_as_if_it_had_never_stopped(own, tmp_path):
    config = replace(SHORT, **OWN[own])
    whole = evolve(config, simulate=toys.bowl)
    evolve(replace(config, generations=1, folder=str(tmp_path)), simulate=toys.bowl)
    parts = resume(tmp_path, generations=3, simulate=toys.bowl, allow=ALLOW)
    assert (
        without_times(parts.history)
        == without_times(load_run(tmp_path).history)
        == without_times(whole.history)
    )
    assert without_times(whole.history) != without_times(evolve(SHORT, simulate=toys.bowl).history)
    if own == "function":
        assert all(entry.fitness == 8 - entry.outcome.effort for entry in whole.record.entries)


@pytest.mark.slow
@pytest.mark.parametrize("task", [{"task": "cross_gap"}, {"task": own_task.TASK, "environment": ()}])
def test_a_run_with_a_task_is_resumed_and_its_champion_judged_elsewhere(task, tmp_path):
    config = replace(REAL, trials=1, **task)
    whole = evolve(replace(config, generations=2))
    evolve(replace(config, folder=str(tmp_path)))
    run = resume(tmp_path, generations=2, allow=ALLOW)
    assert [entry.fitness for entry in run.record.entries] == [each.fitness for each in whole.record.entries]
    champion = load_champion(tmp_path)
    assert make_champion_trials(champion, "simple", allow=ALLOW).task == config.task
    assert judge(champion, "truth", 2, allow=ALLOW) == judge(whole.champion, "truth", 2)


@pytest.mark.slow
def test_outcomes_keep_what_is_asked_of_every_trial_and_so_does_a_record(tmp_path):
    names = ("pose", "extremes", "contacts", "trajectory", find_head)
    options = {"modules": 3, "duration": 1.0, "trials": 2}
    (outcome,) = evaluate(np.zeros(8), descriptors=names, **options).outcomes
    for kept in outcome.descriptors:
        assert kept["final_position"].shape == (3, 3)
        assert kept["final_rotation"].shape == (3, 3, 3)
        assert kept["trajectory"].shape[1:] == (3, 3)
        assert np.array_equal(kept["find_head"], kept["final_position"][0])
        assert np.all(kept["lowest"] <= kept["final_position"].min(axis=0))
        assert 0 <= kept["ground_share"].min() <= 1
    (plain,) = evaluate(np.zeros(8), **options).outcomes
    assert (plain, plain.descriptors) == (outcome, ())
    run = evolve(replace(REAL, descriptors=("pose", find_head), folder=str(tmp_path)))
    again = resume(tmp_path, generations=2, allow=ALLOW)
    assert [len(entry.outcome.descriptors) for entry in again.record.entries] == [2] * 8
    for read in (again, load_run(tmp_path)):
        for one, other in zip(run.record.entries, read.record.entries, strict=False):
            np.testing.assert_equal(one.outcome.descriptors, other.outcome.descriptors)


@pytest.mark.parametrize(
    "changes",
    [
        {"scoring": lambda outcome, body: 0.0},
        {"scoring": fitnesses.Remembering(3.0)},
        {"randomization": type("Local", (Randomization,), {})()},
        {"environment": {"sensor_noise": Randomization()}},
        {"descriptors": (lambda state: state.progress,)},
    ],
)
def test_what_no_file_can_keep_is_refused_before_anything_is_written(changes, tmp_path):
    config = replace(SHORT, **changes, folder=str(tmp_path / "run"))
    with pytest.raises(RunError, match=next(iter(changes))):
        evolve(config, simulate=toys.bowl)
    assert not (tmp_path / "run").exists()
    assert len(evolve(replace(config, folder=None), simulate=toys.bowl).history) == 3


@pytest.mark.parametrize(
    ("own", "changed", "message"),
    [
        (
            "function",
            fitnesses.minus_effort,
            "scoring fitnesses:minus_effort has changed: version '2', not '1'",
        ),
        ("task", own_task.is_high, "task own_task:is_high has changed: version '2'"),
    ],
)
def test_a_changed_function_is_refused_by_name_and_nothing_is_written(
    own, changed, message, tmp_path, monkeypatch
):
    evolve(replace(SHORT, **OWN[own], folder=str(tmp_path)), simulate=toys.bowl)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    monkeypatch.setattr(changed, "version", "2", raising=False)
    with pytest.raises(RunError, match=message):
        resume(tmp_path, generations=5, simulate=toys.bowl, allow=ALLOW)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    assert len(load_run(tmp_path).history) == 3


def test_a_version_is_the_own_one_or_a_digest_of_the_module():
    assert store(fitnesses.minus_effort, "scoring")["versions"] == {"fitnesses:minus_effort": "1"}
    assert len(store(fitnesses.progress_alone, "scoring")["versions"]["fitnesses:progress_alone"]) == 16
    assert store(RECORDERS["pose"], "descriptors")["versions"] == {}


@pytest.mark.parametrize(
    "content",
    [
        {},
        {"value": {"type": "subprocess:Popen", "fields": {"args": ["true"]}}},
        {"value": {"function": "fitnesses:minus_effort"}, "versions": 7},
        {"value": {"type": "fitnesses:Squared", "fields": 7}},
        {"value": {"type": "fitnesses:Squared", "fields": {"wings": 2}}},
        {"value": {"function": "absent_module:f"}},
    ],
)
def test_damaged_parts_of_a_file_are_refused(content):
    with pytest.raises(RunError, match="scoring"):
        Stored(json.dumps(content)).restore("scoring", (*ALLOW, "absent_module"))


@pytest.mark.parametrize("name", ["fitnesses", "absent_module:f", "fitnesses:absent", "os:system"])
def test_names_of_nothing_are_refused(name):
    with pytest.raises(
        RunError, match=r'"module:name" is needed|cannot be imported|there is no|no function or class'
    ):
        find_object(name, "scoring")


def fails(outcome, body):
    raise KeyError("nothing")


@pytest.mark.parametrize(
    ("scoring", "message"),
    [(fitnesses.not_a_number, "returned nan; a finite number"), (fails, "raised KeyError: 'nothing'")],
)
def test_a_scoring_that_fails_ends_the_run(scoring, message):
    with pytest.raises(RunError, match=message):
        evolve(replace(SHORT, scoring=scoring), simulate=toys.bowl)


def test_an_error_that_every_genotype_meets_ends_the_run(tmp_path):
    with pytest.raises(RunError, match="none of 12 genotypes could be tried: AttributeError: no such field"):
        evolve(replace(SHORT, folder=str(tmp_path)), simulate=toys.broken)
    assert not len(load_run(tmp_path).history)


def test_configs_survive_json_and_workers_change_no_digest():
    config = replace(
        SHORT, environment={"pit": 0.35, "bottomless": True}, rollout=RolloutConfig(stuck_time=3.0)
    )
    assert reload(config) == config
    assert replace(config, workers=7).digest() == config.digest() != replace(config, seed=7).digest()
    assert EvolutionConfig.from_json({"arena": "simple"}) == EvolutionConfig(arena="simple")
    assert EvolutionConfig(task="own_task:TASK") == EvolutionConfig(task="own_task:make_task")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"population_size": 2}, "population_size"),
        (
            {"popsize": 4},
            "EvolutionConfig: there is no 'popsize'; there are: population_size, modules, .*pit",
        ),
        ({"environment": {"pitt": 0.4}}, "no 'pitt'; there are: pit, "),
        ({"workers": 0}, "workers"),
        ({"modules": 1}, "a body of 1 module has no hinge"),
        ({"sigma": 0.0}, "sigma"),
        ({"backend": "cloud"}, "cloud"),
        ({"start": "sky"}, "sky"),
        ({"restart_after": 0}, "restart_after"),
        ({"arena": object()}, "arena is object"),
        ({"seed": -1}, "seed"),
        ({"generations": 1.5}, "generations"),
        ({"scoring": fitnesses.one_argument}, r"a function of \(outcome, body\)"),
        ({"scoring": 7}, "a function of"),
        ({"scoring": "fitnesses:absent"}, "there is no 'absent' in it; there are: .*Squared"),
        ({"scoring": fitnesses.Remembering}, "without arguments"),
        ({"task": "fly"}, "task is 'fly'; a `Task`, 'module:name' of one, or one of snake_pit, cross_gap"),
        ({"task": "own_task:nothing"}, "task 'own_task:nothing': there is no"),
        ({"task": "no_such_module:task"}, "task 'no_such_module:task': module .* cannot be imported"),
        ({"start": (1.0,)}, r"start is \(1.0,\)"),
        ({"goal": "far"}, "goal is 'far'"),
        ({"goal": (1.0, 0.0), "environment": {"goal": (2.0, 0.0)}}, "environment.goal"),
        ({"environment": {"start": (1.0, 0.0)}}, "environment.start is .* would be overwritten"),
        ({"modules": 51}, "modules"),
        ({"modules": True}, "modules"),
        ({"seed": 2**32}, "seed"),
        ({"trials": 10**6}, "trials"),
        ({"workers": 10**6}, "workers"),
        ({"sigma": float("inf")}, "sigma"),
        ({"controller": "magic"}, "controller"),
        ({"environment": {"pit": float("nan")}}, "environment"),
        ({"environment": {"randomize": {"friction": 1}}}, "environment"),
    ],
)
def test_what_cannot_be_is_refused(changes, message):
    with pytest.raises(RunError, match=message):
        EvolutionConfig(**changes)


@pytest.mark.parametrize("descriptors", ["shape", (7,), ("pose", None)])
def test_what_is_no_descriptor_is_refused(descriptors):
    with pytest.raises(RunError, match="descriptors has"):
        check_descriptors(descriptors)


def test_parameters_and_start_of_a_run_reach_its_trials_its_champion_and_its_judge():
    seen = set()

    def simulate(jobs, threads=1):
        seen.update((job.trials.start, job.trials.rollout.stuck_time) for job in jobs)
        return toys.bowl(jobs, threads)

    config = replace(TOY, start=(-1.5, 0.1), generations=8, rollout=RolloutConfig(stuck_time=3.0))
    run = evolve(config, simulate=simulate)
    assert seen == {((-1.5, 0.1), 3.0)}
    assert make_champion_trials(run.champion, "truth").start == (-1.5, 0.1)
    assert make_champion_trials(run.champion, "truth", "pit").start == "pit"
    usual = evolve(replace(config, start="pit"), simulate=toys.bowl)
    assert make_champion_trials(usual.champion, "truth").start == "floor"


def test_evaluate_takes_any_scoring():
    genotypes = np.zeros((2, 8))
    fitness, outcomes = evaluate(genotypes, scoring=lambda outcome, body: 7.0, simulate=toys.bowl)
    assert fitness.tolist() == [7.0, 7.0]
    plain = evaluate(genotypes, simulate=toys.bowl)
    assert plain.fitness.tolist() == [Scoring(module=0.0).score(outcome, 8) for outcome in outcomes]
