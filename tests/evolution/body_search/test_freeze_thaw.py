"""The search in which the most promising body learns its next rung: which one that is, and what both rules spend."""

import numpy as np
import pytest

from evolution._src.bodies.genome import parse_genome
from evolution._src.body_search.algorithms.freeze_thaw import NICHE_SHARE, FreezeThawSearch
from evolution._src.body_search.config import BodiesConfig
from evolution._src.body_search.learning import LearningConfig, Lesson, Pupil
from evolution._src.body_search.prediction import Prediction, describe_shape
from evolution._src.landscape.making import list_bodies

BODIES = list_bodies(4)
LEARNING = LearningConfig(rungs=(1, 2, 4), is_examined_early=False)


def make_lesson(pupil, fitness, rung):
    return Lesson(pupil, rung, fitness, 0, 1, 0.0, (), (), (fitness,), 1.0)


def make_search(seed=0, **changes):
    values = {"algorithm": "freeze_thaw", "largest": 5, "children": 3, "population_size": 6} | changes
    return FreezeThawSearch(BodiesConfig(**values), LEARNING, np.random.default_rng(seed))


def score_rows(body):
    """Long rows are good."""
    return float(describe_shape(body)[4])


def run(found, score=score_rows, iterations=20):
    """Return the assignments of each iteration."""
    taught = []
    for _ in range(iterations):
        taught.append(found.ask())
        found.tell([make_lesson(each.pupil, score(each.pupil.body), each.rung) for each in taught[-1]])
    return taught


def test_it_finds_the_longest_row_and_is_repeatable():
    taught = run(make_search(0))
    ended = [each.pupil.body.text for asked in taught for each in asked if each.rung == 2]
    assert "b(b(b(b(.))))" in ended
    assert taught == run(make_search(0))
    assert taught != run(make_search(1))


def test_it_finds_an_optimum_that_is_alone_in_a_small_niche():
    """Long rows are good, and best is a body of three modules whose kin and first rungs are bad."""
    alone = parse_genome("b(l(.))").canonical_text

    def find(seed):
        found, ended = make_search(seed), []
        for _ in range(35):
            asked = found.ask()
            ended += [each.pupil.body.canonical_text for each in asked if each.rung == 2]
            found.tell([make_lesson(each.pupil, judge(each), each.rung) for each in asked])
        return alone in ended

    def judge(assignment):
        body, rung = assignment.pupil.body, assignment.rung
        return 9.0 if rung == 2 and body.canonical_text == alone else score_rows(body)

    assert all(find(seed) for seed in range(5))


def test_each_body_learns_its_rungs_in_order_and_once():
    known = {}
    for asked in run(make_search(2)):
        assert 0 < len(asked) <= 6
        for each in asked:
            assert each.rung == known.get(each.pupil.key, -1) + 1
            known[each.pupil.key] = each.rung
    assert set(known.values()) == {0, 1, 2}


def test_both_rules_have_their_shares_of_the_trials():
    found = make_search(4)
    run(found, iterations=30)
    assert found._trials > 100
    largest = max(LEARNING.count_trials(rung) for rung in range(3))
    assert abs(found._niche_trials - NICHE_SHARE * found._trials) <= largest


def test_all_numbers_of_modules_learn_to_the_end():
    """One body is far better than all others, and each number of modules has its share nevertheless."""

    def score(body):
        return 10.0 + score_rows(body) if body.num_modules == 5 else 0.0

    ended = [
        each.pupil.body.num_modules
        for asked in run(make_search(5), score, 60)
        for each in asked
        if each.rung == 2
    ]
    assert set(ended) == {1, 2, 3, 4, 5}


def test_a_space_that_is_searched_out_goes_on_with_what_is_known():
    found = make_search(largest=2, population_size=4)
    taught = run(found, iterations=8)
    assert all(taught)
    assert {each.rung for asked in taught for each in asked} == {0, 1, 2}


def test_what_is_expected_leaves_the_mean_and_narrows_the_deviation_of_kin():
    lessons = [make_lesson(Pupil(body), score_rows(body), 1) for body in BODIES[:12]]
    asked = [parse_genome("b(b(b(.)))"), parse_genome("b(b(l(.)))"), BODIES[20]]
    prediction = Prediction(lessons, 1)
    mean, spread = prediction.predict(asked)
    prediction.expect(asked[0], 1)
    after, narrowed = prediction.predict(asked)
    assert after == pytest.approx(mean)
    assert (narrowed <= spread + 1e-12).all()
    assert narrowed[0] < 0.8 * spread[0]
    assert narrowed[1] < spread[1]


def test_what_is_expected_is_what_learning_as_predicted_would_tell():
    """The same as solving all lessons at once, the expected one among them, at equal parameters."""
    lessons = [make_lesson(Pupil(body), score_rows(body), 1) for body in BODIES[:12]]
    expected, asked = BODIES[14], BODIES[15:25]
    prediction = Prediction(lessons, 1)
    prediction.expect(expected, 1)
    known, parameters = prediction._known, prediction._parameters
    from evolution._src.body_search.prediction import _compare, _find_covariance

    whole = _find_covariance(_compare(known, known), parameters[:3]) + parameters[3] * np.eye(13)
    numbers = prediction._to_numbers(asked, [1] * 10)
    shared = _find_covariance(_compare(numbers, known), parameters[:3])
    variance = 1.0 - np.sum(shared * np.linalg.solve(whole, shared.T).T, axis=1)
    spread = prediction.predict(asked)[1] / prediction._spreads[1]
    assert spread == pytest.approx(np.sqrt(variance), rel=1e-5)
