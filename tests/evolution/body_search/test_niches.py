"""Bodies that compete with those of their number of modules: who learns on, counted by hand."""

import numpy as np
import pytest

from evolution._src.bodies.genome import parse_genome
from evolution._src.body_search.algorithms.genetic import HalvingSearch, NicheSearch
from evolution._src.body_search.config import BodiesConfig
from evolution._src.body_search.learning import LearningConfig, Lesson, Pupil

FITNESS = {"b(b(.))": 9.0, "b(l(.))": 8.0, "l(b(.))": 7.0, "l(.)": 3.0, "b(.)": 2.0, ".": 1.0}


def make_lesson(text, fitness, rung=0):
    return Lesson(Pupil(parse_genome(text)), rung, fitness, 0, 0, 0.0, (), (), (), 1.0)


def ask(kind, share, promoted=()):
    """Return who learns on after all have learned the first rung."""
    config = BodiesConfig(largest=3, children=3, population_size=3, promoted_share=share)
    search = kind(config, LearningConfig(rungs=(1, 2)), np.random.default_rng(0))
    search.tell([make_lesson(text, fitness) for text, fitness in FITNESS.items()])
    search.tell([make_lesson(text, 5.0, rung=1) for text in promoted])
    return [each.pupil.body.text for each in search.ask() if each.rung == 1]


def test_numbers_of_modules_take_turns_the_fittest_of_each_first():
    assert ask(NicheSearch, 0.5) == ["b(b(.))", "l(.)", "."]
    assert ask(NicheSearch, 1.0) == ["b(b(.))", "l(.)", ".", "b(l(.))", "b(.)", "l(b(.))"]
    assert ask(HalvingSearch, 0.5) == ["b(b(.))", "b(l(.))", "l(b(.))"]


@pytest.mark.parametrize(
    ("promoted", "expected"),
    [
        (("b(b(.))",), ["l(.)", "."]),
        (("b(b(.))", "l(.)"), ["."]),
        (("l(.)", "b(.)"), ["b(b(.))"]),  # two of size 2 have learned on: 3 and 1 come first, 3 is fitter
    ],
)
def test_those_that_have_learned_on_count(promoted, expected):
    assert ask(NicheSearch, 0.5, promoted) == expected
