"""The engine of a vector environment is chosen by name; without the extra, one line says what is missing."""

import pytest

import reconstruction._src.base.extras
from reconstruction._src.base.extras import MissingExtraError
from symbrion_gym._src.environment.making import make_vector_env
from symbrion_gym._src.errors import OptionError


def test_one_line_names_the_command_where_the_extra_is_missing(monkeypatch):
    monkeypatch.setattr(reconstruction._src.base.extras, "find_spec", lambda name: None)
    for array in ("numpy", "jax"):
        with pytest.raises(MissingExtraError, match=r"^backend 'warp' .*pip install 'symbrion-gym\[gpu\]'$"):
            make_vector_env(2, backend="warp", array=array, modules=2)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"backend": "mjx"}, OptionError, r"mjx.*mujoco, warp"),
        ({"array": "cupy"}, OptionError, "array"),
        ({"backend": "mujoco", "array": "jax"}, OptionError, "array='jax' needs backend='warp'"),
        ({"num_threads": 2}, OptionError, "num_threads is 2, but backend 'warp' has a device"),
        ({"arenas": ["truth"], "array": "jax"}, OptionError, "holds one arena; give arena in place"),
        ({"backend": "mujoco", "arenas": []}, OptionError, "one or more arenas"),
        ({"backend": "mujoco", "arenas": "truth"}, OptionError, "one or more arenas, got 'truth'"),
        (
            {"backend": "mujoco", "arenas": ["truth"] * 3},
            OptionError,
            "num_envs is 2, but there are 3 arenas",
        ),
        (
            {"backend": "mujoco", "arenas": ["truth"], "arena": "gsrm"},
            OptionError,
            "'arena' and 'arenas' both",
        ),
    ],
)
def test_what_does_not_go_together_is_refused_by_name(options, error, message):
    with pytest.raises(error, match=message):
        make_vector_env(2, **({"backend": "warp", "modules": 2} | options))
