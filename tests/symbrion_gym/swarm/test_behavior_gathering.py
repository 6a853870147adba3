"""How robots that wait or are obstructed behave, and how they remember a beacon that they do not hear."""

import numpy as np
import pytest
from toy_swarm import ToySwarm

from symbrion_gym._src.robot.organism import Docking, snake
from symbrion_gym._src.swarm.behavior.machine import SILENCE, Machine
from symbrion_gym._src.swarm.behavior.memory import (
    REACH,
    Memory,
    Mode,
    carry,
    locate,
    make_plan,
    make_ticket,
    read_ticket,
    recall,
)
from symbrion_gym._src.swarm.behavior.motion import APART, HEARD_WELL
from symbrion_gym._src.swarm.behavior.percepts import NOBODY, Heard, Percepts
from symbrion_gym._src.swarm.behavior.steering import HALF_GAUGE, SLIP, wrap
from symbrion_gym._src.swarm.behavior.transitions import STALL_TIME

SEED = [-2.0, 0.0, 0.0]


def hear_beacon(distance: float, bearing: float, departure: float) -> Heard:
    """Return what one robot hears of a dock."""
    values = {"distance": distance, "bearing": bearing, "departure": departure}
    return Heard.make_nothing(1)._replace(
        is_heard=np.array([True]), **{name: np.array([value]) for name, value in values.items()}
    )


def decide(swarm: ToySwarm, machine: Machine, memory: Memory, percepts: Percepts | None = None) -> Memory:
    """Let a swarm behave for one decision."""
    rng = np.random.default_rng(round(10 * swarm.time))
    decision = machine.decide(percepts or swarm.read(), memory, rng)
    swarm.words, swarm.wire = decision.words, decision.wire
    swarm.step(decision.commands)
    return decision.memory


def begin_waiting(accepted: int, num_robots: int = 2) -> Memory:
    """Return a seed that has accepted a robot or nobody, and others that wait."""
    others = np.arange(1, num_robots)
    memory = Memory.begin(num_robots).start(np.array([0]), Mode.RECRUIT, role=0, leader=0, roles=1)
    memory = memory.start(others, Mode.WAIT, unseen=0.0, silent=0.0)
    robots = np.where(np.arange(num_robots) == 0, accepted, NOBODY)
    return memory._replace(ticket=make_ticket(np.ones(num_robots, int), robots))


def test_a_remembered_dock_moves_as_the_odometry_says() -> None:
    pose = np.array([[1.0, 0.0, np.pi]])
    np.testing.assert_allclose(carry(pose, np.array([[0.4, 0.4]])), [[0.6, 0.0, np.pi]], atol=1e-12)
    quarter = np.pi / 2 * HALF_GAUGE * SLIP
    turned = carry(pose, np.array([[-quarter, quarter]]))
    np.testing.assert_allclose(turned, [[0.0, -1.0, np.pi / 2]], atol=1e-12)  # what was ahead is to the right


def test_what_is_not_heard_is_recalled_as_it_was_heard() -> None:
    heard = hear_beacon(0.5, 0.3, -0.2)
    pose = locate(heard)
    assert np.hypot(*pose[0, :2]) == pytest.approx(0.5 + REACH)
    recalled = recall(Heard.make_nothing(1), pose)
    assert not recalled.is_heard[0]
    for name in ("distance", "bearing", "departure"):
        np.testing.assert_allclose(wrap(getattr(recalled, name)), getattr(heard, name), atol=1e-12)
    other = hear_beacon(0.2, 0.0, 0.0)
    assert recall(other, pose).distance[0] == 0.2  # what is heard goes before


def test_a_robot_in_the_way_of_an_accepted_one_leaves_it_and_keeps_apart() -> None:
    swarm = ToySwarm(np.array([SEED, [-2.35, 0.05, 0.0], [-3.2, 0.0, 0.0]]))
    machine, memory = Machine(make_plan(snake(3)), 3), begin_waiting(2, 3)
    memory = memory.start(np.array([2]), Mode.LOCATE_BEACON, unseen=0.0, silent=0.0)
    while swarm.time < 90.0 and not swarm.links:
        memory = decide(swarm, machine, memory)
    assert swarm.links == (Docking(2, "front", 0, "back"),)
    dock = np.array([-2.0525, 0.0])
    assert np.hypot(*(swarm.pose[1, :2] - dock)) > APART
    assert abs(swarm.pose[1, 1]) > 0.2


def test_a_robot_that_waits_faces_the_beacon() -> None:
    swarm = ToySwarm(np.array([SEED, [-2.8, 0.75, 0.8]]))
    machine, memory = Machine(make_plan(snake(2)), 2), begin_waiting(5)
    for _ in range(50):
        memory = decide(swarm, machine, memory._replace(unanswered=np.zeros(2)))
    way = np.array([-2.0525, 0.0]) - swarm.pose[1, :2]
    assert abs(np.arctan2(way[1], way[0]) - swarm.pose[1, 2]) < 0.15
    np.testing.assert_allclose(swarm.pose[1, :2], [-2.8, 0.75], atol=1e-6)


def test_a_robot_that_asks_in_vain_draws_nearer() -> None:
    swarm = ToySwarm(np.array([SEED, [-3.3, 0.1, 0.0]]))
    machine, memory = Machine(make_plan(snake(2)), 2), begin_waiting(NOBODY)
    for _ in range(400):
        percepts = swarm.read()
        deaf = percepts._replace(asker=Heard.make_nothing(2))
        memory = decide(swarm, machine, memory, deaf)
    assert read_ticket(memory.ticket)[1][0] == NOBODY
    assert abs(-2.0525 - swarm.pose[1, 0] - REACH - HEARD_WELL) < 0.05


def test_an_organism_forgets_a_robot_that_it_no_longer_hears() -> None:
    swarm = ToySwarm(np.array([SEED, [-3.3, 0.1, 0.0]]))
    machine, memory = Machine(make_plan(snake(2)), 2), begin_waiting(7)
    while read_ticket(memory.ticket)[1][0] == 7:
        memory = decide(swarm, machine, memory)
        assert swarm.time < SILENCE + 1.0
    assert swarm.time > SILENCE - 1.0
    while read_ticket(memory.ticket)[1][0] != 1:
        memory = decide(swarm, machine, memory)
        assert swarm.time < SILENCE + 10.0  # the one that waits has asked


def test_a_robot_that_comes_no_nearer_backs_off_turning() -> None:
    swarm = ToySwarm(np.array([SEED, [-2.8, 0.0, 0.0]]))
    machine = Machine(make_plan(snake(2)), 2)
    memory = begin_waiting(1).start(np.array([1]), Mode.LOCATE_BEACON, unseen=0.0, silent=0.0)
    while memory.mode[1] == Mode.LOCATE_BEACON and swarm.time < 30.0:
        memory = decide(swarm, machine, memory)
        swarm.pose[1] = [-2.8, 0.0, 0.0]  # held fast
    assert memory.mode[1] == Mode.RECOVER
    assert STALL_TIME < swarm.time < STALL_TIME + 2.0
    for _ in range(20):
        memory = decide(swarm, machine, memory)
    assert swarm.pose[1, 0] < -2.85
    assert abs(swarm.pose[1, 2]) > 0.5
