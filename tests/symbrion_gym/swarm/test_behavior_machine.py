"""The behaviors of a swarm, in discs of exact senses: from the scattered start to the whole organism."""

import numpy as np
import pytest
from toy_swarm import ToySwarm, scatter

from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.organism import Docking, Organism, cross, snake
from symbrion_gym._src.swarm.behavior.machine import Machine
from symbrion_gym._src.swarm.behavior.memory import PART, Memory, Mode, make_plan, make_ticket, read_ticket
from symbrion_gym._src.swarm.behavior.percepts import NOBODY


def run(swarm: ToySwarm, machine: Machine, memory: Memory, duration: float, seed: int = 0) -> Memory:
    """Let a swarm behave until the organism is whole, or the time is over."""
    rng = np.random.default_rng(seed)
    while swarm.time < duration and not machine.is_complete(memory):
        decision = machine.decide(swarm.read(), memory, rng)
        memory, swarm.words, swarm.wire = decision.memory, decision.words, decision.wire
        swarm.step(decision.commands)
    return memory


def begin_pair() -> Memory:
    """Return a seed, and a robot that it has accepted."""
    memory = Memory.begin(2).start(np.array([0]), Mode.RECRUIT, role=0, leader=0, roles=1)
    memory = memory.start(np.array([1]), Mode.LOCATE_BEACON, unseen=0.0, silent=0.0)
    return memory._replace(ticket=make_ticket(np.array([1, 0]), np.array([1, NOBODY])))


@pytest.mark.parametrize(("x", "y", "heading"), [(-2.8, 0.0, 0.0), (-2.7, 0.2, -0.4), (-2.7, -0.2, 2.0)])
def test_an_accepted_robot_docks_behind_the_seed(x: float, y: float, heading: float) -> None:
    swarm = ToySwarm(np.array([[-2.0, 0.0, 0.0], [x, y, heading]]))
    memory = run(swarm, Machine(make_plan(snake(2)), 2), begin_pair(), 60.0)
    assert swarm.links == (Docking(1, "front", 0, "back"),)
    np.testing.assert_array_equal(memory.mode, [Mode.IN_ORGANISM] * 2)
    np.testing.assert_array_equal(memory.role, [0, 1])
    np.testing.assert_array_equal(memory.leader, [0, 0])
    np.testing.assert_array_equal(memory.roles, [3, 3])


def test_the_robot_that_meets_the_pit_drives_back_to_the_floor_and_recruits() -> None:
    swarm = ToySwarm(np.array([[-0.6, 0.2, 0.1], [-3.0, -0.5, 1.0]]))
    machine, memory = Machine(make_plan(snake(2)), 2), Memory.begin(2)
    modes, rng = [], np.random.default_rng(0)
    while swarm.time < 60.0 and memory.mode[0] != Mode.RECRUIT:
        decision = machine.decide(swarm.read(), memory, rng)
        memory, swarm.words, swarm.wire = decision.memory, decision.words, decision.wire
        swarm.step(decision.commands)
        modes.append(int(memory.mode[0]))
    assert list(dict.fromkeys(modes)) == [Mode.EXPLORE, Mode.RETREAT, Mode.RECRUIT]
    x, _, heading = swarm.pose[0]
    assert Course().ramp_feet[0] - 0.35 < x < Course().ramp_feet[0] - 0.05
    assert abs(np.sin(heading)) < 0.05  # straight, as the ramp is


@pytest.mark.slow
def test_scattered_robots_become_a_snake_of_eight() -> None:
    """Of four starts at least two: where they meet depends on the last digits of a processor."""
    whole = 0
    for seed in range(4):
        swarm = ToySwarm(scatter(8, Course(), seed), noise=0.03, seed=seed)
        machine = Machine(make_plan(snake(8)), 8)
        memory = run(swarm, machine, Memory.begin(8), 1500.0, seed)
        if machine.is_complete(memory):
            assert sorted(memory.role.tolist()) == list(range(8))
            assert len(swarm.links) == 7
            whole += 1
    assert whole >= 2


def test_told_to_part_robots_undock_and_go_on_one_after_the_other() -> None:
    swarm = ToySwarm(np.array([[-2.4, 0.0, 0.0], [-2.8, 0.0, 0.0]]))
    machine = Machine(make_plan(snake(2)), 2)
    memory = run(swarm, machine, begin_pair(), 60.0)
    before = swarm.pose[:, 0].copy()
    memory, rng = memory._replace(goes=np.array([PART, 0])), np.random.default_rng(0)
    for _ in range(300):
        decision = machine.decide(swarm.read(), memory, rng)
        memory, swarm.words, swarm.wire = decision.memory, decision.words, decision.wire
        swarm.step(decision.commands)
    assert swarm.links == ()
    np.testing.assert_array_equal(memory.mode, [Mode.REST] * 2)
    assert (swarm.pose[:, 0] > before + 0.1).all()


def test_a_swarm_that_may_not_dock_only_explores() -> None:
    swarm = ToySwarm(scatter(3, Course(), 0))
    memory = run(swarm, Machine(make_plan(snake(3)), 3, docks=False), Memory.begin(3), 100.0)
    np.testing.assert_array_equal(memory.mode, [Mode.EXPLORE] * 3)
    assert swarm.links == ()


def test_equal_seeds_give_equal_bits() -> None:
    ends = []
    for _ in range(2):
        swarm = ToySwarm(scatter(3, Course(), 4), noise=0.03, seed=4)
        memory = run(swarm, Machine(make_plan(snake(3)), 3), Memory.begin(3), 40.0, 4)
        ends.append((swarm.pose, *memory))
    for one, other in zip(*ends, strict=True):
        np.testing.assert_array_equal(one, other)


def test_plans_know_who_docks_where() -> None:
    plan = make_plan(snake(3))
    np.testing.assert_array_equal(plan.wanted, [[-1, 1, -1, -1], [-1, 2, -1, -1], [-1] * 4])
    assert plan.everyone == 0b111
    assert make_plan(cross(1)).wanted[0].tolist() == [1, 2, 3, 4]
    with pytest.raises(OrganismError, match="dock with their front docks"):
        make_plan(Organism(2, (Docking(0, "back", 1, "back"),)))


def test_tickets_name_whom_an_organism_accepts() -> None:
    version, robot = read_ticket(make_ticket(np.array([3, 4]), np.array([7, NOBODY])))
    assert version.tolist() == [3, 4]
    assert robot.tolist() == [7, NOBODY]
