"""The checks of shapes see what they shall see."""

import importlib
import sys
from pathlib import Path

import jaxtyping
import numpy as np
import pytest
import shape_checks

CODE = '''"""Two functions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Int

if TYPE_CHECKING:
    from nowhere import Thing


def find_lengths(vectors: Float[np.ndarray, "N 3"], scale: str | None = None) -> Float[np.ndarray, "N"]:
    return np.linalg.norm(vectors, axis=1) if scale is None else vectors[0]


def choose(points: Float[np.ndarray, "N 3"], rows: Int[np.ndarray, "M"], thing: Thing | None = None):
    return points[rows]


def plain(points: np.ndarray, count: int) -> np.ndarray:
    return points
'''


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "shape_example.py").write_text(CODE)
    monkeypatch.setattr(shape_checks, "PACKAGES", ("shape_example",))
    monkeypatch.syspath_prepend(tmp_path)
    finder = shape_checks._Finder()
    monkeypatch.setattr(sys, "meta_path", [finder, *sys.meta_path])
    yield importlib.import_module("shape_example")
    sys.modules.pop("shape_example")


def test_right_shapes_pass(module) -> None:
    points = np.ones((4, 3))
    assert module.find_lengths(points).shape == (4,)
    assert module.choose(points, np.array([0, 2])).shape == (2, 3)
    assert module.plain(points, "whatever") is points


def test_a_wrong_shape_of_an_argument_is_seen(module) -> None:
    with pytest.raises(jaxtyping.TypeCheckError, match="vectors"):
        module.find_lengths(np.ones((4, 2)))
    with pytest.raises(jaxtyping.TypeCheckError, match="rows"):
        module.choose(np.ones((4, 3)), np.ones((2, 2), int))


def test_a_wrong_type_of_numbers_is_seen(module) -> None:
    with pytest.raises(jaxtyping.TypeCheckError, match="rows"):
        module.choose(np.ones((4, 3)), np.array([0.0, 1.0]))


def test_a_wrong_shape_of_a_result_is_seen(module) -> None:
    with pytest.raises(jaxtyping.TypeCheckError, match="return"):
        module.find_lengths(np.ones((4, 3)), scale="broken")


def test_the_packages_are_checked() -> None:
    assert any(isinstance(finder, shape_checks._Finder) for finder in sys.meta_path)
