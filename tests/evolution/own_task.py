"""A task of a user's own, whose term can be imported."""

import numpy as np

import symbrion_gym as sg
from symbrion_gym.tasks import Termination


def is_high(state) -> np.ndarray:
    """Whether a module is more than a meter up."""
    return state.position[:, :, 2].max(axis=1) > 1.0


TASK = sg.Task("stay_low", terminations=(Termination("too_high", is_high),), duration=1.0)


def make_task() -> sg.Task:
    """Return the task."""
    return TASK
