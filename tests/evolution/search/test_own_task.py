"""Tasks in a run: by name, as a value, kept and restored, judged anew in another arena; starts and goals."""

import json
from dataclasses import replace

import own_task
import pytest
import toys
from evolution._src.backends.stored_task import StoredTask

from evolution._src.champions.playback import judge, make_champion_trials
from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve, load_run, resume
from evolution._src.search.run import load_champion

CONFIG = EvolutionConfig(
    arena="truth", modules=4, generations=1, population_size=4, trials=1, stop_when_solved=False
)
TASKS = {"name": {"task": "cross_gap", "duration": 1.0}, "value": {"task": own_task.TASK}}


@pytest.mark.parametrize("task", TASKS)
def test_a_run_with_a_task_is_resumed_and_its_champion_judged(task, tmp_path):
    config = replace(CONFIG, **TASKS[task])
    whole = evolve(replace(config, generations=2))
    evolve(replace(config, folder=str(tmp_path / "run")))
    run = resume(tmp_path / "run", generations=2, allow=("own_task",))
    assert [entry.fitness for entry in run.record.entries] == [e.fitness for e in whole.record.entries]
    champion = load_champion(tmp_path / "run")
    assert make_champion_trials(champion, "simple", allow=("own_task",)).task == config.task
    assert judge(champion, "truth", 2, allow=("own_task",)) == judge(whole.champion, "truth", 2)


def test_a_task_is_not_imported_until_it_is_needed():
    config = replace(CONFIG, task=own_task.TASK)
    stored = EvolutionConfig.from_json(json.loads(json.dumps(config.to_json())))
    assert isinstance(stored.task, StoredTask)
    assert stored.digest() == config.digest() != CONFIG.digest()
    assert stored.restore(("own_task",)) == config


def test_a_task_is_found_by_module_and_name():
    assert EvolutionConfig(task="own_task:TASK") == EvolutionConfig(task=own_task.TASK)
    assert EvolutionConfig(task="own_task:make_task") == EvolutionConfig(task=own_task.TASK)


@pytest.mark.parametrize("simulate", [toys.broken])
def test_an_error_that_every_genotype_meets_ends_the_run(simulate, tmp_path):
    config = replace(CONFIG, folder=str(tmp_path / "run"))
    with pytest.raises(RunError, match="none of 4 genotypes could be tried: AttributeError: no such field"):
        evolve(config, simulate=simulate)
    assert not len(load_run(tmp_path / "run").history)


def test_a_changed_task_is_refused_by_name(tmp_path, monkeypatch):
    config = replace(CONFIG, task=own_task.TASK, folder=str(tmp_path / "run"))
    evolve(config, simulate=toys.bowl)
    monkeypatch.setattr(own_task.is_high, "version", "2", raising=False)
    with pytest.raises(RunError, match="task: own_task:is_high has changed: version '2'"):
        resume(tmp_path / "run", generations=2, simulate=toys.bowl, allow=("own_task",))
    assert len(load_run(tmp_path / "run").history) == 1


@pytest.mark.parametrize(
    "content", ['{"type": "subprocess:Popen", "fields": {"args": ["true"]}}', '{"versions": 7}', "{}"]
)
def test_a_file_makes_nothing_but_tasks(content):
    with pytest.raises(RunError, match="task"):
        StoredTask(content).restore()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"task": "fly"}, "task is 'fly'; a `Task`, 'module:name' of one, or one of snake_pit, cross_gap"),
        ({"task": 7}, "task is 7"),
        ({"task": "own_task:nothing"}, "task is 'own_task:nothing'"),
        ({"task": "no_such_module:task"}, "task no_such_module:task cannot be imported"),
        ({"start": (1.0,)}, r"start is \(1.0,\)"),
        ({"start": "sky"}, "sky"),
        ({"goal": "far"}, "goal is 'far'"),
        ({"goal": (1.0, 0.0), "environment": {"goal": (2.0, 0.0)}}, "environment.goal"),
        ({"environment": {"start": (1.0, 0.0)}}, "environment.start is .* would be overwritten"),
        ({"environment": {"modules": 3}}, "would be overwritten"),
        ({"wings": 2}, "wings"),
    ],
)
def test_wrong_episodes_are_refused(changes, message):
    with pytest.raises(RunError, match=message):
        EvolutionConfig(**changes)


def test_a_start_of_a_run_is_that_of_its_trials_its_validation_and_its_judge():
    seen = []

    def simulate(jobs, threads=1):
        seen.extend(job.trials.start for job in jobs)
        return toys.bowl(jobs, threads)

    config = replace(
        CONFIG, start=(-1.5, 0.1), generations=8, population_size=8, origin="hint", controller="reactive"
    )
    run = evolve(config, simulate=simulate)
    assert set(seen) == {(-1.5, 0.1)}
    assert make_champion_trials(run.champion, "truth").start == (-1.5, 0.1)
    assert make_champion_trials(run.champion, "truth", "pit").start == "pit"
    usual = evolve(replace(config, start="pit"), simulate=toys.bowl)
    assert make_champion_trials(usual.champion, "truth").start == "floor"
