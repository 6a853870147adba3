"""Track speeds of bodies that go ahead and turn."""

import numpy as np
import pytest

from evolution._src.controllers.joints import compute_bearing, make_drive
from evolution._src.errors import RunError
from symbrion_gym._src.environment.config import count_tracks
from symbrion_gym._src.robot.organism import cross, letter_h, snake

GOAL = {"goal_direction": slice(0, 2)}


def act(drive, *genes: float, bearing: float = 0.0) -> np.ndarray:
    return drive.act(np.array([genes]), np.array([[bearing, 1.0]]), GOAL)[0]


def test_without_track_actions_there_is_nothing_to_drive():
    drive = make_drive(snake(3), 0, 1.5)
    assert (drive.genes, drive.sensors) == ({}, ())
    assert drive.act(np.zeros((4, 0)), np.zeros((4, 2)), GOAL).shape == (4, 0)


def test_zero_genes_drive_ahead_at_full_speed():
    assert act(make_drive(snake(3), 1, 1.5), 0.0).tolist() == [1.0]
    assert act(make_drive(snake(3), 3, 1.5), -0.5).tolist() == [0.5] * 3
    assert act(make_drive(snake(3), 6, 1.5), 0.0, 0.0).tolist() == [1.0] * 6
    assert act(make_drive(snake(3), 6, 1.5), 1.0, 0.0).tolist() == [1.0] * 6
    assert act(make_drive(snake(3), 6, 1.5), -2.0, 0.0).tolist() == [-1.0] * 6


def test_a_cross_drives_ahead_though_its_arms_look_at_the_middle():
    assert act(make_drive(cross(1), 5, 1.5), 0.0, 0.0).tolist() == [1.0, 1.0, 1.0, 0.0, 0.0]


def test_a_single_scout_turns_on_the_spot_and_toward_the_goal():
    drive = make_drive(snake(1), 2, 1.5)
    assert tuple(drive.genes) == ("track_speed_change", "track_steering")
    assert act(drive, -1.0, 1.0, bearing=3.0) == pytest.approx([-1.0, 1.0])
    assert act(drive, 0.0, 1.0, bearing=0.2) == pytest.approx([0.6, 1.0])
    assert act(drive, 0.0, 1.0, bearing=-0.2) == pytest.approx([1.0, 0.6])
    assert act(drive, 0.0, 1.0, bearing=3.0) == pytest.approx([-1.0, 1.0])
    assert act(drive, 0.0, 0.0, bearing=3.0) == pytest.approx([1.0, 1.0])


def test_turning_is_a_rigid_rotation_about_the_middle():
    legs = act(make_drive(letter_h(3), 7, 1.5), -1.0, 1.0, bearing=3.0)
    assert legs[:3] == pytest.approx([0.0, 0.0, 0.0])
    assert np.abs(legs[3:]) == pytest.approx([1.0] * 4)
    assert legs[3] * legs[4] < 0 < legs[3] * legs[6]


def test_arms_that_look_at_the_middle_cannot_turn_a_cross():
    """The middle of a cross lies 4 mm before its middle module, which is no lever to speak of."""
    assert not make_drive(cross(1), 5, 1.5).can_turn
    skid = act(make_drive(cross(1), 10, 1.5), -1.0, 1.0, bearing=3.0)
    assert (skid[0::2] < 0).all()
    assert (skid[1::2] > 0).all()


def test_one_track_speed_each_cannot_turn_a_snake():
    assert not make_drive(snake(4), 4, 1.5).can_turn
    assert make_drive(snake(4), 8, 1.5).can_turn


def test_a_goal_that_is_not_observed_is_straight_ahead():
    assert compute_bearing(np.ones((3, 4)), {"pitch": slice(0, 4)}).tolist() == [[0.0]] * 3
    assert compute_bearing(np.array([[9.0, 0.5, 2.0]]), {"goal_direction": slice(1, 3)}).tolist() == [[0.5]]


def test_numbers_of_tracks():
    assert [count_tracks(control, 5) for control in ("constant", "body", "modules", "skid")] == [0, 1, 5, 10]
    with pytest.raises(RunError, match="has 0, 1, 3 or 6"):
        make_drive(snake(3), 4, 1.5)
