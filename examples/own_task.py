"""A task of one's own: raise the head to 20 cm above the ground, and hold it there."""

import gymnasium as gym
import numpy as np

import symbrion_gym as sg
from symbrion_gym.tasks import PassFinish, RolledOver, gain_progress


class RaiseHead(PassFinish):
    limits = None

    def progress(self, state):
        return state.position[:, 0, 2]

    def has_arrived(self, state):
        return state.height[:, 0] > 0.2


falls = sg.Termination("rolled_over", RolledOver())
rise = sg.Reward("rise", gain_progress)
task = sg.Task("raise_head", goal=RaiseHead(), terminations=(falls,), rewards=(rise,))
env = gym.make("symbrion_gym/CrossGap-v0", task=task, modules=8)
env.reset(seed=0)
results = [env.step(np.array([0, 0.5, 0.4, 0, 0, 0, 0, 0])) for _ in range(150)]
