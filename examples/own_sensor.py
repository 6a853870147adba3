"""A sensor of one's own: how high each module's center is above the ground, beside three of the robot's sensors."""

import gymnasium as gym
import numpy as np

import symbrion_gym as sg

height = sg.Sensor("height", size=4, low=0.0, high=0.5, function=lambda state: state.height)
options = {"modules": 4, "sensors": ("hinge_angle", "pitch", "contact", height)}
env = gym.make("symbrion_gym/CrossGap-v0", **options)
observation, _ = env.reset(seed=0)
envs = gym.make_vec("symbrion_gym/CrossGap-v0", 2, vectorization_mode="vector_entry_point", **options)
observations, _ = envs.reset(seed=0)
part = env.unwrapped.observation_structure["height"]
print("heights [m]:", np.round(observation[part], 3))
