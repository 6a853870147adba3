"""The behaviors of a swarm on level ground and before a pit, without errors: docking, waiting, recovering, parting."""

import numpy as np
import pytest
from swarm_cases import FLOOR, make_world

import symbrion_gym as sg
from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.organism import Docking, Organism, cross, snake
from symbrion_gym._src.swarm.behavior import sensing
from symbrion_gym._src.swarm.behavior.machine import SILENCE, BehavingSwarm, Machine, carry, locate, recall
from symbrion_gym._src.swarm.behavior.memory import (
    NOBODY,
    PART,
    Heard,
    Memory,
    Mode,
    make_plan,
    make_ticket,
    read_ticket,
)
from symbrion_gym._src.swarm.behavior.states import APART, HALF_GAUGE, HEARD_WELL, REACH, SLIP, STALL_TIME
from symbrion_gym._src.swarm.kinematic.kinematic_world import KinematicWorld
from symbrion_gym._src.swarm.placing import find_field, scatter

SEED = [1.0, 0.0, 0.0]
DOCK = np.array([1.0 - 0.0525, 0.0])  # Back dock of the seed


def make_swarm(poses, memory, arena=FLOOR, noise=0.0) -> BehavingSwarm:
    count = len(poses)
    return BehavingSwarm(
        make_world(poses, arena), Machine(make_plan(snake(max(count, 2))), count), noise, 0, memory
    )


def begin(accepted: int, mode: Mode, num_robots: int = 2) -> Memory:
    """Return a seed that has accepted a robot or nobody, and others in a mode."""
    memory = Memory.begin(num_robots).start(np.array([0]), Mode.RECRUIT, role=0, leader=0, roles=1)
    memory = memory.start(np.arange(1, num_robots), mode, unseen=0.0, silent=0.0)
    robots = np.where(np.arange(num_robots) == 0, accepted, NOBODY)
    return memory._replace(ticket=make_ticket(np.ones(num_robots, int), robots))


def run(swarm: BehavingSwarm, duration: float, until=lambda swarm: False) -> BehavingSwarm:
    while swarm.world.time < duration and not until(swarm):
        swarm.step()
    return swarm


def is_whole(swarm: BehavingSwarm) -> bool:
    return swarm.machine.is_complete(swarm.memory)


@pytest.mark.slow
@pytest.mark.parametrize("pose", [(0.65, 0.1, -0.3), (0.6, -0.1, 1.5)])
def test_an_accepted_robot_docks_behind_the_seed_and_both_part_when_told(pose) -> None:
    swarm = run(make_swarm([SEED, pose], begin(1, Mode.LOCATE_BEACON)), 90.0, is_whole)
    assert swarm.world.state.links == (Docking(0, "back", 1, "front"),)
    np.testing.assert_array_equal(swarm.memory.mode, [Mode.IN_ORGANISM] * 2)
    np.testing.assert_array_equal(swarm.memory.role, [0, 1])
    np.testing.assert_array_equal(swarm.memory.leader, [0, 0])
    np.testing.assert_array_equal(swarm.memory.roles, [3, 3])
    before = swarm.world.state.position[:, 0]
    swarm.memory = swarm.memory._replace(goes=np.array([PART, 0]))
    run(swarm, swarm.world.time + 15.0, lambda swarm: (swarm.memory.mode == Mode.REST).all())
    assert swarm.world.state.links == ()
    np.testing.assert_array_equal(swarm.memory.mode, [Mode.REST] * 2)
    assert (swarm.world.state.position[:, 0] > before + 0.1).all()


@pytest.mark.slow
def test_the_robot_that_meets_the_pit_drives_back_to_the_floor_and_recruits() -> None:
    swarm = make_swarm([[-0.6, 0.2, 0.1]], None, sg.load_arena("truth"))
    run(swarm, 90.0, lambda swarm: swarm.memory.mode[0] == Mode.RECRUIT)
    modes = swarm.recorder.read().mode[:, 0].tolist()
    assert list(dict.fromkeys(modes)) == [Mode.EXPLORE, Mode.RETREAT, Mode.RECRUIT]
    foot = sg.Course().ramp_feet[0]
    assert foot - 0.35 < swarm.world.state.position[0, 0] < foot - 0.05
    assert abs(swarm.world.state.rotation[0, 1, 0]) < 0.1  # straight, as the ramp is


@pytest.mark.slow
def test_scattered_robots_become_a_snake() -> None:
    """Of three starts at least one: where they meet depends on the last digits of a processor."""
    arena = sg.load_arena("truth")
    for seed in range(3):
        poses = scatter(find_field(arena), 4, KinematicWorld(arena, 4), np.random.default_rng(seed))
        swarm = run(make_swarm(poses, None, arena, noise=1.0), 1000.0, is_whole)
        if is_whole(swarm):
            break
    assert sorted(swarm.memory.role.tolist()) == [0, 1, 2, 3]
    assert len(swarm.world.state.links) == 3


def test_a_robot_in_the_way_of_an_accepted_one_leaves_it_and_keeps_apart() -> None:
    memory = begin(2, Mode.WAIT, 3).start(np.array([2]), Mode.LOCATE_BEACON, unseen=0.0, silent=0.0)
    swarm = make_swarm([SEED, [0.65, 0.05, 0.0], [0.3, 0.0, 0.0]], memory)
    run(swarm, 90.0, lambda swarm: swarm.world.state.links)
    assert swarm.world.state.links == (Docking(0, "back", 2, "front"),)
    place = swarm.world.state.position[1, :2]
    assert np.hypot(*(place - DOCK)) > APART
    assert abs(place[1]) > 0.2


def test_a_robot_that_waits_faces_the_beacon() -> None:
    swarm = make_swarm([SEED, [0.2, 0.75, 0.8]], begin(5, Mode.WAIT))
    for _ in range(50):
        swarm.memory = swarm.memory._replace(unanswered=np.zeros(2))
        swarm.step()
    place, rotation = swarm.world.state.position[1], swarm.world.state.rotation[1]
    way = DOCK - place[:2]
    assert rotation[:2, 0] @ way / np.linalg.norm(way) > 0.99
    np.testing.assert_allclose(place[:2], [0.2, 0.75], atol=0.02)


@pytest.mark.slow
def test_a_robot_that_asks_in_vain_draws_nearer(monkeypatch: pytest.MonkeyPatch) -> None:
    def hear(*values, collides=False, heard=sensing.hear):
        return Heard.make_nothing(2) if collides else heard(*values)

    monkeypatch.setattr(sensing, "hear", hear)
    swarm = run(make_swarm([SEED, [0.2, 0.1, 0.0]], begin(NOBODY, Mode.WAIT)), 25.0)
    assert read_ticket(swarm.memory.ticket)[1][0] == NOBODY
    assert abs(DOCK[0] - swarm.world.state.position[1, 0] - REACH - HEARD_WELL) < 0.05


def test_an_organism_forgets_a_robot_that_it_no_longer_hears() -> None:
    swarm = make_swarm([SEED, [-0.3, 0.1, 0.0]], begin(7, Mode.WAIT))
    run(swarm, SILENCE - 1.0)
    assert read_ticket(swarm.memory.ticket)[1][0] == 7
    run(swarm, SILENCE + 10.0, lambda swarm: read_ticket(swarm.memory.ticket)[1][0] == 1)
    assert read_ticket(swarm.memory.ticket)[1][0] == 1  # the one that waits has asked


def test_a_robot_that_comes_no_nearer_backs_off_turning() -> None:
    swarm = make_swarm([SEED, [0.2, 0.0, 0.0]], begin(1, Mode.LOCATE_BEACON))
    start = swarm.world.state
    while swarm.memory.mode[1] == Mode.LOCATE_BEACON and swarm.world.time < 30.0:
        swarm.step()
        held = start._replace(odometry=swarm.world.state.odometry)
        swarm.world.set_state(held, swarm.world.time)
    assert swarm.memory.mode[1] == Mode.RECOVER
    assert STALL_TIME < swarm.world.time < STALL_TIME + 2.0
    run(swarm, swarm.world.time + 2.0)
    assert swarm.world.state.position[1, 0] < 0.15
    assert abs(swarm.world.state.rotation[1, 1, 0]) > 0.3


def test_a_remembered_dock_moves_as_the_odometry_says() -> None:
    pose = np.array([[1.0, 0.0, np.pi]])
    np.testing.assert_allclose(carry(pose, np.array([[0.4, 0.4]])), [[0.6, 0.0, np.pi]], atol=1e-12)
    quarter = np.pi / 2 * HALF_GAUGE * SLIP
    turned = carry(pose, np.array([[-quarter, quarter]]))
    np.testing.assert_allclose(turned, [[0.0, -1.0, np.pi / 2]], atol=1e-12)  # what was ahead is to the right


def test_what_is_not_heard_is_recalled_as_it_was_heard() -> None:
    values = {"distance": 0.5, "bearing": 0.3, "departure": -0.2}
    heard = Heard.make_nothing(1)._replace(
        is_heard=np.array([True]), **{name: np.array([value]) for name, value in values.items()}
    )
    pose = locate(heard)
    assert np.hypot(*pose[0, :2]) == pytest.approx(0.5 + REACH)
    recalled = recall(Heard.make_nothing(1), pose)
    for name, value in values.items():
        assert getattr(recalled, name)[0] == pytest.approx(value)
    assert recall(heard, 2 * pose).distance[0] == 0.5  # what is heard goes before


def test_plans_know_who_docks_where() -> None:
    plan = make_plan(snake(3))
    np.testing.assert_array_equal(plan.wanted, [[-1, 1, -1, -1], [-1, 2, -1, -1], [-1] * 4])
    assert plan.everyone == 0b111
    assert make_plan(cross(1)).wanted[1].tolist() == [-1, 2, 3, 4]
    with pytest.raises(OrganismError, match="dock with their front docks"):
        make_plan(Organism(2, (Docking(0, "front", 1, "back"),)))


def test_tickets_name_whom_an_organism_accepts() -> None:
    version, robot = read_ticket(make_ticket(np.array([3, 4]), np.array([7, NOBODY])))
    assert version.tolist() == [3, 4]
    assert robot.tolist() == [7, NOBODY]
