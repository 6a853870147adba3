"""The engine of a vector environment is chosen by name; without the extra, one line says what is missing."""

import pytest

import reconstruction._src.base.extras
from reconstruction._src.base.extras import MissingExtraError
from symbrion_gym._src.environment.making import make_vector_env
from symbrion_gym._src.environment.randomization import LayoutError
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
        ({"timers": True}, OptionError, "backend 'warp' has no timers"),
        ({"stretches": (0.9, 1.0)}, LayoutError, "holds one arena, and there are stretches"),
    ],
)
def test_what_does_not_go_together_is_refused_by_name(options, error, message):
    with pytest.raises(error, match=message):
        make_vector_env(2, **({"backend": "warp", "modules": 2} | options))
