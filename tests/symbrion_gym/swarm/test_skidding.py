"""How a kinematic Scout skids: known turns on level ground, balance of forces on slopes, limits."""

import numpy as np
import pytest
from swarm_cases import make_world

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.robot.scout_constants import ARM_RADIUS
from symbrion_gym._src.swarm.docks import SCOUT
from symbrion_gym._src.swarm.dynamic.world import DynamicWorld
from symbrion_gym._src.swarm.kinematic.skidding import TRACK_POINTS, balance, skid
from symbrion_gym._src.swarm.world import SwarmCommands

END, SIDE, SLOPE = 0.0325, 0.0325, 12.0
FRICTION = SCOUT.friction


def test_arm_up_on_level_ground_turns_as_four_corners_do() -> None:
    found = balance(np.zeros(1), np.zeros((1, 2)), FRICTION)[0]
    np.testing.assert_allclose(found, [0.0, 0.0, SIDE / (END**2 + SIDE**2)], atol=1e-6)


def test_level_arm_on_level_ground_turns_about_a_place_ahead() -> None:
    assert np.ptp(TRACK_POINTS[:, 0]) / 2 == pytest.approx(END)
    share = SCOUT.arm_mass / (SCOUT.arm_mass + SCOUT.chassis_mass)
    front = 0.5 + share * (SCOUT.arm_reach - ARM_RADIUS) / (2 * END)
    ahead, left, turn = balance(np.ones(1), np.zeros((1, 2)), FRICTION)[0]
    x, y = END * np.array([1, -1, 1, -1]), SIDE * np.array([1, 1, -1, -1])
    slip = np.stack([ahead - turn * y + np.sign(y), left + turn * x])
    loads = np.where(x > 0, front, 1 - front)
    friction = loads * slip / np.hypot(np.linalg.norm(slip, axis=0), 0.01)
    np.testing.assert_allclose(friction.sum(axis=1), 0.0, atol=1e-6)
    assert (x * friction[1] - y * friction[0]).sum() == pytest.approx(0.0, abs=1e-8)
    assert left < 0.0, "its middle is moved aside: it turns about a place ahead"


def test_friction_balances_gravity_on_a_slope() -> None:
    pull = np.tan(np.deg2rad(SLOPE)) * np.array([0.6, 0.8])
    ahead, left, turn = balance(np.zeros(1), pull[None], FRICTION)[0]
    x, y = END * np.array([1, -1, 1, -1]), SIDE * np.array([1, 1, -1, -1])
    slip = np.stack([ahead - turn * y + np.sign(y), left + turn * x])
    arm = SCOUT.arm_mass / (SCOUT.arm_mass + SCOUT.chassis_mass) * (SCOUT.arm_reach - ARM_RADIUS)
    lean = (SCOUT.size[2] / 2 + arm) * pull / END
    loads = (1 + np.sign(x) * lean[0]) * (1 + np.sign(y) * lean[1]) / 4
    friction = -FRICTION * loads * slip / np.hypot(np.linalg.norm(slip, axis=0), 0.01)
    np.testing.assert_allclose(friction.sum(axis=1), -pull, atol=1e-6)
    assert (x * friction[1] - y * friction[0]).sum() == pytest.approx(0.0, abs=1e-8)


def test_turns_slide_downhill_and_mirror() -> None:
    reach = np.ones(2)
    pulls = np.array([[0.1, 0.15], [0.1, -0.15]])
    one, other = skid(reach, pulls, np.array([0.1, -0.1]), FRICTION)
    np.testing.assert_allclose(one, other * [1.0, -1.0, -1.0], rtol=1e-12)
    level = skid(reach, np.zeros((2, 2)), np.array([0.1, -0.1]), FRICTION)[0]
    assert (one - level)[:2] @ pulls[0] > 0.0


def test_between_the_rows_of_the_table_the_balance_is_near() -> None:
    rng = np.random.default_rng(0)
    reach, pulls = rng.uniform(0.0, 1.0, 50), rng.uniform(-0.15, 0.15, (50, 2))
    found = skid(reach, pulls, np.full(50, 0.1), FRICTION)
    off = np.abs(found - 0.05 * balance(reach, pulls, FRICTION))
    assert np.median(off[:, 2]) < 0.02
    assert off[:, :2].max() < 0.01


def test_straight_ways_do_not_slide_and_beyond_friction_nothing_changes() -> None:
    assert not skid(np.ones(1), np.array([[0.0, 0.3]]), np.zeros(1), FRICTION).any()
    steep = skid(np.ones(2), np.array([[0.0, 0.63], [0.0, 2.0]]), np.full(2, 0.1), FRICTION)
    assert np.isfinite(steep).all()
    np.testing.assert_allclose(steep[0], steep[1], rtol=1e-9)


def test_both_levels_of_physics_slide_alike_on_a_ramp() -> None:
    course = Course(height=2.0 * np.tan(np.deg2rad(SLOPE)), ramp=2.0)
    arena = Arena.from_course(course)
    turn = SwarmCommands(np.array([[-0.05, 0.05]]), np.zeros(1), np.zeros((1, 4), bool))
    start = np.array([-course.pit / 2 - course.plateau - 1.0, 0.0, 0.0])
    worlds, ways = (make_world(start, arena), DynamicWorld(arena, 1)), []
    worlds[1].reset(start[None])
    for world in worlds:
        for _ in range(40):
            world.step(turn)
        ways.append(world.state.position[0, :2] - start[:2])
    assert ways[1][0] < -0.05
    np.testing.assert_allclose(ways[0], ways[1], atol=0.04)
