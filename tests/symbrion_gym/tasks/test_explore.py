"""Exploring: what was seen is counted on the ground of each simulation's own arena."""

import numpy as np

from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv

OPTIONS = {"arena": "gsrm", "task": "explore", "modules": 1, "track_control": "skid", "start": (-2.0, 0.0)}


def test_arenas_of_different_lengths_are_explored_side_by_side_and_one_after_the_other():
    """Their ground has different numbers of cells; trials of evolution exchange the arenas of the simulations."""
    both = OrganismVectorEnv(2, stretches=(0.95, 1.05), **OPTIONS)
    for stretches in ((0.95, 1.05), (1.05, 0.95)):
        both.reset(seed=[3, 4], options={"stretch": list(stretches)})
        alone = [OrganismEnv(stretch=stretch, **OPTIONS) for stretch in stretches]
        for env, seed in zip(alone, (3, 4), strict=True):
            env.reset(seed=seed)
        for _ in range(30):
            *_, infos = both.step(np.ones((2, 2)))
            progress = [env.step(np.ones(2))[4]["progress"] for env in alone]
        assert list(infos["progress"]) == progress
        assert min(progress) > 0.0


def test_what_was_seen_at_the_start_stays_seen():
    """Progress counts from the start: it never falls, not in the first ticks either."""
    env = OrganismEnv(**OPTIONS)
    env.reset(seed=5)
    steps = [env.step(np.ones(2)) for _ in range(12)]
    progress = [0.0, *(step[4]["progress"] for step in steps)]
    assert min(np.diff(progress)) >= 0.0
    assert abs(steps[0][1]) < 0.05
