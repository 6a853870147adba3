"""The state of robots, carried from one layout to another."""

import mujoco
import numpy as np
import pytest
from swarm_cases import ARENA

from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.swarm.docks import SCOUT, sort_links
from symbrion_gym._src.swarm.dynamic.assembly import Assembler, OpenOrganism, find_layout
from symbrion_gym._src.swarm.dynamic.transfer import read_motion, refresh, write_motion

LINKS = sort_links(
    [Docking(0, "back", 1, "front"), Docking(1, "left", 2, "front"), Docking(1, "back", 3, "front")]
)
ASSEMBLER = Assembler(ARENA, SCOUT)


def assemble(links=LINKS, welds=(), open_arms=()):
    assembly = ASSEMBLER.assemble(find_layout(links, welds, frozenset(open_arms), 4, SCOUT))
    return assembly, mujoco.MjData(assembly.model)


def shake(assembly, data, seed=0):
    """Put a model into a random state, and return how its robots move."""
    rng = np.random.default_rng(seed)
    data.qvel[:] = rng.uniform(-1.0, 1.0, assembly.model.nv)
    mujoco.mj_integratePos(assembly.model, data.qpos, rng.uniform(-0.5, 0.5, assembly.model.nv), 1.0)
    refresh(assembly, data)
    return read_motion(assembly, data)


def measure(assembly, data):
    """Return momentum, angular momentum about the origin and kinetic energy, as MuJoCo computes them."""
    mujoco.mj_subtreeVel(assembly.model, data)
    mujoco.mj_makeM(assembly.model, data)
    mujoco.mj_energyVel(assembly.model, data)
    momentum = assembly.model.body_subtreemass[0] * data.subtree_linvel[0]
    return momentum, data.subtree_angmom[0] + np.cross(data.subtree_com[0], momentum), data.energy[1]


def test_parting_and_joining_lose_nothing():
    assembly, data = assemble()
    motion = shake(assembly, data)
    lone, free = assemble(links=())
    write_motion(lone, free, motion)
    apart = read_motion(lone, free)
    for one, two in zip(motion, apart, strict=True):
        np.testing.assert_allclose(one, two, atol=1e-12)
    again = mujoco.MjData(assembly.model)
    write_motion(assembly, again, apart)
    np.testing.assert_allclose(again.qpos, data.qpos, atol=1e-12)
    np.testing.assert_allclose(again.qvel, data.qvel, atol=1e-10)


@pytest.mark.parametrize("seed", range(3))
def test_joining_keeps_momentum_and_never_adds_energy(seed):
    """Velocities of lone robots that do not fit a tree: a plastic impact."""
    assembly, data = assemble()
    motion = shake(assembly, data, seed)
    rng = np.random.default_rng(seed)
    motion = motion._replace(
        velocity=motion.velocity + rng.normal(size=(4, 3)), spin=motion.spin + rng.normal(size=(4, 3))
    )
    lone, free = assemble(links=())
    write_motion(lone, free, motion)
    write_motion(assembly, data, motion)
    before, after = measure(lone, free), measure(assembly, data)
    np.testing.assert_allclose(after[0], before[0], atol=1e-9)
    np.testing.assert_allclose(after[1], before[1], atol=1e-9)
    assert after[2] < before[2]


def test_small_errors_are_spread_over_the_modules():
    assembly, data = assemble()
    motion = shake(assembly, data)
    off = motion.position.copy()
    off[0, 0] += 1e-4
    write_motion(assembly, data, motion._replace(position=off))
    moved = np.linalg.norm(read_motion(assembly, data).position - motion.position, axis=1)
    assert moved.max() < 1e-4


def test_arms_held_by_a_weld_or_told_to_move_have_a_hinge():
    assembly, _ = assemble(welds=LINKS[:1])
    held = [tree for tree in assembly.layout.trees if len(tree.robots) == 3]
    assert isinstance(held[0].organism, OpenOrganism)
    assert (assembly.hinge_qpos[[0, 1, 2]] >= 0).all()
    opened, _ = assemble(open_arms=[0])
    assert opened.model.nv == assemble()[0].model.nv + 1
    assert assemble()[0] is assemble()[0]  # compiled once


def test_every_geom_that_touches_has_an_owner():
    assembly, _ = assemble()
    model = assembly.model
    touches = (model.geom_contype > 0) & (model.geom_bodyid > 0)
    assert (assembly.owners[touches] >= 0).all()
    assert (assembly.owners[model.geom_bodyid == 0] == -1).all()
