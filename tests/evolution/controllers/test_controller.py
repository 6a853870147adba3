"""Laws known by hand; batched and alone they agree to the bit."""

import numpy as np
import pytest

from evolution._src.controllers.controller import (
    CONTACT_TIMEOUT,
    CONTROLLERS,
    HINGE_RANGE,
    KNOTS,
    MAX_AIRBORNE_TICKS,
    make_controller,
)
from evolution._src.controllers.laws import REACTIVE_GENES
from evolution._src.errors import RunError

MODULES = 6
STRUCTURE = {
    "hinge_angle": slice(0, 5),
    "pitch": slice(5, 11),
    "contact": slice(11, 17),
    "track_odometry": slice(17, 18),
}
SIZE = 18


def act(name: str, genotype, observation=None, *, ticks: int = 1) -> np.ndarray:
    """Return hinge targets [rad] after so many equal observations."""
    controller = make_controller(name, MODULES)
    observation = np.zeros((1, SIZE)) if observation is None else observation
    state = controller.begin(len(observation))
    action = np.zeros(0)
    for _ in range(ticks):
        action, state = controller.act(observation, np.asarray(genotype, float), STRUCTURE, state)
    return action * HINGE_RANGE


def make_reactive(**genes: float) -> np.ndarray:
    return np.array([genes.get(name, 0.0) for name in REACTIVE_GENES])


def test_reactive_biases():
    target = act("reactive", make_reactive(bias=0.1, head_bias=0.2, tail_bias=-0.3))[0]
    assert target == pytest.approx([0.3, 0.1, 0.1, 0.1, -0.2])


def test_reactive_follows_the_pitch_ahead_and_behind():
    observation = np.zeros((1, SIZE))
    observation[0, STRUCTURE["pitch"]] = [0.6, 0.1, 0.2, 0.3, 0.4, 0.5]
    assert act("reactive", make_reactive(pitch_ahead=1.0), observation)[0] == pytest.approx(
        [0.6, 0.1, 0.2, 0.3, 0.4]
    )
    assert act("reactive", make_reactive(pitch_behind=-1.0), observation)[0] == pytest.approx(
        [-0.1, -0.2, -0.3, -0.4, -0.5]
    )
    assert act("reactive", make_reactive(head_pitch=0.5), observation)[0] == pytest.approx([0.3, 0, 0, 0, 0])


def test_reactive_lifts_the_ends_that_hang_in_the_air_for_a_while():
    observation = np.zeros((1, SIZE))
    observation[0, STRUCTURE["contact"]] = [0, 0, 5, 0, 9, 0]
    genes = make_reactive(front_air=0.8, rear_air=-0.4)
    assert not act("reactive", genes, observation, ticks=CONTACT_TIMEOUT).any()
    assert act("reactive", genes, observation, ticks=CONTACT_TIMEOUT + 1)[0] == pytest.approx(
        [0.8, 0.8, 0, 0, -0.4]
    )
    assert not act("reactive", genes, observation, ticks=MAX_AIRBORNE_TICKS + 1).any()


def place_head(odometry: float) -> np.ndarray:
    """An observation that tells nothing but where the tracks have brought the head [m]."""
    observation = np.zeros((1, SIZE))
    observation[0, STRUCTURE["track_odometry"]] = odometry
    return observation


def test_path_gives_each_module_the_slope_of_its_place():
    slopes = np.sin(np.arange(12))
    head = 0.52
    places = head - 0.1254 * np.arange(MODULES)
    wanted = np.interp(places, KNOTS, slopes, left=0.0, right=0.0)
    target = act("path", slopes, place_head(head))[0]
    assert target == pytest.approx(wanted[:-1] - wanted[1:])
    assert not act("path", np.ones(12), place_head(-5.0)).any()


def test_no_law_of_a_snake_reads_what_a_robot_cannot_sense():
    for name in CONTROLLERS:
        assert set(make_controller(name, MODULES).sensors) <= STRUCTURE.keys()


def test_refusals():
    with pytest.raises(RunError, match="there are: path, reactive, posture"):
        make_controller("psychic", 8)
    with pytest.raises(RunError, match="nothing to control"):
        make_controller("reactive", 1)
