"""The tasks that come with the package, by name."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any, cast

from symbrion_gym._src.errors import OptionError, TaskError
from symbrion_gym._src.tasks.climb import make_climb
from symbrion_gym._src.tasks.cross_gap import make_cross_gap
from symbrion_gym._src.tasks.dock import make_dock
from symbrion_gym._src.tasks.explore import make_explore
from symbrion_gym._src.tasks.reach_task import make_reach
from symbrion_gym._src.tasks.recover import make_recover
from symbrion_gym._src.tasks.snake_pit import make_snake_pit
from symbrion_gym._src.tasks.starts import Start
from symbrion_gym._src.tasks.task import Task
from symbrion_gym._src.tasks.traverse import make_traverse
from symbrion_gym._src.tasks.usual_terms import UsualTerms

TASKS: dict[str, Callable[..., Task]] = {
    "snake_pit": make_snake_pit,
    "cross_gap": make_cross_gap,
    "climb": make_climb,
    "reach": make_reach,
    "dock": make_dock,
    "traverse": make_traverse,
    "explore": make_explore,
    "recover": make_recover,
}
"""Name -> function that makes the task of its parameters."""


def find_parameters(name: str) -> tuple[str, ...]:
    """Return the names of the parameters of a task."""
    if name not in TASKS:
        raise TaskError(f"no task {name!r}; there are: {', '.join(TASKS)}")
    parameters = inspect.signature(TASKS[name]).parameters.values()
    own = tuple(each.name for each in parameters if each.kind is not inspect.Parameter.VAR_KEYWORD)
    return own if len(own) == len(parameters) else (*own, *(each.name for each in fields(UsualTerms)))


def make_task(name: str, **parameters: Any) -> Task:
    """Make a task of its name and parameters.

    Raises:
        TaskError: there is no such task, or a parameter is out of range.
        OptionError: it has no such parameter.
    """
    known = find_parameters(name)
    for each in parameters:
        if each not in known:
            raise OptionError(f"task {name!r} has no parameter {each!r}; there are: {', '.join(known)}")
    return TASKS[name](**parameters)


def choose_task(task: Task | str, parameters: Mapping[str, Any]) -> Task:
    """Return a task with parameters that were given beside it."""
    if isinstance(task, str):
        return make_task(task, **parameters)
    if not isinstance(task, Task):
        raise TaskError(f"task must be a Task or one of {', '.join(TASKS)}, got {task!r}")
    changes = dict(parameters)
    start = changes.pop("start", "floor")
    if not isinstance(start, str):
        changes["start"] = Start(cast(Any, start), task.start.roll)
    elif start == "pit":
        changes["start"] = Start("pit", roll=task.start.roll)
    for name in changes:
        if name not in ("start", "duration"):
            raise OptionError(
                f"task {task.name!r} is a ready Task, so {name!r} cannot be given beside it; make it with the task"
            )
    return task.replace(**changes)
