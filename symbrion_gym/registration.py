"""The names under which Gymnasium makes the environments."""

from __future__ import annotations

from typing import Any

import gymnasium as gym

ENVIRONMENTS: dict[str, dict[str, Any]] = {
    "symbrion_gym/SnakePit-v0": {"default_pit": 0.40},
    "symbrion_gym/SnakePit-v1": {},
    "symbrion_gym/SnakeRamp-v0": {"arena": "truth", "pit": 0.0},
    "symbrion_gym/SnakeStairs-v0": {"arena": "stairs"},
    "symbrion_gym/SnakeTerrain-v0": {
        "arena": "gsrm",
        "default_pit": 0.40,
        "default_ends": ((-1.9, -0.4), (-0.35, 0.3)),
    },
}
"""Id -> options that differ from those of `OrganismEnv`."""


def register() -> None:
    """Register every environment; a second call changes nothing."""
    for name, options in ENVIRONMENTS.items():
        if name not in gym.registry:
            gym.register(
                name,
                entry_point="symbrion_gym.environment.organism_env:OrganismEnv",
                vector_entry_point="symbrion_gym.environment.organism_vector_env:OrganismVectorEnv",
                kwargs=dict(options),
            )
