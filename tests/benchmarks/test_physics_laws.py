"""The theory of the benchmark of physics: cases known by hand; the simulation keeps to it, a broken one does not."""

import numpy as np
import pytest

from benchmarks.material.physics_energy import measure_creep, measure_depths, measure_energy, measure_sinking
from benchmarks.material.physics_laws import climbs_slope, climbs_step, crosses_gap, measure_turning_rate
from benchmarks.material.physics_published import DRIVES, find_misses, make_robot, measure_drive
from benchmarks.material.physics_theory import (
    find_beam_gap_limit,
    find_climbing_friction,
    find_gap_limit,
    find_slope_limit,
    find_tipping_limit,
    make_chain,
)
from benchmarks.material.physics_wheels import compute_turning_rate, find_step_limit, make_contacts
from benchmarks.material.physics_worlds import GRAVITY, Bench, World
from symbrion_gym._src.arenas.checks import FRICTION_LIMITS
from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.robot.belts import compute_load_gain, compute_sliding_rate
from symbrion_gym._src.robot.scout import CONTACT_TIME, compute_friction_stiffness

FEET = np.array([(x, y) for x in (0.0325, 0.0, -0.0325) for y in (0.0325, -0.0325)])


def test_slope_limit_by_hand() -> None:
    assert np.degrees(find_slope_limit(1.0)) == pytest.approx(45.0)


def test_tipping_limit_by_hand() -> None:
    height = 0.0525 + 0.16 * 0.057 / 0.95
    assert find_tipping_limit(World().organism.scout) == pytest.approx(np.arctan(0.0325 / height))


def test_lone_module_crosses_half_its_wheel_base() -> None:
    assert find_gap_limit(World().organism, is_round=False) == pytest.approx(0.0325, abs=2e-4)


def test_strong_chain_is_limited_by_its_balance_alone() -> None:
    limits = [
        find_gap_limit(World(modules=4, scout={"hinge_torque": torque}).organism) for torque in (50.0, 99.0)
    ]
    assert limits[0] == limits[1]
    assert limits[0] == pytest.approx(4 * 0.1254 / 2, abs=0.03)


def test_wider_gaps_need_more_torque() -> None:
    limits = [
        find_gap_limit(World(modules=6, scout={"hinge_torque": t}).organism) for t in (0.5, 1.0, 2.0, 4.5)
    ]
    assert limits == sorted(limits)


def test_a_wheel_drives_up_the_far_wall_if_friction_beats_the_levers() -> None:
    assert find_climbing_friction(World().organism.scout) == pytest.approx(0.0525 / (0.1254 + 0.0325))


def test_even_beam_is_the_formula() -> None:
    organism = World(modules=8, scout={"hinge_torque": 4.5}).organism
    expected = 0.1254 * np.sqrt(2 * 4.5 / (0.95 * GRAVITY * 0.1254))
    assert find_beam_gap_limit(organism) == pytest.approx(expected)


def test_chain_weighs_what_its_model_weighs() -> None:
    world = World(modules=3)
    mass = Bench(world).model.body_mass.sum()
    assert make_chain(world.organism).weight.sum() == pytest.approx(mass * GRAVITY)


def test_turning_rate_by_hand() -> None:
    belts = np.where(FEET[:, 1] > 0, -0.05, 0.05)
    slip = (8 - np.sqrt(28)) / 6  # of 3 k² - 8 k + 3 = 0, from the balance of moments
    assert compute_turning_rate(FEET, np.ones(6), belts) == pytest.approx(
        0.05 / ((1 + slip) * 0.0325), rel=1e-4
    )
    corners = FEET[:, 0] != 0.0
    assert compute_turning_rate(FEET[corners], np.ones(4), belts[corners]) == pytest.approx(
        0.05 / 0.065, rel=1e-3
    )


def test_turning_rate_follows_the_speed_and_no_load() -> None:
    belts = np.where(FEET[:, 1] > 0, -0.05, 0.05)
    rate = compute_turning_rate(FEET, np.ones(6), belts)
    assert compute_turning_rate(FEET, np.full(6, 7.0), 2 * belts) == pytest.approx(2 * rate, rel=1e-4)


@pytest.mark.parametrize("speed", [0.05, 0.01])
def test_a_lone_module_turns_as_the_law_of_the_contacts_says(speed: float) -> None:
    world = World()
    gain = compute_load_gain(0.7, compute_friction_stiffness(1), CONTACT_TIME)
    theory = compute_sliding_rate(make_contacts(world.organism, speed), gain)
    assert measure_turning_rate(world, speed, seconds=2.0) == pytest.approx(theory, rel=0.02)


def test_a_step_that_a_wheel_is_already_above_needs_nothing_of_it() -> None:
    scout = World().organism.scout
    assert find_step_limit(scout) < scout.track_radius
    assert find_step_limit(World(friction=0.01).organism.scout) < 1e-3


def test_a_published_robot_drives_straight_as_published() -> None:
    assert make_robot(0.7, 0.001)[0].body_mass.sum() == pytest.approx(13.14 + 2 * 6.06 + 4 * 0.75)
    found = measure_drive(DRIVES["straight"], timestep=0.004)
    assert not find_misses(DRIVES["straight"], found)
    assert find_misses(DRIVES["curve"], found) == ["yaw"]


def test_higher_steps_need_more_friction_and_larger_wheels() -> None:
    limits = [find_step_limit(World(friction=friction).organism.scout) for friction in (0.3, 0.5, 0.7)]
    assert limits == sorted(limits)
    assert find_step_limit(World(scout={"track_radius": 0.01}).organism.scout) < limits[-1]


def test_simulation_climbs_what_theory_says_and_half_the_friction_does_not() -> None:
    limit = np.degrees(find_slope_limit(0.7))
    world = World(modules=2)
    assert climbs_slope(world, limit - 1.0)
    assert not climbs_slope(world, limit + 1.0)
    assert not climbs_slope(World(modules=2, friction=0.35), limit - 1.0)


def test_friction_has_no_preferred_direction() -> None:
    limit = np.degrees(find_slope_limit(0.7))
    assert climbs_slope(World(modules=2), limit - 1.0, heading_deg=45.0)
    assert not climbs_slope(World(modules=2), limit + 1.0, heading_deg=45.0)


def test_simulation_crosses_gaps_and_climbs_steps_within_theory() -> None:
    world = World(modules=2)
    limit = find_gap_limit(world.organism)
    assert crosses_gap(world, 0.9 * limit)
    assert not crosses_gap(world, 1.2 * limit)
    step = find_step_limit(world.organism.scout)
    assert climbs_step(World(), 0.85 * step)
    assert not climbs_step(World(), 1.15 * step)


def test_energy_is_accounted_for() -> None:
    found = measure_energy(World(modules=2), np.radians(10.0), seconds=1.0)
    assert found.residual < 0.02
    assert found.sliding > 0
    assert found.damping > 0


@pytest.mark.parametrize("modules", [1, 3, 5])
def test_a_robot_at_rest_on_a_slope_hardly_creeps(modules: int) -> None:
    assert measure_creep(World(modules=modules), np.radians(20.0)) < 1.1e-4


@pytest.mark.slow
@pytest.mark.parametrize("friction", FRICTION_LIMITS)
def test_no_friction_that_is_allowed_lets_a_snake_sink(friction: float) -> None:
    assert measure_sinking(friction, episodes=2).deepest < 0.01


def test_modules_that_hinges_press_together_stay_apart() -> None:
    found = measure_depths(World(modules=6))
    assert found.between_modules < 1e-3
    assert found.worst_between_modules < 4e-3


def test_equal_worlds_give_equal_bits() -> None:
    rates = [measure_turning_rate(World(modules=2), seconds=0.5) for _ in range(2)]
    assert rates[0] == rates[1]


def test_bench_has_the_options_of_the_environment() -> None:
    bench, env = Bench(World(modules=2)), OrganismEnv(modules=2)
    for name in ("timestep", "integrator", "solver", "cone", "jacobian", "impratio", "disableflags"):
        assert getattr(bench.model.opt, name) == getattr(env.model.opt, name), name
