"""The option organism, and options that contradict each other."""

import pytest

from symbrion_gym._src.environment.config import EnvironmentConfig
from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.errors import OptionError, OrganismError
from symbrion_gym._src.robot.organism import cross, letter_h, snake
from symbrion_gym._src.robot.scout_constants import ScoutConfig

SLOW = ScoutConfig(hinge_torque=3.0, friction=0.3)


@pytest.mark.slow
def test_the_option_takes_whatever_describes_a_body(tmp_path):
    plan = tmp_path / "body.txt"
    plan.write_text("SBSFSBSF00000000", encoding="utf-8")
    bodies = {3: snake(3), "H": letter_h(), "cross1": cross(1), "SBSF0000": snake(2), str(plan): snake(3)}
    for organism, body in (*bodies.items(), (cross(1), cross(1))):
        assert OrganismEnv(organism=organism).world.organism == body


def test_constants_of_the_modules_reach_a_ready_organism():
    given = {"hinge_torque": 2.0, "track_speed": 0.05, "friction": 0.4}
    for name in ("modules", "organism"):
        env = OrganismEnv(**{name: snake(2)}, **given)
        env.reset(seed=0)
        assert {key: getattr(env.world.organism.scout, key) for key in given} == given
        assert env.model.actuator("hinge_1").forcerange[1] == 2.0
        assert (env.model.geom_friction[env.world.robot_geoms, 0] == 0.4).all()
        assert env.domain.track_speed == 0.05


def test_a_ready_organism_keeps_what_no_option_names():
    env = OrganismEnv(organism=snake(2, SLOW))
    assert env.world.organism.scout == SLOW
    assert env.reset(seed=0)[1]["friction"] == 0.3


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"modules": 8, "organism": "H"}, "'modules' and 'organism'"),
        (
            {"modules": snake(2, SLOW), "hinge_torque": 4.5},
            r"hinge_torque=4\.5 contradicts hinge_torque=3\.0",
        ),
        ({"friction": 1e6}, "friction must be a number from 0.001 to 5"),
        ({"track_speed": 100}, "track_speed must be a number from 0 to 2"),
        ({"hinge_torque": 1e3}, "hinge_torque must be a number from 0.001 to 100"),
        ({"track_control": "skids"}, "skid, constant, body, modules"),
        ({"rewards": ()}, r"'rewards' is a field of `symbrion_gym.Task`; give task=Task\(...\)"),
        ({"width": 0}, "width must be a whole number above 0, got 0"),
    ],
)
def test_options_that_contradict_are_refused_by_name(options, message):
    with pytest.raises(OptionError, match=message):
        OrganismEnv(**options)


def test_the_configuration_refuses_them_too():
    with pytest.raises(OptionError, match="give one of them"):
        EnvironmentConfig(modules=3, organism="H")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"organism": "dragon"}, "no organism 'dragon'"),
        ({"organism": 60}, "60 modules are too many"),
        ({"organism": True}, "got True"),
        ({"modules": "H"}, "names go to organism"),
    ],
)
def test_what_is_no_body_is_refused(options, message):
    with pytest.raises(OrganismError, match=message):
        OrganismEnv(**options)


def test_messages_do_not_list_what_registered_ids_set():
    with pytest.raises(OptionError, match="there is no 'stat'; there are: start, ") as error:
        EnvironmentConfig.from_options({"stat": 1})
    assert "default_" not in str(error.value)
    assert "stuck_progress" in str(error.value)
