"""What an organism has to do: tasks and their terms, routes, and the audit of a success."""

from typing import TYPE_CHECKING

from reconstruction._src.base.lazy import export_lazily

if TYPE_CHECKING:
    from symbrion_gym._src.tasks.catalog import TASKS, make_task
    from symbrion_gym._src.tasks.features.gap import find_gap, find_ramp
    from symbrion_gym._src.tasks.features.stairs import find_stairs, find_step
    from symbrion_gym._src.tasks.goals import PassFinish
    from symbrion_gym._src.tasks.reach import ReachPlaces
    from symbrion_gym._src.tasks.recorders import (
        Descriptor,
        Extremes,
        FinalPose,
        GroundContacts,
        Recorder,
        Trajectory,
    )
    from symbrion_gym._src.tasks.route import Start
    from symbrion_gym._src.tasks.state import TaskState
    from symbrion_gym._src.tasks.task import Task, read_task
    from symbrion_gym._src.tasks.terms import (
        FellOff,
        Goal,
        Reward,
        RolledOver,
        Stuck,
        Termination,
        TouchedPit,
        gain_potential,
        gain_progress,
        has_failed,
        has_succeeded,
        make_rewards,
        make_terminations,
        spend_power,
    )

__all__ = [
    "TASKS",
    "Descriptor",
    "Extremes",
    "FellOff",
    "FinalPose",
    "Goal",
    "GroundContacts",
    "PassFinish",
    "ReachPlaces",
    "Recorder",
    "Reward",
    "RolledOver",
    "Start",
    "Stuck",
    "Task",
    "TaskState",
    "Termination",
    "TouchedPit",
    "Trajectory",
    "find_gap",
    "find_ramp",
    "find_stairs",
    "find_step",
    "gain_potential",
    "gain_progress",
    "has_failed",
    "has_succeeded",
    "make_rewards",
    "make_task",
    "make_terminations",
    "read_task",
    "spend_power",
]

__getattr__, __dir__ = export_lazily(__name__)
