"""Beacons, messages and wires: known readings, what is in the way, collisions, and what is refused."""

import numpy as np
import pytest
from made_ground import make_floor, make_sheet

from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.organism import Docking
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig
from symbrion_gym._src.swarm.docks import compute_dock_poses
from symbrion_gym._src.swarm.kinematic.kinematic_world import KinematicWorld
from symbrion_gym._src.swarm.kinematic.motion import KinematicConfig
from symbrion_gym._src.swarm.signals.infrared import (
    AMBIENT,
    FALLOFF,
    SATURATION,
    SignalConfig,
    compute_light,
    compute_readings,
    find_units,
)
from symbrion_gym._src.swarm.signals.signals import NO_MESSAGE, Signals, Transmissions, pass_on

EXACT = SignalConfig(noise=0.0, relative_noise=0.0, message_loss=0.0)
FLOOR = make_floor()
FRONT, BACK, LEFT, RIGHT = range(4)


def make_signals(poses, arena=FLOOR, config=EXACT, seed=0):
    world = KinematicWorld(arena, len(poses), config=KinematicConfig(slip=0.0))
    world.reset(np.array(poses, float))
    return Signals(world, config, seed)


def send(count, beacons=(), messages=()):
    sent = Transmissions.make_silent(count)
    for robot, side in beacons:
        sent.beacon[robot, side] = True
    for robot, side, content in messages:
        sent.message[robot, side] = content
    return sent


def test_a_unit_at_one_meter_reads_the_gain():
    x, back = np.array([1.0, 0.0, 0.0]), np.array([-1.0, 0.0, 0.0])
    assert compute_readings(np.zeros(3), x, x, back, EXACT) == pytest.approx(EXACT.gain)
    assert compute_readings(np.zeros(3), x, 2 * x, back, EXACT) == pytest.approx(EXACT.gain * 2**-FALLOFF)
    assert compute_readings(np.zeros(3), back, x, back, EXACT) == 0.0
    assert compute_readings(np.zeros(3), x, x, x, EXACT) == 0.0


@pytest.mark.parametrize("angle", [0.0, 0.3, 0.45, 0.8, 1.3])
def test_light_reaches_as_far_as_it_is_read(angle):
    """A robot that looks at a beacon reads it wherever its units would, near the axis of the light and to its sides."""
    seen, wanted = [], []
    world = KinematicWorld(FLOOR, 2, config=KinematicConfig(slip=0.0))
    for distance in np.linspace(0.3, 2.9, 40):
        place = (distance * np.cos(angle) - 1.9, distance * np.sin(angle) - 1.0, angle + np.pi)
        world.reset(np.array([(-1.9, -1.0, 0.0), place]))
        shining = np.array([[True, False, False, False], [False] * 4])
        light = compute_light(world.state, shining, world.sight, world.scout, EXACT)
        start, axis = (part[0, FRONT] for part in compute_dock_poses(world.state, world.scout))
        units, axes = (part[1, :2] for part in find_units(world.state, world.scout))
        seen.append(bool((light.side == FRONT).any()))
        wanted.append(bool((compute_readings(start, axis, units, axes, EXACT) > 0.5).any()))
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
    reading = AMBIENT + compute_readings(np.zeros(3), ahead, np.array([x, y, 0.0]), -ahead, EXACT)
    assert reading == pytest.approx(measured, rel=0.2)


def test_the_side_that_looks_at_a_beacon_reads_it_and_its_nearer_unit_more():
    received = make_signals([[0.0, 0.0, 0.0], [0.6, 0.1, np.pi]]).exchange(send(2, [(0, FRONT)]))
    front = received.beacon[1, :2]
    assert front.min() > 2.0
    assert front[0] != front[1]
    assert front[0] > front[1]  # left of a robot that looks back is nearer to the beacon's axis
    np.testing.assert_array_equal(received.beacon[1, 2:4], AMBIENT)
    np.testing.assert_array_equal(received.beacon[0], AMBIENT)


def test_a_third_robot_and_a_wall_are_in_the_way():
    free = [[0.0, 0.0, 0.0], [0.8, 0.0, np.pi]]
    sent = send(3, [(0, FRONT)])
    assert make_signals([*free, [0.4, 0.5, 0.0]]).exchange(sent).beacon[1, 0] > 5.0
    assert make_signals([*free, [0.4, 0.0, 0.0]]).exchange(sent).beacon[1, 0] == AMBIENT
    walled = make_signals(free, make_floor(make_sheet(0.4)))
    assert walled.exchange(send(2, [(0, FRONT)])).beacon[1, 0] == AMBIENT


def test_beacons_add_up_and_readings_saturate():
    one = make_signals([[0.0, 0.0, 0.0], [0.3, 0.0, np.pi]]).exchange(send(2, [(0, FRONT)])).beacon[1, :2]
    near = make_signals([[0.0, 0.0, 0.0], [0.15, 0.0, np.pi]], config=SignalConfig(gain=1e4))
    assert near.exchange(send(2, [(0, FRONT)])).beacon.max() == SATURATION
    poses = [[0.0, 0.0, 0.0], [0.3, 0.0, np.pi / 2], [0.3, -0.3, np.pi / 2]]
    signals = make_signals(poses)
    both = signals.exchange(send(3, [(0, FRONT), (2, FRONT)])).beacon[1]
    alone = [signals.exchange(send(3, [each])).beacon[1] for each in ((0, FRONT), (2, FRONT))]
    np.testing.assert_allclose(both - AMBIENT, sum(alone) - 2 * AMBIENT)
    assert (one > 20.0).all()


def test_messages_arrive_at_the_side_that_looks_at_them():
    signals = make_signals([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]])
    received = signals.exchange(send(2, messages=[(0, FRONT, 42)]))
    assert received.message[1].tolist() == [NO_MESSAGE, 42, NO_MESSAGE, NO_MESSAGE]
    assert (received.message[0] == NO_MESSAGE).all()
    assert not received.collided.any()
    assert (received.beacon == AMBIENT).all()


def test_messages_of_equal_strength_collide_and_a_much_stronger_one_is_read():
    equal = make_signals([[-0.3, 0.2, 0.0], [-0.3, -0.2, 0.0], [0.3, 0.0, np.pi]])
    both = equal.exchange(send(3, messages=[(0, FRONT, 1), (1, FRONT, 2)]))
    assert both.collided[2, FRONT]
    assert both.message[2, FRONT] == NO_MESSAGE
    near = make_signals([[0.0, 0.0, 0.0], [-0.6, -0.3, 0.0], [0.3, 0.0, np.pi]])
    strong = near.exchange(send(3, messages=[(0, FRONT, 1), (1, FRONT, 2)]))
    assert strong.message[2, FRONT] == 1
    assert not strong.collided[2, FRONT]


def test_wires_carry_messages_between_docked_modules_only():
    sent = np.arange(8).reshape(2, 4)
    received = pass_on(sent, (Docking(0, "back", 1, "front"),))
    assert received[0, SIDES.index("back")] == sent[1, SIDES.index("front")]
    assert received[1, SIDES.index("front")] == sent[0, SIDES.index("back")]
    assert (received == NO_MESSAGE).sum() == 6


def test_a_latched_dock_sends_no_light():
    pitch = ScoutConfig().pitch
    signals = make_signals([[0.0, 0.0, 0.0], [-pitch, 0.0, 0.0], [-0.6, 0.0, 0.0]])
    world = signals._world
    from symbrion_gym._src.swarm.world import SwarmCommands

    sent = send(3, messages=[(1, FRONT, 5), (1, BACK, 6)])
    world.step(SwarmCommands(np.zeros((3, 2)), np.zeros(3), np.ones((3, 4), bool)))
    assert len(world.state.links) == 1
    received = signals.exchange(sent)
    assert received.message[2, FRONT] == 6
    assert (received.message[0] == NO_MESSAGE).all()


def test_noise_and_losses_come_from_the_seed():
    poses, config = [[0.0, 0.0, 0.0], [0.5, 0.0, np.pi]], SignalConfig(message_loss=0.5)
    sent = send(2, [(0, FRONT)], [(0, FRONT, 3)])

    def receive(seed):
        signals = make_signals(poses, config=config, seed=seed)
        return [signals.exchange(sent) for _ in range(40)]

    first, again, other = receive(1), receive(1), receive(2)
    assert all(
        (a.beacon == b.beacon).all() and (a.message == b.message).all()
        for a, b in zip(first, again, strict=True)
    )
    assert any((a.beacon != b.beacon).any() for a, b in zip(first, other, strict=True))
    lost = sum(each.message[1, FRONT] == NO_MESSAGE for each in first)
    assert 8 < lost < 32


def test_refusals():
    signals = make_signals([[0.0, 0.0, 0.0]])
    with pytest.raises(OptionError, match=r"beacon of 1 robots is \[N, 4\]"):
        signals.exchange(Transmissions.make_silent(2))
    with pytest.raises(OptionError, match="at least 0, or -1"):
        signals.exchange(send(1, messages=[(0, FRONT, -2)]))
    for options in (
        {"gain": 0.0},
        {"noise": -1.0},
        {"message_loss": 2.0},
    ):
        with pytest.raises(OptionError, match=next(iter(options))):
            SignalConfig(**options)


def test_a_message_is_read_from_one_and_a_half_counts_on():
    read = []
    for distance in np.linspace(1.0, 3.8, 15):
        signals = make_signals([[-distance / 2, 0.0, 0.0], [distance / 2, 0.0, np.pi]])
        light = signals.exchange(send(2, [(0, FRONT)])).beacon[1].reshape(4, 2)[FRONT].sum() - 2 * AMBIENT
        message = signals.exchange(send(2, messages=[(0, FRONT, 5)])).message[1, FRONT]
        read.append(message == 5)
        assert read[-1] == (light >= 1.5), (distance, light)
    assert read[0]
    assert not read[-1]
