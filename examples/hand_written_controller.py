"""A controller in fifteen lines: each module takes the slope that a path has at its place.

The path leads down the near wall of the pit and up the far one. Where the head is, dead reckoning tells, and where
the others are, their pitch.

    python examples/hand_written_controller.py
"""

import gymnasium as gym
import numpy as np

import symbrion_gym  # noqa: F401  registers the environments

PLACES = [-0.2, -0.1, 0.05, 0.2, 0.3, 0.45]
SLOPES = [0.0, -1.0, -1.0, 1.2, 1.2, 0.0]
LENGTH = 0.1254


def act(head: float, pitch: np.ndarray) -> np.ndarray:
    """Return the action of modules of this pitch [rad] whose head is at `head` [m] from the middle of the pit."""
    half = LENGTH / 2 * np.cos(pitch)
    places = head - np.cumsum(half + np.roll(half, 1)) + half[0] + half[-1]
    slopes = np.interp(places, PLACES, SLOPES)
    return np.clip((slopes[:-1] - slopes[1:]) / (np.pi / 2), -1.0, 1.0)


def main(render_mode: str | None = None, seed: int = 0) -> bool:
    """Let the body try once; return whether it crossed."""
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
    print("crossed" if main() else "failed")  # noqa: T201
