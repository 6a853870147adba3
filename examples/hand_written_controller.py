"""A controller in fifteen lines: each module takes the slope of a path at its position.

The path leads down the near wall of the pit and up the far one. The position of the head is estimated by dead
reckoning; the positions of the other modules follow from their pitch.

    python examples/hand_written_controller.py
"""

import gymnasium as gym
import numpy as np

import symbrion_gym  # noqa: F401  registers the environments

POSITIONS = [-0.2, -0.1, 0.05, 0.2, 0.3, 0.45]
"""Points of the path along the course, from the middle of the pit [m]."""
SLOPES = [0.0, -1.0, -1.0, 1.2, 1.2, 0.0]
"""Slope of the path at these points; up is positive [rad]."""
LENGTH = 0.1254
"""Distance of two docked modules [m]."""


def act(head: float, pitch: np.ndarray) -> np.ndarray:
    """Return the action.

    Args:
        head: position of the head along the course, from the middle of the pit [m].
        pitch: pitch of all modules [rad].
    """
    half = LENGTH / 2 * np.cos(pitch)
    positions = head - np.cumsum(half + np.roll(half, 1)) + half[0] + half[-1]
    slopes = np.interp(positions, POSITIONS, SLOPES)
    return np.clip((slopes[:-1] - slopes[1:]) / (np.pi / 2), -1.0, 1.0)


def main(render_mode: str | None = None, seed: int = 0) -> bool:
    """Run one episode and return whether the snake crossed."""
    env = gym.make(
        "symbrion_gym/SnakePit-v1",
        arena="truth",
        modules=8,
        sensors=("track_odometry", "pitch"),
        render_mode=render_mode,
    )
    observation, info = env.reset(seed=seed)
    done = False
    while not done:
        observation, _, terminated, truncated, info = env.step(act(observation[0], observation[1:]))
        done = terminated or truncated
    env.close()
    return bool(info["success"])


if __name__ == "__main__":
    print("crossed" if main() else "failed")
