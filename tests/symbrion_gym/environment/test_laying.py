"""Bodies of any shape come to rest on the ground, lie on it as it is, and stay there."""

import mujoco
import numpy as np
import pytest

from symbrion_gym._src.environment.laying import Settler, compute_depth
from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.robot.body_plans import make_random_organism
from symbrion_gym._src.robot.organism import Organism, cross, letter_h, snake

_BODY = """
<body name="trunk" pos="0 0 {height}">
  <freejoint name="root"/>
  <geom type="box" size="0.1 0.05 0.05" mass="3"/>
  <site name="module_0"/>
  <body name="leg" pos="0.2 0 0">
    <joint name="hinge" axis="0 1 0" pos="-0.1 0 0" range="-1.5 1.5" limited="true"/>
    <geom type="box" size="0.1 0.05 0.05" mass="1"/>
    <site name="module_1"/>
  </body>
</body>
"""


def make_settler(ground: str, height: float = 0.06) -> tuple[mujoco.MjModel, Settler]:
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian"/><worldbody>{ground}{_BODY.format(height=height)}</worldbody></mujoco>'
    )
    sites = np.array([model.site(name).id for name in ("module_0", "module_1")])
    return model, Settler(model, sites, np.array([model.joint("hinge").dofadr[0]]), 0.05)


@pytest.mark.parametrize("height", [0.06, 0.03])
def test_on_a_plane_it_lies_flat_at_the_gap_and_what_is_in_the_ground_is_lifted(height) -> None:
    model, settler = make_settler('<geom type="plane" size="5 5 0.1"/>', height)
    depth = compute_depth(model, mujoco.MjData(model), model.qpos0.copy())
    assert depth == pytest.approx(max(0.05 - height, 0.0))
    qpos = settler.settle(model.qpos0.copy(), 0.002)
    np.testing.assert_allclose(qpos, [0, 0, 0.052, 1, 0, 0, 0, 0], atol=1e-5)


def test_over_an_edge_the_hinge_bends() -> None:
    """The trunk lies on a table, and the leg reaches down to the floor beside it."""
    table = '<geom type="box" size="0.5 0.5 0.05" pos="-0.445 0 0.05"/><geom type="plane" size="5 5 0.1"/>'
    model, settler = make_settler(table, 0.16)
    qpos = settler.settle(model.qpos0.copy(), 0.002)
    assert qpos[2] == pytest.approx(0.152, abs=1e-3)
    assert 0.2 < qpos[7] < 1.0
    assert abs(compute_depth(model, mujoco.MjData(model), qpos)) < 1e-9


def test_on_a_slope_it_tilts_and_does_not_slide() -> None:
    tilt = np.arctan(0.25)
    plane = f'<geom type="plane" size="5 5 0.1" euler="{tilt} 0 0"/>'
    model, settler = make_settler(plane, 0.07)
    qpos = settler.settle(model.qpos0.copy(), 0.002)
    assert 2 * np.arcsin(qpos[4]) == pytest.approx(tilt, abs=1e-3)
    np.testing.assert_allclose(qpos[:2], 0.0, atol=0.004)


def test_it_repeats_to_the_bit_and_leaves_the_model_alone() -> None:
    model, settler = make_settler('<geom type="box" size="1 1 0.1" euler="0.1 0.05 0"/>', 0.18)
    first, second = (settler.settle(model.qpos0.copy(), 0.002) for _ in range(2))
    np.testing.assert_array_equal(first, second)
    assert (model.geom_margin == 0).all()


def test_what_hangs_over_an_abyss_does_not_fold_under() -> None:
    model, settler = make_settler('<geom type="box" size="0.5 0.5 0.05" pos="-0.445 0 0.05"/>', 0.16)
    qpos = settler.settle(model.qpos0.copy(), 0.002)
    assert 0.5 < qpos[7] < np.pi / 3 + 1e-6


_RISE = 0.005
"""No module rises by more in the first half second [m]."""
_DEPTH = 0.003
"""No contact is deeper in the first step [m]."""
RAMP = {"arena": "truth", "start": (-1.2, 0.1), "goal": (1.5, 0.0)}


def make_trees(num: int) -> list[Organism]:
    rng = np.random.default_rng(0)
    return [make_random_organism(int(rng.integers(3, 10)), rng) for _ in range(num)]


def assert_rests(env: OrganismEnv, yaw: float) -> None:
    """The organism, with tracks that stand still, neither jumps nor lies in the ground."""
    env.reset(seed=0, options={"yaw": yaw})
    heights = env.physics.position[0, :, 2].copy()
    mujoco.mj_step(env.model, env.data)
    assert -env.data.contact.dist.min(initial=0.0) <= _DEPTH
    servos = [env.model.actuator(name).id for name in env.world.organism.servos]
    hold = env.data.ctrl[servos] / env.world.organism.scout.hinge_range
    for _ in range(25):
        env.step(hold)
        assert (env.physics.position[0, :, 2] - heights).max() <= _RISE
    assert (heights - env.physics.position[0, :, 2]).max() < 0.01
    assert np.abs(env.data.qvel).max() < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("body", [cross(2), letter_h(), *make_trees(2)])
@pytest.mark.parametrize(
    "where", [RAMP, {"arena": "gsrm"}, {"arena": "stairs", "start": (0.0, 0.2), "goal": (1.5, 0.0)}]
)
def test_trees_rest_where_they_are_laid(body, where):
    env = OrganismEnv(**where, organism=body, track_speed=0.0)
    for yaw in (0.0, 0.6):
        assert_rests(env, yaw)


@pytest.mark.slow
@pytest.mark.parametrize("arena", ["truth", "gsrm", "gg"])
def test_every_body_rests_at_every_start(arena):
    for body in (*map(snake, range(1, 10)), *make_trees(10)):
        env = OrganismEnv(arena=arena, organism=body, track_speed=0.0)
        for yaw in (0.0, 0.6):
            assert_rests(env, yaw)


def test_modules_of_a_cross_follow_a_ramp():
    """Laid flat at the highest point, its lower arm would hang 13 cm above the ramp."""
    env = OrganismEnv(**RAMP, organism=cross(2), track_speed=0.0)
    env.reset(seed=0)
    place = env.physics.position[0]
    above = place[:, 2] - env.world.arena.height(place[:, 0], place[:, 1])
    np.testing.assert_allclose(above, 0.0525 / np.cos(np.arctan(0.25)), atol=0.006)


def test_a_snake_follows_its_line_as_ever():
    """On a slope alone, two millimeters above it; turned across the ramp, it would lie in the ground and is settled."""
    env = OrganismEnv(**RAMP, modules=3)
    env.reset(seed=0)
    height = env.world.arena.height(-1.2, 0.1) + 0.0525 / np.cos(np.arctan(0.25)) + 0.002
    np.testing.assert_allclose(env.data.qpos[:2], [-1.2, 0.1], atol=1e-12)
    assert env.data.qpos[2] == pytest.approx(height, abs=5e-4)
    np.testing.assert_allclose(env.data.qpos[7:], 0.0, atol=1e-6)
    env = OrganismEnv(**RAMP, modules=8, track_speed=0.0)
    env.reset(seed=0, options={"yaw": 0.6})
    assert -env.data.contact.dist.min(initial=0.0) <= _DEPTH


def test_a_lone_module_on_a_crest_has_tipped_already():
    env = OrganismEnv(arena="truth", modules=1, start=(0.735, -0.21), goal=(2.0, -0.21), track_speed=0.0)
    assert_rests(env, 0.0)
    assert env.physics.rotation[0, 0, 6] < -0.1


def test_the_start_is_found_where_the_organism_begins():
    env = OrganismEnv(**RAMP, organism="cross2")
    env.reset(seed=0)
    np.testing.assert_allclose(env.data.qpos[:2], [-1.2, 0.1], atol=0.02)
    for seed in (1, 2):
        first = env.reset(seed=seed)[0]
        np.testing.assert_array_equal(first, env.reset(seed=seed)[0])
