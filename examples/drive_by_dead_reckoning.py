"""A Scout drives to random places by what it can sense: its own odometry. It never reads where it is."""

import numpy as np

import symbrion_gym as sg

NOISE = {"yaw": (-0.0873, 0.0873), "start_offset": (-0.05, 0.05), "start_lateral": (-0.05, 0.05)}


def drive(
    arena: sg.Arena, start: tuple[float, float], goal: tuple[float, float], seed: int = 0, **options
) -> bool:
    """Return whether a Scout comes within a module's length of a place, (x, y) [m], and stands there."""
    env = sg.OrganismEnv(
        arena=arena, task="reach", organism=1, start=start, goal=goal, track_control="skid",
        sensors=("goal_direction",), **options,
    )  # fmt: skip
    (bearing, _), _ = env.reset(seed=seed)
    done, info = False, {}
    while not done:
        turn = np.clip(bearing, -1.0, 1.0)
        speed = 1.0 - abs(turn)
        (bearing, _), _, terminated, truncated, info = env.step(np.array([speed - turn, speed + turn]))
        done = terminated or truncated
    return bool(info["success"])


def count(name: str, places: int = 20, **options) -> int:
    """Return how many of some random places, at least 0.3 m away, are reached in an arena."""
    arena, rng, reached = sg.load_arena(name), np.random.default_rng(5), 0
    ground = arena.traversability()
    while places:
        goal = rng.choice(np.flatnonzero(ground.region >= 0))
        start = rng.choice(np.flatnonzero(ground.region == ground.region[goal]))
        if np.linalg.norm(ground.positions[goal] - ground.positions[start]) > 0.3:
            places -= 1
            ends = [tuple(ground.positions[i, :2]) for i in (start, goal)]
            reached += drive(arena, ends[0], ends[1], places, **options)
    return reached


if __name__ == "__main__":
    for name in ("truth", "gsrm"):
        print(
            name,
            count(name),
            "of 20;",
            count(name, randomize=NOISE),
            "from a start that it knows only roughly",
        )
