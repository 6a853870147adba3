"""Bodies, tasks and arenas: Gymnasium's own check without warnings, single and vector equal to the bit."""

import warnings
from functools import cache
from itertools import cycle, product

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from side_by_side import assert_equal_ticks

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.arenas.making import load_arena
from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym._src.robot.body_plans import make_random_organism
from symbrion_gym._src.robot.organism import Organism, cross, letter_h, snake

BODIES: dict[str, Organism] = {
    **{f"snake {count}": snake(count) for count in range(2, 10)},
    "cross": cross(1),
    "H": letter_h(),
    "tree": make_random_organism(6, np.random.default_rng(4)),
}
ARENAS = ("truth", "gsrm", "gg", "wide")
TASKS = ("cross_gap", "climb", "reach", "traverse")
CASES = [(body, *place) for body, place in zip(cycle(BODIES), product(TASKS, ARENAS), strict=False)]
TICKS = 25


@cache
def find_arena(name: str) -> Arena:
    if name == "wide":
        return Arena.from_course(Course(pit=0.3, plateau=1.2, height=0.15, width=3.0), "wide")
    return load_arena(name)


def check(body: str, task: str, arena: str) -> None:
    options = {"arena": find_arena(arena), "task": task, "organism": BODIES[body], "track_control": "skid"}
    env, other = OrganismEnv(**options), OrganismEnv(**options)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*different from the unwrapped version.*|.*spec.*")
        check_env(env, skip_render_check=True)
    envs = OrganismVectorEnv(2, num_threads=1, autoreset_mode="Disabled", **options)
    many, _ = envs.reset(seed=3)
    np.testing.assert_array_equal(many, [other.reset(seed=3)[0], env.reset(seed=4)[0]])
    assert_equal_ticks(envs, [other, env], TICKS, np.random.default_rng(1))


@pytest.mark.slow
@pytest.mark.parametrize(("body", "task", "arena"), CASES)
def test_every_task_in_every_arena_and_every_body_in_some(body, task, arena):
    check(body, task, arena)
