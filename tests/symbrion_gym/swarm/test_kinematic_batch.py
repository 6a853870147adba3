"""Many swarms at once: equal to each on its own, to the bit, also where they dock; refusals."""

import numpy as np
import pytest

from symbrion_gym._src.arenas.loading import load_arena
from symbrion_gym._src.errors import ArenaError, OptionError
from symbrion_gym._src.robot.scout_constants import ScoutConfig
from symbrion_gym._src.swarm.kinematic.batch import KinematicBatch
from symbrion_gym._src.swarm.kinematic.kinematic_world import KinematicWorld
from symbrion_gym._src.swarm.senses import Senses
from symbrion_gym._src.swarm.world import SwarmCommands

PITCH = ScoutConfig().pitch
START = np.array([[-2.2, 0.0, 0.0], [-2.206 - PITCH, 0.0, 0.0], [-1.4, 0.5, 0.5], [-2.0, -0.4, 2.0]])
SEEDS = (3, 5, 7)
DECISIONS = 60


def draw_commands(seed: int) -> list[SwarmCommands]:
    """Return commands of a swarm: random ones for robots that let go at random times."""
    rng = np.random.default_rng(seed)
    commands = []
    for decision in range(DECISIONS):
        if decision % 15 == 0:
            tracks, hinge = rng.uniform(-0.1, 0.1, (4, 2)), rng.uniform(-0.5, 1.0, 4)
            latch = np.full((4, 4), bool(rng.random() < 0.7))
        commands.append(SwarmCommands(tracks, hinge, latch))
    return commands


@pytest.mark.parametrize("arena", ["truth", "gsrm"])
def test_each_swarm_moves_as_on_its_own(arena: str) -> None:
    loaded = load_arena(arena)
    poses = START + 0.05 * np.arange(3)[:, None, None] * [1.0, 0.0, 0.0]
    told = [draw_commands(seed) for seed in SEEDS]
    batch = KinematicBatch(loaded, 3, 4)
    batch.reset(poses, SEEDS)
    num_links = 0
    alone = [KinematicWorld(loaded, 4) for _ in SEEDS]
    for world, start, seed in zip(alone, poses, SEEDS, strict=True):
        world.reset(start, seed)
    for decision in range(DECISIONS):
        batch.step([each[decision] for each in told])
        for world, swarm, each in zip(alone, batch.swarms, told, strict=True):
            world.step(each[decision])
            for name, value in world.state._asdict().items():
                np.testing.assert_array_equal(getattr(swarm.state, name), value, err_msg=name)
            np.testing.assert_array_equal(swarm.blocked, world.blocked)
            np.testing.assert_array_equal(swarm.groups, world.groups)
            assert swarm.time == world.time
            num_links += len(world.state.links)
    assert num_links


def test_swarms_do_not_meet() -> None:
    batch = KinematicBatch(load_arena("truth"), 2, 2)
    batch.reset(np.stack([START[:2], START[:2]]), (0, 0))
    latch = SwarmCommands(np.zeros((2, 2)), np.zeros(2), np.ones((2, 4), bool))
    batch.step([latch, SwarmCommands.make_idle(2)])
    assert [len(state.links) for state in batch.states] == [1, 0]
    np.testing.assert_array_equal(batch.swarms[0].groups, [0, 0])
    np.testing.assert_array_equal(batch.swarms[1].groups, [0, 1])


def test_a_swarm_of_a_batch_can_be_sensed() -> None:
    arena = load_arena("truth")
    batch, alone = KinematicBatch(arena, 2, 4), KinematicWorld(arena, 4)
    batch.reset(np.stack([START, START[::-1]]), (0, 1))
    alone.reset(START[::-1], 1)
    for name, value in Senses(alone, laser=True, seed=2).read().items():
        np.testing.assert_array_equal(Senses(batch.swarms[1], laser=True, seed=2).read()[name], value)


def test_refusals() -> None:
    arena = load_arena("truth")
    with pytest.raises(OptionError, match="num_swarms must be a whole number"):
        KinematicBatch(arena, 0, 2)
    batch = KinematicBatch(arena, 2, 2)
    with pytest.raises(OptionError, match="poses must be"):
        batch.reset(START[None, :2], (0,))
    with pytest.raises(ArenaError, match="overlap"):
        batch.reset(np.stack([START[:2], START[[0, 0]]]), (0, 1))
    batch.reset(np.stack([START[:2], START[2:]]), (0, 1))
    with pytest.raises(OptionError, match="one for each is needed"):
        batch.step([SwarmCommands.make_idle(2)])
    with pytest.raises(OptionError, match="call step of the batch"):
        batch.swarms[0].step(SwarmCommands.make_idle(2))
    with pytest.raises(OptionError, match="call reset of the batch"):
        batch.swarms[0].reset(START[:2])
