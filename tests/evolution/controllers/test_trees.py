"""Every law moves every tree of modules, alone as in a population; what it does on small trees is known by hand."""

import numpy as np
import pytest
from bodies import TREES, act, make_observations, make_reactive, make_structure

from evolution._src.controllers.controller import CONTROLLERS, make_law
from evolution._src.controllers.protocol import Controller
from evolution._src.errors import RunError
from symbrion_gym._src.environment.config import SENSORS
from symbrion_gym._src.robot.organism import Organism, cross, snake
from symbrion_gym._src.robot.scout_constants import ScoutConfig

COUNT = 13
BODIES = [(name, control) for name in TREES for control in ("constant", "skid")] + [("single", "skid")]


def find_body(name: str, control: str) -> tuple[Organism, int]:
    organism = TREES.get(name, snake(1))
    return organism, 2 * organism.num_modules if control == "skid" else 0


@pytest.mark.slow
@pytest.mark.parametrize("law", CONTROLLERS)
def test_a_population_on_any_tree_acts_as_each_alone(law):
    """It reads no more than it names, and what a robot senses; a search can begin at its hint."""
    for name, control in BODIES:
        organism, num_tracks = find_body(name, control)
        controller = make_law(law, organism, num_tracks)
        assert isinstance(controller, Controller)
        assert len(set(controller.parameters)) == len(controller.parameters)
        sizes = {len(each) for each in (controller.lower, controller.upper, controller.initial)}
        assert sizes == {len(controller.parameters)}
        assert np.all(np.less(controller.lower, controller.upper))
        assert np.all(np.abs(controller.initial) <= controller.upper)
        assert set(controller.sensors) <= {*SENSORS, "goal_direction"} - {"odometry", "goal"}
        everything, _ = make_structure(organism)
        structure = {sensor: everything[sensor] for sensor in controller.sensors}
        genotypes = np.random.default_rng(0).uniform(
            controller.lower, controller.upper, (COUNT, len(controller.lower))
        )
        together, alone = controller.begin(COUNT), [controller.begin(1) for _ in range(COUNT)]
        for tick in range(20):
            observation = make_observations(organism, COUNT, tick)
            actions, together = controller.act(observation, genotypes, structure, together)
            assert actions.shape == (COUNT, len(organism.hinges) + num_tracks)
            assert np.abs(actions).max(initial=0.0) <= 1.0
            for row in range(COUNT):
                rows = slice(row, row + 1)
                action, alone[row] = controller.act(observation[rows], genotypes[rows], structure, alone[row])
                assert np.array_equal(action[0], actions[row])


def test_reactive_follows_rolls_where_modules_are_docked_sideways():
    pitch, roll = [0.1, 0.2, 0.3, 0.4, 0.5], [0.0, 0.6, 0.0, 0.0, 0.0]
    ahead = act("reactive", cross(1), make_reactive(pitch_ahead=1.0), pitch=pitch, roll=roll)
    assert ahead == pytest.approx([0.1, 0.2, -0.6, 0.6])
    behind = act("reactive", cross(1), make_reactive(pitch_behind=1.0), pitch=pitch, roll=roll)
    assert behind == pytest.approx([0.2, 0.3, 0.4, 0.5])


def test_reactive_lifts_the_leg_that_hangs_in_the_air():
    genes = make_reactive(front_air=0.8, rear_air=-0.4)
    only_left_leg = act("reactive", cross(1), genes, ticks=20, contact=[5, 5, 5, 0, 5])
    assert only_left_leg == pytest.approx([0, 0, -0.4, 0])
    only_right_touches = act("reactive", cross(1), genes, ticks=20, contact=[0, 0, 0, 0, 5])
    assert only_right_touches == pytest.approx([0.8, -0.4, -0.4, 0.8])


def test_path_bends_a_cross_along_its_middle_line_only():
    slopes = np.zeros(12)
    slopes[5:7] = 0.6
    target = act("path", cross(1), slopes, track_odometry=0.1254)
    front, rear = np.interp([0.1254, -0.1254], np.linspace(-0.55, 0.55, 12), slopes)
    assert target == pytest.approx([front - 0.6, 0.6 - rear, 0.0, 0.0])


def test_no_law_of_a_snake_reads_what_a_robot_cannot_sense():
    for law in CONTROLLERS:
        assert set(make_law(law, snake(6)).sensors) <= {"hinge_angle", "pitch", "contact", "track_odometry"}
    with pytest.raises(RunError, match="there are: path, reactive, posture"):
        make_law("psychic", snake(6))


def test_bodies_without_anything_to_control_are_refused():
    with pytest.raises(RunError, match="nothing to control"):
        make_law("reactive", snake(1))
    assert make_law("path", snake(1), 2).parameters[0] == "track_speed_change"


@pytest.mark.parametrize("law", [law for law in CONTROLLERS if law != "oscillators"])
def test_rotations_of_arms_stay_at_zero(law):
    organism = cross(1, ScoutConfig(dofs=2))
    controller = make_law(law, organism, 10)
    structure, _ = make_structure(cross(1))
    observation = make_observations(cross(1), 2, 0)
    genotype = np.full((2, len(controller.parameters)), 0.3)
    action, _ = controller.act(observation, genotype, structure, controller.begin(2))
    usual = make_law(law, cross(1), 10)
    expected, _ = usual.act(observation, genotype, structure, usual.begin(2))
    assert action.shape == (2, 18)
    assert not action[:, 4:8].any()
    assert np.array_equal(np.delete(action, range(4, 8), axis=1), expected)
