"""What every strict success asks for: upright, on the ground, no faster than the tracks."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Int

from symbrion_gym.tasks.state import TaskState


def find_standing(state: TaskState, rows: Int[np.ndarray, " M"]) -> Bool[np.ndarray, " M"]:
    """Return in which of some simulations every module is upright and at ground height.

    The ground is looked for only where all the rest is fulfilled.
    """
    criteria = state.criteria
    low, high = criteria.ground_band
    stands: np.ndarray = np.logical_and.reduce(state.up[rows] > criteria.upright, axis=1)
    for index in np.flatnonzero(stands):
        row = rows[index]
        x, _, z = state.position[row].T
        stands[index] = not state.scenes[row].is_above_all(x, z, high).any()
    near = np.flatnonzero(stands)
    if len(near):
        height = state.find_height(rows[near])
        stands[near] = ((height > low) & (height < high)).all(axis=1)
    return stands


def find_honest(state: TaskState) -> Bool[np.ndarray, " N"]:
    """Return whether each body is no farther from where it started than its tracks can have taken it, and never was.

    What counts is the way of the middle of its modules, in plan. On the way, a fall excuses a lead; see
    `TaskState.note_lead`.
    """
    way = np.hypot(*(state.middle - state.start_position.mean(axis=1))[:, :2].T)
    return (way <= state.track_speed * state.time + state.criteria.speed_slack) & ~state.was_ahead


def find_honest_along(state: TaskState) -> Bool[np.ndarray, " N"]:
    """Return whether each body is no farther along the way than its tracks can have taken it, and never was."""
    farthest = state.start_mean + state.track_speed * state.time + state.criteria.speed_slack
    return (state.find_mean_along() <= farthest) & ~state.was_ahead


def find_size(state: TaskState) -> float:
    """Return the distance of the farthest module from the middle of the body when it lies straight [m]."""
    places = np.array([(pose.x, pose.y) for pose in state.organism.find_poses()])
    return float(np.linalg.norm(places - places.mean(axis=0), axis=1).max())
