"""Terms of a user, in a module of their own."""

import numpy as np


def is_low(state, below=0.0):
    return state.lowest < below


def count(state):
    return np.ones(state.num)
