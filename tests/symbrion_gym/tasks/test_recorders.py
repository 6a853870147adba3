"""What recorders keep of an episode, in one simulation and in several."""

import numpy as np
import pytest

from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv
from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.tasks.recorders import Descriptor, Extremes, FinalPose, GroundContacts, Trajectory

ALL = (
    FinalPose(),
    Extremes(),
    Trajectory(every=10, most=4),
    GroundContacts(),
    Descriptor("farthest", lambda state: state.along.max(axis=1)),
)


def test_everything_is_kept_by_hand():
    env = OrganismEnv(modules=2, recorders=ALL)
    env.reset(seed=0)
    places = [env.physics.position[0].copy()]
    for _ in range(65):
        env.step(np.array([0.1]))
        places.append(env.physics.position[0].copy())
    kept = env.read_records()
    np.testing.assert_array_equal(kept["final_position"], places[-1])
    np.testing.assert_array_equal(kept["lowest"], np.min(places, axis=(0, 1)))
    np.testing.assert_array_equal(kept["highest"], np.max(places, axis=(0, 1)))
    assert kept["trajectory_interval"] == pytest.approx(0.4)
    np.testing.assert_array_equal(kept["trajectory"], np.array(places)[[0, 20, 40, 60]])
    np.testing.assert_array_equal(kept["ground_share"], [1.0, 1.0])
    assert kept["farthest"] == places[-1][:, 0].max()
    env.reset(seed=0)
    assert len(env.read_records()["trajectory"]) == 1


def test_simulations_are_recorded_each_for_itself():
    envs = OrganismVectorEnv(3, num_threads=1, modules=2, recorders=ALL, autoreset_mode="Disabled")
    envs.reset(seed=0)
    env = OrganismEnv(modules=2, recorders=ALL)
    env.reset(seed=0)
    actions = np.array([[0.0], [0.3], [-0.3]])
    for _ in range(40):
        envs.step(actions)
        env.step(actions[1])
    for name, value in env.read_records().items():
        np.testing.assert_array_equal(envs.read_records(1)[name], value, err_msg=name)
    assert len(envs.call("read_records")) == 3
    before = envs.read_records(0)["final_position"]
    envs.reset(seed=0, options={"reset_mask": np.array([False, True, False])})
    np.testing.assert_array_equal(envs.read_records(0)["final_position"], before)
    assert len(envs.read_records(1)["trajectory"]) == 1


@pytest.mark.parametrize("make", [lambda: Trajectory(every=0), lambda: Trajectory(most=3)])
def test_numbers_that_cannot_be_are_refused(make):
    with pytest.raises(TaskError):
        make()


def test_what_is_no_recorder_is_refused():
    with pytest.raises(TaskError, match="a recorder has record"):
        OrganismEnv(modules=2, recorders=(3,))
