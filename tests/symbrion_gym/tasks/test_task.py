"""Tasks are values: compared, hashed, pickled, stored and restored; wrong ones are refused."""

import functools
import json
import pickle

import numpy as np
import own_terms
import pytest

from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.errors import OptionError, TaskError
from symbrion_gym._src.tasks.catalog import TASKS, make_task
from symbrion_gym._src.tasks.route import Start
from symbrion_gym._src.tasks.storage import describe
from symbrion_gym._src.tasks.task import Task, read_task
from symbrion_gym._src.tasks.terms import Reward, RolledOver, Termination


@pytest.mark.parametrize("name", TASKS)
def test_a_task_is_a_value(name):
    task, same, other = make_task(name), make_task(name), make_task(name, duration=7.0)
    assert task == same != other
    assert len({task, same, other}) == 2
    assert pickle.loads(pickle.dumps(task)) == task
    content = json.loads(json.dumps(other.as_dict()))
    assert read_task(content) == other
    assert task.replace(duration=7.0) == other


def test_terms_of_ones_own_are_restored_by_module_and_name():
    low = functools.partial(own_terms.is_low, below=0.02)
    task = Task(
        "mine",
        terminations=(Termination("low", low),),
        rewards=(Reward("tick", own_terms.count, 0.5, per_second=True),),
    )
    again = read_task(json.loads(json.dumps(task.as_dict())), allow=("own_terms",))
    assert again.rewards == task.rewards
    function = again.terminations[0].function
    assert (function.func, function.keywords) == (own_terms.is_low, {"below": 0.02})
    env = OrganismEnv(task=again, modules=2)
    env.reset(seed=0)
    *_, info = env.step(np.zeros(1))
    assert info["reward_tick"] == pytest.approx(0.01)
    assert info["low"] is False


def test_what_cannot_be_restored_is_refused():
    def inside(state):
        return state.lowest < 0.0

    for function in (lambda state: state.lowest < 0.0, inside, functools.partial(own_terms.is_low, 0.02)):
        with pytest.raises(TaskError, match=r"cannot be restored|by name"):
            Task("mine", terminations=(Termination("low", function),)).as_dict()
    with pytest.raises(TaskError, match="there is no"):
        read_task({"function": "symbrion_gym._src.tasks.task:no_such_term"})
    with pytest.raises(TaskError, match="does not take"):
        read_task({"type": "symbrion_gym._src.tasks.route:Start", "fields": {"hight": 1}})
    with pytest.raises(TaskError, match="no task but a Start"):
        read_task(describe(Start()))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Termination("success", RolledOver()), "every task has a flag 'success'"),
        (lambda: Termination("rolled over", RolledOver()), "identifier"),
        (lambda: Termination("low", 3), "cannot be called"),
        (lambda: Reward("tick", own_terms.count, np.inf), "finite"),
        (lambda: Task("t", goal=3), "a goal has find, progress and has_arrived"),
        (lambda: Task("t", start=(0, 0)), "must be a Start"),
        (lambda: Task("t", duration=0.0), "above 0 s"),
        (lambda: Task("t", rewards=(Reward("a", own_terms.count),) * 2), "one name"),
        (lambda: Task("t", rewards=(Termination("a", RolledOver()),)), "must be Rewards"),
        (lambda: Start("roof"), "floor or pit"),
        (lambda: Start((0.0, np.nan)), "a place"),
        (lambda: make_task("fly"), "there are: snake_pit, cross_gap"),
        (lambda: make_task("climb", obstacle="tree"), "obstacle"),
        (lambda: make_task("traverse", share=0.0), "share"),
        (lambda: make_task("traverse", share=1.1), "share"),
        (lambda: make_task("reach", tolerance=0.0), "tolerance"),
    ],
)
def test_wrong_tasks_are_refused(make, message):
    with pytest.raises(TaskError, match=message):
        make()


def test_options_of_a_task_go_to_the_task():
    env = OrganismEnv(task="climb", arena="stairs", modules=2, obstacle="step", duration=5.0, stuck_time=2.0)
    assert env.world.task == make_task("climb", obstacle="step", duration=5.0, stuck_time=2.0)
    with pytest.raises(OptionError, match="task 'climb': there is no 'bottomless'"):
        OrganismEnv(task="climb", arena="stairs", bottomless=True)
    with pytest.raises(OptionError, match="option"):
        OrganismEnv(task="climb", arena="stairs", share=0.5)


def test_beside_a_ready_task_only_start_and_duration_are_given():
    task = make_task("traverse")
    env = OrganismEnv(task=task, modules=1, start=(-2.5, 0.2), duration=3.0)
    assert env.world.task == task.replace(start=Start((-2.5, 0.2)), duration=3.0)
    with pytest.raises(OptionError, match="ready Task, so 'stuck_time'"):
        OrganismEnv(task=task, stuck_time=3.0)
