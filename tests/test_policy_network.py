"""The policy network as a controller: a case by hand, decisions that are held, rows of their own, tracks."""

from itertools import pairwise

import numpy as np
import pytest
from policy_network import HOLD, SENSORS, UNITS, PolicyNetwork

from evolution._src.backends.settings import read_organism
from evolution._src.controllers.finding import find_controller

STRUCTURE = {"hinge_angle": slice(0, 1), "pitch": slice(1, 3), "contact": slice(3, 5)}
NAME = "policy_network:PolicyNetwork"


@pytest.fixture
def network():
    return PolicyNetwork(read_organism(2), num_tracks=4)


def make_genotype(network, **weights):
    """Return weights by layer and place, ``{"w0_3_1": 0.5, "b2_0": 1.0}``; all others are 0."""
    genotype, begin, places = np.zeros(len(network.parameters)), 0, {}
    for layer, (below, above) in enumerate(pairwise(network.sizes)):
        for unit in range(above):
            places |= {f"w{layer}_{unit}_{i}": begin + unit * below + i for i in range(below)}
            places[f"b{layer}_{unit}"] = begin + above * below + unit
        begin += (below + 1) * above
    for name, value in weights.items():
        genotype[places[name]] = value
    return genotype


def test_the_network_has_the_layers_that_its_genes_fill(network):
    assert network.sizes == (5, *UNITS, 3)
    assert len(network.parameters) == 6 * 32 + 33 * 32 + 33 * 3
    assert network.sensors == SENSORS


def test_a_forward_pass_by_hand(network):
    """One path: pitch of the second module -> unit 3 -> unit 7 -> the hinge; a bias slows the tracks."""
    genotype = make_genotype(
        network, w0_3_2=2.0, b0_3=0.1, w1_7_3=1.5, b1_7=-0.2, w2_0_7=0.8, b2_0=0.05, b2_1=-0.25
    )
    observation = np.array([[0.3, 9.0, 0.4, 9.0, 9.0]])
    action, _ = network.act(observation, genotype[None], STRUCTURE, network.begin(1))
    hidden = np.tanh(1.5 * np.tanh(2.0 * 0.4 + 0.1) - 0.2)
    np.testing.assert_allclose(action, [[0.8 * hidden + 0.05, 0.75, 0.75, 0.75, 0.75]], atol=1e-15)


def test_zeros_drive_straight_ahead_and_a_turn_slows_one_side(network):
    observation = np.zeros((1, 5))
    zeros = np.zeros((1, len(network.parameters)))
    action, _ = network.act(observation, zeros, STRUCTURE, network.begin(1))
    assert action.tolist() == [[0.0, 1.0, 1.0, 1.0, 1.0]]
    left = make_genotype(network, b2_2=0.5)[None]
    action, _ = network.act(observation, left, STRUCTURE, network.begin(1))
    assert action[0, 1] < action[0, 2] == 1.0
    np.testing.assert_array_equal(
        network.find_actions(np.array([[5.0, 5.0, 0.0]])), [[1.0, 1.0, 1.0, 1.0, 1.0]]
    )


def test_a_decision_is_held_and_then_made_anew(network):
    genotype = make_genotype(network, w0_0_0=1.0, w1_0_0=1.0, w2_0_0=1.0)[None]
    state, hinges = network.begin(1), []
    for tick in range(2 * HOLD):
        observation = np.full((1, 5), tick / 10.0)
        action, state = network.act(observation, genotype, STRUCTURE, state)
        hinges.append(action[0, 0])
    assert len(set(hinges[:HOLD])) == len(set(hinges[HOLD:])) == 1
    assert hinges[0] == 0.0 < hinges[HOLD]


def test_a_row_does_not_depend_on_others_to_the_bit(network):
    rng = np.random.default_rng(0)
    genotypes = rng.normal(size=(6, len(network.parameters)))
    observation = rng.normal(size=(6, 5))
    together, _ = network.act(observation, genotypes, STRUCTURE, network.begin(6))
    for row in range(6):
        alone, _ = network.act(
            observation[row : row + 1], genotypes[row : row + 1], STRUCTURE, network.begin(1)
        )
        np.testing.assert_array_equal(alone[0], together[row])


def test_it_is_found_by_its_name_for_a_body_with_and_without_driven_tracks():
    driven = find_controller(NAME, read_organism("H"), 14)
    assert driven.name == "policy_network"
    assert len(driven.parameters) == len(PolicyNetwork(read_organism("H"), 14).parameters)
    undriven = PolicyNetwork(read_organism(3))
    assert undriven.sizes[-1] == 2
    observation, zeros = np.zeros((1, 8)), np.zeros((1, len(undriven.parameters)))
    structure = {"hinge_angle": slice(0, 2), "pitch": slice(2, 5), "contact": slice(5, 8)}
    assert undriven.act(observation, zeros, structure, undriven.begin(1))[0].tolist() == [[0.0, 0.0]]
