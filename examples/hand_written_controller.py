"""A controller in fifteen lines: every hinge takes the angle of the place that it passes.

The body bends down into the pit, follows its floor and lifts its head at the far wall.

    python examples/hand_written_controller.py
"""

import gymnasium as gym
import numpy as np

import symbrion_gym  # noqa: F401  registers the environments

PLACES = np.linspace(-0.55, 1.10, 12)
ANGLES = [0.68, 0.44, 0.26, 0.19, 0.38, -0.64, 0.0, 0.1, -0.03, -0.26, 0.8, -0.06]


def act(head: float) -> np.ndarray:
    """Return the action of eight modules whose head is at `head` [m] from the middle of the pit."""
    hinges = head - 0.1254 * (np.arange(7) + 0.5)
    return np.interp(hinges, PLACES, ANGLES, left=0.0, right=0.0) / (np.pi / 2)


def main(render_mode: str | None = None, seed: int = 0) -> bool:
    """Let the body try once; return whether it crossed."""
    env = gym.make("symbrion_gym/SnakePit-v1", arena="truth", modules=8, render_mode=render_mode)
    _, info = env.reset(seed=seed)
    done = False
    while not done:
        *_, terminated, truncated, info = env.step(act(info["x_position"]))
        done = terminated or truncated
    env.close()
    return bool(info["success"])


if __name__ == "__main__":
    print("crossed" if main() else "failed")  # noqa: T201
