"""The engine of a vector environment is chosen by name; without the extra, one line says what is missing."""

import gymnasium as gym
import pytest

import reconstruction._src.base.extras
from reconstruction._src.base.extras import MissingExtraError
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv, make_vector_env
from symbrion_gym._src.environment.randomization import LayoutError
from symbrion_gym._src.errors import OptionError

ID = "symbrion_gym/SnakePit-v1"


def make(**options):
    return gym.make_vec(ID, num_envs=2, vectorization_mode="vector_entry_point", modules=2, **options)


def test_without_a_backend_the_c_engine_steps():
    for options in ({}, {"backend": "mujoco"}):
        envs = make(**options)
        assert type(envs.unwrapped) is OrganismVectorEnv
        envs.close()


def test_an_unknown_backend_is_refused():
    with pytest.raises(OptionError, match=r"mjx.*mujoco, warp"):
        make(backend="mjx")


def test_one_line_names_the_command_where_the_extra_is_missing(monkeypatch):
    monkeypatch.setattr(reconstruction._src.base.extras, "find_spec", lambda name: None)
    with pytest.raises(
        MissingExtraError, match=r"^backend 'warp' .*pip install 'symbrion-gym\[gpu\]'$"
    ) as found:
        make(backend="warp", device="cpu")
    assert "\n" not in str(found.value)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"num_threads": 2}, OptionError, "num_threads is 2, but backend 'warp' has a device"),
        ({"timers": True}, OptionError, "backend 'warp' has no timers"),
        ({"stretches": (0.9, 1.0)}, LayoutError, "holds one arena, and there are stretches"),
    ],
)
def test_what_the_device_lacks_is_refused_by_name(options, error, message):
    with pytest.raises(error, match=message):
        make_vector_env(2, backend="warp", modules=2, **options)
