"""Beacons, messages and wires: known readings, what is in the way, collisions, and what is refused."""

import numpy as np
import pytest
from swarm_cases import FLOOR, make_floor, make_sheet, make_world

from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.swarm import signals
from symbrion_gym._src.swarm.docks import SCOUT, compute_dock_frames
from symbrion_gym._src.swarm.signals import (
    AMBIENT,
    FALLOFF,
    GAIN,
    NO_MESSAGE,
    SATURATION,
    Receptions,
    Signals,
    compute_light,
    compute_readings,
    find_units,
    pass_on,
)
from symbrion_gym._src.swarm.world import BACK, FRONT, SwarmCommands


def exchange(poses, beacons=(), messages=(), arena=FLOOR) -> Receptions:
    """Return what robots receive as docks shine and send: (robot, side) and (robot, side, content)."""
    shining, content = np.zeros((len(poses), 4), bool), np.full((len(poses), 4), NO_MESSAGE)
    for robot, side in beacons:
        shining[robot, side] = True
    for robot, side, number in messages:
        content[robot, side] = number
    return Signals(make_world(poses, arena), 0.0).exchange(shining, content)


def test_a_unit_at_one_meter_reads_the_gain():
    x, back = np.array([1.0, 0.0, 0.0]), np.array([-1.0, 0.0, 0.0])
    assert compute_readings(np.zeros(3), x, x, back) == pytest.approx(GAIN)
    assert compute_readings(np.zeros(3), x, 2 * x, back) == pytest.approx(GAIN * 2**-FALLOFF)
    assert compute_readings(np.zeros(3), back, x, back) == 0.0
    assert compute_readings(np.zeros(3), x, x, x) == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("angle", [0.0, 0.3, 0.45, 0.8, 1.3])
def test_light_reaches_as_far_as_it_is_read(angle):
    """A robot that looks at a beacon reads it wherever its units would, near the axis of the light and to its sides."""
    seen, wanted = [], []
    for distance in np.linspace(0.3, 2.9, 27):
        place = (distance * np.cos(angle) - 1.9, distance * np.sin(angle) - 1.0, angle + np.pi)
        world = make_world([(-1.9, -1.0, 0.0), place])
        shining = np.array([[True, False, False, False], [False] * 4])
        light = compute_light(world.state, shining, world.sight, world.scout)
        start, axis, _ = (part[0, FRONT] for part in compute_dock_frames(world.state))
        units, axes = (part[1, :2] for part in find_units(world.state, world.scout))
        seen.append(bool((light.side == FRONT).any()))
        wanted.append(bool((compute_readings(start, axis, units, axes) > 0.5).any()))
    assert any(wanted)
    assert not all(wanted) or angle < 0.4
    assert seen == wanted


@pytest.mark.parametrize(
    ("x", "y", "measured"),
    [(0.0, 0.20, 97.7), (0.0, 0.45, 27.9), (0.0, 1.0, 6.2), (0.09, 0.45, 8.3), (0.22, 0.45, 2.5)],
)
def test_readings_are_those_of_a_real_scouts_beacon(x, y, measured):
    """Means of symbrion-morph's data_set10 and data_set11 within 1 cm; both robots look along parallel lines."""
    ahead = np.array([0.0, 1.0, 0.0])
    reading = AMBIENT + compute_readings(np.zeros(3), ahead, np.array([x, y, 0.0]), -ahead)
    assert reading == pytest.approx(measured, rel=0.2)


def test_the_side_that_looks_at_a_beacon_reads_it_and_its_nearer_unit_more():
    beacon = exchange([[0.0, 0.0, 0.0], [0.6, 0.1, np.pi]], [(0, FRONT)]).beacon
    left, right = beacon[1, :2]
    assert left > right > 2.0  # left of a robot that looks back is nearer to the beacon's axis
    np.testing.assert_array_equal([*beacon[1, 2:4], *beacon[0]], AMBIENT)


def test_a_third_robot_and_a_wall_are_in_the_way():
    free = [[0.0, 0.0, 0.0], [0.8, 0.0, np.pi]]
    for robot in (0, 1):
        assert exchange([*free, [0.4, 0.5, 0.0]], [(robot, FRONT)]).beacon[1 - robot, 0] > 5.0
    assert exchange([*free, [0.4, 0.0, 0.0]], [(0, FRONT)]).beacon[1, 0] == AMBIENT
    assert exchange(free, [(0, FRONT)], arena=make_floor(make_sheet(0.4))).beacon[1, 0] == AMBIENT


def test_beacons_add_up_and_readings_saturate(monkeypatch):
    poses = [[0.0, 0.0, 0.0], [0.3, 0.0, np.pi / 2], [0.3, -0.3, np.pi / 2]]
    both = exchange(poses, [(0, FRONT), (2, FRONT)]).beacon[1]
    alone = [exchange(poses, [each]).beacon[1] for each in ((0, FRONT), (2, FRONT))]
    np.testing.assert_allclose(both - AMBIENT, sum(alone) - 2 * AMBIENT)
    monkeypatch.setattr(signals, "GAIN", 1e4)
    assert exchange(poses, [(0, FRONT)]).beacon.max() == SATURATION


def test_messages_arrive_at_the_side_that_looks_at_them():
    received = exchange([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]], messages=[(0, FRONT, 42)])
    assert received.message[1].tolist() == [NO_MESSAGE, 42, NO_MESSAGE, NO_MESSAGE]
    assert (received.message[0] == NO_MESSAGE).all()
    assert (received.beacon == AMBIENT).all()


def test_messages_of_equal_strength_collide_and_a_much_stronger_one_is_read():
    messages, receiver = [(0, FRONT, 1), (1, FRONT, 2)], [0.3, 0.0, np.pi]
    equal = exchange([[-0.3, 0.2, 0.0], [-0.3, -0.2, 0.0], receiver], messages=messages)
    assert equal.message[2, FRONT] == NO_MESSAGE
    strong = exchange([[0.0, 0.0, 0.0], [-0.6, -0.3, 0.0], receiver], messages=messages)
    assert strong.message[2, FRONT] == 1


def test_a_message_is_read_from_one_and_a_half_counts_on():
    read = []
    for distance in np.linspace(1.0, 3.8, 15):
        poses = [[-distance / 2, 0.0, 0.0], [distance / 2, 0.0, np.pi]]
        received = exchange(poses, [(0, FRONT)], [(0, FRONT, 5)])
        light = received.beacon[1].reshape(4, 2)[FRONT].sum() - 2 * AMBIENT
        read.append(received.message[1, FRONT] == 5)
        assert read[-1] == (light >= 1.5), (distance, light)
    assert read[0]
    assert not read[-1]


def test_wires_carry_messages_between_docked_modules_only():
    sent = np.arange(8).reshape(2, 4)
    received = pass_on(sent, (Docking(0, "back", 1, "front"),))
    assert received[0, BACK] == sent[1, FRONT]
    assert received[1, FRONT] == sent[0, BACK]
    assert (received == NO_MESSAGE).sum() == 6


def test_a_latched_dock_sends_no_light():
    world = make_world([[0.0, 0.0, 0.0], [-SCOUT.pitch, 0.0, 0.0], [-0.6, 0.0, 0.0]])
    world.step(SwarmCommands(np.zeros((3, 2)), np.zeros(3), np.ones((3, 4), bool)))
    assert len(world.state.links) == 1
    content = np.full((3, 4), NO_MESSAGE)
    content[1, [FRONT, BACK]] = 5, 6
    received = Signals(world, 0.0).exchange(content >= 0, content)
    assert received.message[2, FRONT] == 6
    assert (received.message[0] == NO_MESSAGE).all()
    assert received.wired[0, BACK] == 5


def test_noise_and_losses_come_from_the_seed():
    world = make_world([[0.0, 0.0, 0.0], [0.5, 0.0, np.pi]])
    content = np.full((2, 4), NO_MESSAGE)
    content[0, FRONT] = 3

    def receive(seed):
        carrier = Signals(world, 20.0, seed)  # loses 40 % of the messages
        return [carrier.exchange(content >= 0, content) for _ in range(40)]

    first, again, other = receive(1), receive(1), receive(2)
    for name in ("beacon", "message"):
        np.testing.assert_array_equal(*([getattr(each, name) for each in run] for run in (first, again)))
    assert any((a.beacon != b.beacon).any() for a, b in zip(first, other, strict=True))
    assert 6 < sum(each.message[1, FRONT] == NO_MESSAGE for each in first) < 30
