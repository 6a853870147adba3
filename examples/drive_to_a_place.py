"""A Scout drives to a place over drivable ground by its true pose; its tracks run left and right."""

import numpy as np

import symbrion_gym as sg


def drive(arena: sg.Arena, start: tuple[float, float], goal: tuple[float, float], near: float = 0.05) -> bool:
    """Return whether a single Scout gets from start to goal, (x, y) [m]."""
    path = arena.find_route(start=start, goal=goal).path[:, :2]
    env = sg.OrganismEnv(arena=arena, modules=1, track_control="skid", start=start, goal=goal, duration=300.0)
    done, _ = False, env.reset(seed=0)
    while not done:
        place, forward = env.physics.position[0, 0, :2], env.physics.rotation[0, 0, [0, 3]]
        if np.linalg.norm(path[-1] - place) < near:
            return True
        ahead = np.argmin(np.linalg.norm(path - place, axis=1)) + 4  # points of the path are about 5 cm apart
        x, y = path[min(ahead, len(path) - 1)] - place
        turn = np.arctan2(forward[0] * y - forward[1] * x, forward @ (x, y))
        speed = max(0.0, np.cos(turn)) ** 2
        *_, terminated, truncated, _ = env.step(np.array([speed - turn, speed + turn]))
        done = terminated or truncated
    return False
