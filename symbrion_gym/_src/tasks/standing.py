"""What every strict success asks for: upright, on the ground, no faster than the tracks."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Bool, Int

from symbrion_gym._src.tasks.state import TaskState


def find_standing(state: TaskState, rows: Int[Any, " M"]) -> Bool[Any, " M"]:
    """Return in which of some simulations every module is upright and at ground height.

    The ground is looked for only where all the rest is fulfilled.
    """
    low, high = state.criteria.ground_band

    def is_on_ground(some: Int[Any, " K"]) -> Bool[Any, " K"]:
        height = state.find_height(rows[some])
        return ((height > low) & (height < high)).all(axis=1)

    stands: Any = (state.up[rows] > state.criteria.upright).all(axis=1)
    stands = state.confirm(stands, lambda some: state.find_low(rows[some], high))
    return state.confirm(stands, is_on_ground)


def find_honest(state: TaskState) -> Bool[Any, " N"]:
    """Return whether each body is no farther from where it started than its tracks can have taken it, and never was.

    What counts is the way of the middle of its modules, in plan. On the way, a fall excuses a lead; see
    `TaskState.note_lead`.
    """
    way = state.xp.hypot(*(state.middle - state.start_position.mean(axis=1))[:, :2].T)
    return (way <= state.track_speed * state.time + state.criteria.speed_slack) & ~state.was_ahead


def find_honest_along(state: TaskState) -> Bool[Any, " N"]:
    """Return whether each body is no farther along the way than its tracks can have taken it, and never was."""
    farthest = state.start_mean + state.track_speed * state.time + state.criteria.speed_slack
    return (state.find_mean_along() <= farthest) & ~state.was_ahead


def find_size(state: TaskState) -> float:
    """Return the distance of the farthest module from the middle of the body when it lies straight [m]."""
    places = np.array([(pose.x, pose.y) for pose in state.organism.find_poses()])
    return float(np.linalg.norm(places - places.mean(axis=0), axis=1).max())
