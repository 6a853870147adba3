"""Coupled oscillators: lags, amplitudes and frequencies known by hand."""

import numpy as np
import pytest
from bodies import make_structure

from evolution._src.controllers.controller import make_law
from evolution._src.controllers.oscillators import OscillatorController
from symbrion_gym._src.robot.organism import Organism, cross, letter_h, snake
from symbrion_gym._src.robot.scout_constants import ScoutConfig

TICKS_PER_SECOND = 50


def make_oscillators(organism: Organism) -> OscillatorController:
    controller = make_law("oscillators", organism)
    assert isinstance(controller, OscillatorController)
    return controller


def run(organism: Organism, seconds: float, state=None, **genes: float):
    """Return targets [rad], one row a tick, and the last state; the body is level and touches the ground nowhere."""
    controller = make_oscillators(organism)
    structure, size = make_structure(organism)
    assert set(genes) <= set(controller.parameters)
    genotype = np.array([[genes.get(name, 0.0) for name in controller.parameters]])
    state = controller.begin(1) if state is None else state
    targets = []
    for _ in range(round(seconds * TICKS_PER_SECOND)):
        action, state = controller.act(np.zeros((1, size)), genotype, structure, state)
        targets.append(action[0] * organism.scout.hinge_range)
    return np.array(targets), state


def test_zero_genes_keep_the_body_straight():
    targets, _ = run(letter_h(), 3.0)
    assert not targets.any()


def test_a_snake_waves_with_its_amplitude_frequency_and_lag():
    targets, state = run(snake(5), 20.0, amplitude_back=0.4, offset_back=0.1, lag_back=0.7)
    late = targets[-8 * TICKS_PER_SECOND :]
    assert late.max(axis=0) == pytest.approx([0.5] * 4, abs=0.01)
    assert late.min(axis=0) == pytest.approx([-0.3] * 4, abs=0.01)
    assert state.clock - state.phase == pytest.approx(np.array([[0.7, 1.4, 2.1, 2.8]]))
    assert state.clock[0, 0] == pytest.approx(2 * np.pi * 0.25 * 20.0)
    again, _ = run(snake(5), 4.0, state, amplitude_back=0.4, offset_back=0.1, lag_back=0.7)
    assert again[-1] == pytest.approx(late[-1], abs=1e-3)  # a period later


def test_a_frequency_gene_of_one_doubles_the_frequency():
    _, state = run(snake(3), 10.0, log2_frequency=1.0)
    assert state.clock[0, 0] == pytest.approx(2 * np.pi * 0.5 * 10.0)


def test_phases_that_are_disturbed_return_to_their_lags():
    """The clock pulls the first hinge, the rest of the body follows along the tree."""
    _, state = run(letter_h(), 1.0, lag_back=0.5, lag_left=-0.4, lag_right=1.2)
    lags = state.clock - state.phase
    disturbed = state._replace(phase=state.phase + np.linspace(-1.0, 1.0, 6))
    _, state = run(letter_h(), 20.0, disturbed, lag_back=0.5, lag_left=-0.4, lag_right=1.2)
    assert state.clock - state.phase == pytest.approx(lags, abs=1e-3)
    assert lags == pytest.approx(np.array([[0.5, 1.0, -0.4, 1.2, 0.6, 2.2]]))


def test_hinges_follow_those_nearer_to_the_head():
    controller = make_oscillators(cross(1))
    kinds = [name[10:] for name in controller.parameters if name.startswith("amplitude_")]
    assert kinds == ["back", "left", "right"]
    assert controller.parent.tolist() == [0, 0, 0, 0]
    assert make_oscillators(letter_h()).parent.tolist() == [0, 0, 2, 3, 1, 1]


def test_the_side_to_which_the_body_turns_makes_smaller_strokes():
    _, state = run(letter_h(), 10.0, amplitude_left=0.4, amplitude_right=0.4, side_bias=0.5)
    assert state.amplitude[0, 2:] == pytest.approx([0.2, 0.6, 0.2, 0.6], abs=1e-3)
    assert "side_bias" not in make_oscillators(snake(4)).parameters


def test_the_bearing_of_the_goal_steers():
    organism, controller = letter_h(), make_oscillators(letter_h())
    structure, size = make_structure(organism)
    genes = {"amplitude_left": 0.4, "amplitude_right": 0.4, "side_steering": 1.0}
    genotype = np.array([[genes.get(name, 0.0) for name in controller.parameters]])
    observation = np.zeros((1, size))
    observation[0, structure["goal_direction"]] = [-0.5, 2.0]  # to the right
    state = controller.begin(1)
    for _ in range(500):
        _, state = controller.act(observation, genotype, structure, state)
    assert state.amplitude[0, 2:] == pytest.approx([0.6, 0.2, 0.6, 0.2], abs=1e-3)


def test_contact_slows_the_phase_and_inclinations_bend():
    organism, controller = snake(3), make_oscillators(snake(3))
    structure, size = make_structure(organism)
    observation = np.zeros((1, size))
    observation[0, structure["contact"]] = [0.0, 3.0, 0.0]
    genotype = np.array([[float(name == "contact_feedback") for name in controller.parameters]])
    _, state = controller.act(observation, genotype, structure, controller.begin(1))
    free = 2 * np.pi * 0.25 * 0.02
    assert state.phase == pytest.approx(np.array([[free - 0.02, free]]))
    genotype = np.array([[float(name == "pitch_ahead") for name in controller.parameters]])
    observation[0, structure["pitch"]] = [0.3, 0.2, 0.1]
    action, _ = controller.act(observation, genotype, structure, controller.begin(1))
    assert action[0] * np.pi / 2 == pytest.approx([0.3, 0.2])


def test_arms_turn_with_the_phase_of_their_hinges():
    """A row of three: both twists swing by 0.4 around 0.1, a quarter of a period after their hinges."""
    organism = snake(3, ScoutConfig(dofs=2, twist_range=0.8))
    genes = {"twist_amplitude_back": 0.4, "twist_offset_back": 0.1, "twist_lag_back": np.pi / 2}
    targets, state = run(organism, 20.0, lag_back=0.7, **genes)
    twists = targets[:, 2:] * 0.8 / organism.scout.hinge_range
    assert not targets[:, :2].any()
    assert twists[-1] == pytest.approx(0.1 + 0.4 * np.cos(state.phase[0] - np.pi / 2), abs=1e-9)
    assert twists[-500:].max() == pytest.approx(0.5, abs=0.01)
    assert np.abs(twists[0] - 0.1).max() < 0.02  # it begins gently


def test_genes_of_twists_are_there_with_two_degrees_of_freedom_alone():
    one, two = make_oscillators(snake(3)), make_oscillators(snake(3, ScoutConfig(dofs=2)))
    more = set(two.parameters) - set(one.parameters)
    assert more == {"twist_amplitude_back", "twist_offset_back", "twist_lag_back"}
    assert len(two.initial) == len(two.lower) == len(two.parameters)
    assert dict(zip(two.parameters, two.upper, strict=True))["twist_lag_back"] == np.pi
