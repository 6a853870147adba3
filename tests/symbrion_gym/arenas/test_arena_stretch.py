"""A stretched arena is longer, and otherwise the same."""

import numpy as np
import pytest

from symbrion_gym.arenas.arena import Arena, load_arena
from symbrion_gym.arenas.course import Course
from symbrion_gym.arenas.stretch import stretch_arena
from symbrion_gym.environment.snake_pit import SnakePitEnv


def test_stretching_the_truth_widens_its_pit() -> None:
    stretched = stretch_arena(load_arena("truth"), 1.05)
    wider = Arena.from_course(Course(pit=0.42, floor=1.68, ramp=1.05, plateau=0.525))
    assert isinstance(stretched.course, Course)
    assert stretched.course.pit == pytest.approx(0.42)
    x = np.linspace(-3.4, 3.4, 200)
    np.testing.assert_allclose(stretched.height(x, 0.1), wider.height(x, 0.1), atol=1e-9)
    assert all(piece.is_convex for piece in stretched.pieces)


def test_no_stretch_is_the_arena_itself() -> None:
    arena = load_arena("gsrm")
    assert stretch_arena(arena, 1.0) is arena


@pytest.mark.parametrize("name", ["truth", "stairs", "gsrm"])
def test_heights_stay(name: str) -> None:
    arena = load_arena(name)
    stretched = stretch_arena(arena, 0.9)
    np.testing.assert_allclose(stretched.surface.bounds[:, 2], arena.surface.bounds[:, 2])
    np.testing.assert_allclose(stretched.surface.bounds[:, 0], 0.9 * arena.surface.bounds[:, 0])


def test_the_environment_refuses_to_stretch_to_nothing() -> None:
    with pytest.raises(ValueError, match="stretch"):
        SnakePitEnv(stretch=0.0)
