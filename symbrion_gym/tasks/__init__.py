"""What an organism has to do: tasks and their terms, routes, and the audit of a success."""

from typing import TYPE_CHECKING

from reconstruction.lazy import export_lazily

if TYPE_CHECKING:
    from symbrion_gym.tasks.catalog import TASKS, make_task
    from symbrion_gym.tasks.goals import PassFinish
    from symbrion_gym.tasks.rewards import make_rewards
    from symbrion_gym.tasks.starts import Start
    from symbrion_gym.tasks.state import TaskState
    from symbrion_gym.tasks.task import Task, read_task
    from symbrion_gym.tasks.terminations import make_terminations
    from symbrion_gym.tasks.terms import Goal, Reward, Termination

__all__ = [
    "TASKS",
    "Goal",
    "PassFinish",
    "Reward",
    "Start",
    "Task",
    "TaskState",
    "Termination",
    "make_rewards",
    "make_task",
    "make_terminations",
    "read_task",
]

__getattr__, __dir__ = export_lazily(__name__)
