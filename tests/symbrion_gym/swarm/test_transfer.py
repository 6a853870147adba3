"""The state of robots, carried from one layout to another."""

import mujoco
import numpy as np
import pytest

from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.robot.scout_constants import ScoutConfig
from symbrion_gym._src.swarm.docks import sort_links
from symbrion_gym._src.swarm.dynamic.assembly import Assembler, OpenOrganism, find_layout
from symbrion_gym._src.swarm.dynamic.motion import compute_kinetic_energy, compute_momentum
from symbrion_gym._src.swarm.dynamic.transfer import read_motion, refresh, write_motion
from tests.symbrion_gym.swarm.dynamic_cases import ARENA

SCOUT = ScoutConfig()
LINKS = sort_links(
    [Docking(0, "back", 1, "front"), Docking(1, "left", 2, "front"), Docking(1, "back", 3, "right")]
)
ASSEMBLER = Assembler(ARENA, SCOUT, 0.005)


def assemble(links=LINKS, welds=(), open_arms=()):
    assembly = ASSEMBLER.assemble(find_layout(links, welds, frozenset(open_arms), 4, SCOUT))
    return assembly, mujoco.MjData(assembly.model)


def shake(assembly, data, seed=0):
    """Put a model into a random state."""
    rng = np.random.default_rng(seed)
    data.qvel[:] = rng.uniform(-1.0, 1.0, assembly.model.nv)
    mujoco.mj_integratePos(assembly.model, data.qpos, rng.uniform(-0.5, 0.5, assembly.model.nv), 1.0)
    refresh(assembly.model, data)


def test_motion_read_from_a_tree_and_written_is_the_same():
    assembly, data = assemble()
    shake(assembly, data)
    motion, other = read_motion(assembly, data), mujoco.MjData(assembly.model)
    write_motion(assembly, other, motion, SCOUT)
    for one, two in zip(motion, read_motion(assembly, other), strict=True):
        np.testing.assert_allclose(one, two, atol=1e-12)


def test_parting_and_joining_lose_nothing():
    assembly, data = assemble()
    shake(assembly, data)
    motion = read_motion(assembly, data)
    lone, free = assemble(links=())
    write_motion(lone, free, motion, SCOUT)
    apart = read_motion(lone, free)
    for one, two in zip(motion, apart, strict=True):
        np.testing.assert_allclose(one, two, atol=1e-12)
    again = mujoco.MjData(assembly.model)
    write_motion(assembly, again, apart, SCOUT)
    np.testing.assert_allclose(again.qpos, data.qpos, atol=1e-12)
    np.testing.assert_allclose(again.qvel, data.qvel, atol=1e-10)


@pytest.mark.parametrize("seed", range(5))
def test_joining_keeps_momentum_and_never_adds_energy(seed):
    """Velocities of lone robots that do not fit a tree: a plastic impact."""
    assembly, data = assemble()
    shake(assembly, data, seed)
    rng = np.random.default_rng(seed)
    motion = read_motion(assembly, data)
    motion = motion._replace(
        velocity=motion.velocity + rng.normal(size=(4, 3)), spin=motion.spin + rng.normal(size=(4, 3))
    )
    write_motion(assembly, data, motion, SCOUT)
    after = read_motion(assembly, data)
    for one, two in zip(compute_momentum(motion, SCOUT), compute_momentum(after, SCOUT), strict=True):
        np.testing.assert_allclose(one, two, atol=1e-9)
    assert compute_kinetic_energy(after, SCOUT).sum() < compute_kinetic_energy(motion, SCOUT).sum()


def test_kinetic_energy_is_that_of_mujoco():
    assembly, data = assemble()
    shake(assembly, data)
    mujoco.mj_makeM(assembly.model, data)
    inertia = np.zeros((assembly.model.nv, assembly.model.nv))
    mujoco.mj_fullM(assembly.model, data, inertia)
    expected = 0.5 * data.qvel @ inertia @ data.qvel
    assert compute_kinetic_energy(read_motion(assembly, data), SCOUT).sum() == pytest.approx(
        expected, rel=1e-9
    )


def test_small_errors_are_spread_over_the_modules():
    assembly, data = assemble()
    shake(assembly, data)
    motion = read_motion(assembly, data)
    off = motion.position.copy()
    off[0, 0] += 1e-4
    write_motion(assembly, data, motion._replace(position=off), SCOUT)
    moved = np.linalg.norm(read_motion(assembly, data).position - motion.position, axis=1)
    assert moved.max() < 1e-4


def test_arms_held_by_a_weld_or_told_to_move_have_a_hinge():
    assembly, _ = assemble(welds=LINKS[:1])
    held = [tree for tree in assembly.layout.trees if len(tree.robots) == 3]
    assert isinstance(held[0].organism, OpenOrganism)
    assert (assembly.hinge_qpos[[0, 1, 2]] >= 0).all()
    opened, _ = assemble(open_arms=[0])
    assert opened.model.nv == assemble()[0].model.nv + 1


def test_equal_layouts_are_compiled_once():
    assert assemble()[0] is assemble()[0]


def test_every_geom_that_touches_has_an_owner():
    assembly, _ = assemble()
    model = assembly.model
    touches = (model.geom_contype > 0) & (model.geom_bodyid > 0)
    assert (assembly.owners[touches] >= 0).all()
    assert (assembly.owners[model.geom_bodyid == 0] == -1).all()
