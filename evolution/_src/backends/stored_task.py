"""The task of a run: a value or a name, and as a file describes it until it is needed."""

import json
from collections.abc import Collection
from dataclasses import dataclass
from types import FunctionType
from typing import Any

from evolution._src.errors import RunError
from evolution._src.references import check_versions, find_value, find_versions
from symbrion_gym._src.errors import TaskError


@dataclass(frozen=True)
class StoredTask:
    """What a file says of a task; its terms are not imported yet."""

    text: str  # JSON text of `Task.as_dict`, and of the versions of what a user wrote in it

    def restore(self, allow: Collection[str] = ()) -> Any:
        """Return the task; of the user's code only modules in `allow` are imported."""
        from symbrion_gym._src.tasks.task import read_task  # loads MuJoCo

        content = json.loads(self.text)
        try:
            check_versions(content.pop("versions", {}), "task", allow)
            return read_task(content, allow)
        except (TaskError, AttributeError) as error:
            raise RunError(f"task: {error}") from error


def check_task(task: Any) -> Any:
    """Return a task: None, a `Task`, its name, "module:name" of one or of its maker, or what a file says of it."""
    if task is None or isinstance(task, StoredTask):
        return task
    if isinstance(task, dict):
        return StoredTask(json.dumps(task, sort_keys=True))
    from symbrion_gym._src.tasks.catalog import TASKS
    from symbrion_gym._src.tasks.task import Task

    if isinstance(task, str) and task in TASKS:
        return task
    found = _find_named(task) if isinstance(task, str) and ":" in task else task
    if isinstance(found, Task):
        return found
    raise RunError(
        f"task is {task!r}; a `Task`, 'module:name' of one, or one of {', '.join(TASKS)} is needed"
    )


def _find_named(name: str) -> Any:
    """Return what "module:name" names, or what it returns if it is a function."""
    found = find_value(name, "task")
    if not isinstance(found, FunctionType):
        return found
    try:
        return found()
    except Exception as error:  # code of the user
        raise RunError(f"task {name} cannot be made: {error}") from error


def task_to_json(task: Any) -> Any:
    """Return JSON content that restores a task."""
    if task is None or isinstance(task, str):
        return task
    if isinstance(task, StoredTask):
        return json.loads(task.text)
    try:
        content = task.as_dict()
    except TaskError as error:
        raise RunError(f"task: {error}") from error
    versions = find_versions(content, "task")
    return content | {"versions": versions} if versions else content
