"""What is rewarded: functions of the state, and the usual terms made of them."""

from __future__ import annotations

from typing import Any

from jaxtyping import Float

from symbrion_gym._src.tasks.state import TaskState
from symbrion_gym._src.tasks.terms import Reward


def gain_progress(state: TaskState) -> Float[Any, " N"]:
    """Return the progress of this tick; falling forwards counts."""
    return state.progress - state.previous_progress


def gain_potential(state: TaskState) -> Float[Any, " N"]:
    """Return the change of a potential that is the progress, and that of the start once the task has failed.

    So the terms of a failed episode add up to nothing, and a fall gains nothing (Ng, Harada and Russell 1999, with
    no discount and the potential of the start in every failed state).
    """
    now = state.progress
    if state.may_hold(state.failed):
        now = state.xp.where(state.failed, state.start_progress, now)
    return now - state.previous_progress


def has_succeeded(state: TaskState) -> Float[Any, " N"]:
    """Return 1 for a success."""
    return state.success.astype(state.progress.dtype)


def has_failed(state: TaskState) -> Float[Any, " N"]:
    """Return 1 for a failure: rolled over, fell, diverged and what else the task counts as one."""
    return state.failed.astype(state.progress.dtype)


def spend_power(state: TaskState) -> Float[Any, " N"]:
    """Return the absolute power of the hinges [W]."""
    return state.power


def make_rewards(
    forward: float = 1.0, success: float = 1.0, effort: float = 0.002, failure: float = 1.0
) -> tuple[Reward, ...]:
    """Return the usual rewards of the tasks: potential of progress, success, failure, work of the hinges."""
    return (
        Reward("forward", gain_potential, forward),
        Reward("success", has_succeeded, success, at_end=True),
        Reward("failure", has_failed, -failure, at_end=True),
        Reward("effort", spend_power, -effort, per_second=True),
    )
