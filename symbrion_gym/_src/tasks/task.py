"""What a task is: where a body starts, what arriving means, what ends an episode and what is rewarded."""

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.robot.organism import Organism
from symbrion_gym._src.tasks.goals import PassFinish
from symbrion_gym._src.tasks.route import Route, Start
from symbrion_gym._src.tasks.storage import describe, restore
from symbrion_gym._src.tasks.terms import Goal, Reward, Termination, make_rewards, make_terminations


@dataclass(frozen=True)
class Task:
    """A task as a value: compared, hashed and stored by what it says, whatever arena and body it is given to.

    Attributes:
        name: what it is called.
        start: where and how a body starts.
        goal: what arriving means; held for 0.3 s, it is the success.
        terminations: what else ends an episode.
        rewards: terms of the reward, in the order in which they are added.
        duration: an episode is truncated after this [s].

    Raises:
        TaskError: two terms have one name, the goal is no goal, or the duration is not above 0.
    """

    name: str
    start: Start = field(default_factory=Start)
    goal: Goal = field(default_factory=PassFinish)
    terminations: tuple[Termination, ...] = field(default_factory=make_terminations)
    rewards: tuple[Reward, ...] = field(default_factory=make_rewards)
    duration: float = 90.0

    def __post_init__(self) -> None:
        for what, kind in (("terminations", Termination), ("rewards", Reward)):
            terms = tuple(getattr(self, what))
            object.__setattr__(self, what, terms)
            for term in terms:
                if not isinstance(term, kind):
                    raise TaskError(f"task {self.name!r}: {what} must be {kind.__name__}s, got {term!r}")
            names = [term.name for term in terms]
            if len(set(names)) < len(names):
                raise TaskError(f"task {self.name!r}: two {what} have one name in {names}")
        if not isinstance(self.goal, Goal):
            raise TaskError(
                f"task {self.name!r}: a goal has find, progress and has_arrived, got {self.goal!r}"
            )
        if not isinstance(self.start, Start):
            raise TaskError(f"task {self.name!r}: start must be a Start, got {self.start!r}")
        if not 0.0 < self.duration < np.inf:
            raise TaskError(f"task {self.name!r}: duration must be above 0 s, got {self.duration!r}")

    def replace(self, **changes: Any) -> "Task":
        """Return the task with other fields."""
        return replace(self, **changes)

    def as_dict(self) -> dict[str, Any]:
        """Return JSON content that `read_task` turns back into an equal task.

        Raises:
            TaskError: a term cannot be restored, as a lambda or a function inside another.
        """
        return describe(self)

    def find_route(self, arena: Arena, organism: Organism) -> Route:
        """Return the way from start to goal in an arena.

        Raises:
            ArenaError: the arena does not have what the task needs.
        """
        return self.goal.find(arena, organism, self.start)


def read_task(content: Any, allow: Collection[str] = ()) -> Task:
    """Return the task of what `Task.as_dict` returned.

    Args:
        content: what it returned.
        allow: modules of the user that may be imported for it.

    Raises:
        TaskError: it is none, or a term of it cannot be found.
    """
    task = restore(content, allow)
    if not isinstance(task, Task):
        raise TaskError(f"this describes no task but a {type(task).__name__}")
    return task
