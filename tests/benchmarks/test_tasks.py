"""What the simplest actions reach in the environments."""

import pytest

from benchmarks.tasks import list_policies, make_batch, measure


@pytest.mark.slow
def test_targets_that_are_drawn_and_held_hardly_climb():
    envs = make_batch("symbrion_gym/Climb-v0")
    try:
        assert measure(envs, dict(list_policies(envs))["noise ±0.3"], 20).successes <= 2
    finally:
        envs.close()
