"""Predictions from the shapes of bodies, and the search that they lead."""

import numpy as np
import pytest
from evolution._src.search.bodies.prediction import MAX_LESSONS, Prediction, describe_shape

from evolution._src.search.bodies.algorithms import SurrogateSearch
from evolution._src.search.bodies.config import BodiesConfig, LearningConfig, LevelResult
from evolution._src.search.bodies.genome import enumerate_bodies, parse_genome

BODIES = [body for count in range(1, 5) for body in enumerate_bodies(count)]


def make_result(body, fitness, level=1):
    return LevelResult(body, level, fitness, 0, 1, 0.0, (), (), (fitness,), 1.0)


def score(body):
    """Long rows are good."""
    return float(describe_shape(body)[4])


def test_the_shape_of_a_known_body():
    row = describe_shape(parse_genome("b(b(.))"))
    assert row.tolist() == pytest.approx([3, 2 * 0.1245 / 0.105, 0, 3, 3, 3, 0], abs=0.05)
    cross = describe_shape(parse_genome("b(.)l(.)r(.)"))
    assert cross[[0, 3, 4, 5]].tolist() == [4, 2, 2, 2]
    assert cross[6] == pytest.approx(0.0, abs=1e-9)


def test_mirror_images_have_one_shape():
    for body in BODIES:
        np.testing.assert_array_equal(describe_shape(body), describe_shape(body.mirror()))


def test_what_is_known_is_predicted_and_what_is_far_is_uncertain():
    known = BODIES[:10]
    prediction = Prediction([make_result(body, score(body)) for body in known], 1)
    mean, spread = prediction.predict([*known, parse_genome("b(b(b(.)))")])
    assert mean[:10] == pytest.approx([score(body) for body in known], abs=0.3)
    assert spread[-1] > spread[:10].max()


def test_first_levels_tell_of_the_last():
    """All first levels are known, and the last of half of the bodies: the order of the others follows."""
    rng = np.random.default_rng(0)
    luck = {body.text: rng.normal() for body in BODIES}
    results = [make_result(body, 0.1 * luck[body.text] - 3.0, 0) for body in BODIES]
    results += [make_result(body, luck[body.text]) for body in BODIES[::2]]
    mean, _ = Prediction(results, 1).predict(BODIES[1::2])
    assert np.corrcoef(mean, [luck[body.text] for body in BODIES[1::2]])[0, 1] > 0.9


def test_equal_fitness_and_one_result_are_no_error():
    for results in ([make_result(BODIES[0], 1.0)], [make_result(body, 2.0) for body in BODIES]):
        mean, spread = Prediction(results, 1).predict(BODIES[:3])
        assert mean == pytest.approx(results[0].fitness)
        assert (spread >= 0.0).all()


def test_only_the_last_results_count():
    results = [make_result(BODIES[place % 39], float(place)) for place in range(MAX_LESSONS + 20)]
    whole, last = Prediction(results, 1), Prediction(results[20:], 1)
    np.testing.assert_equal(whole.predict(BODIES), last.predict(BODIES))


def search(seed, iterations=10):
    config = BodiesConfig(algorithm="surrogate", largest=5, children=4, population_size=6)
    found = SurrogateSearch(config, LearningConfig(levels=(1, 2)), np.random.default_rng(seed))
    taught = []
    for _ in range(iterations):
        assignments = found.ask()
        taught += assignments
        found.tell([make_result(a.body, score(a.body), a.level) for a in assignments])
    return taught


def test_the_search_is_repeatable():
    assert search(0) == search(0)
    assert search(0) != search(1)


def test_the_search_finds_the_longest_row():
    """In most of six searches: 16 of 173 bodies learn to the end, of which chance has the longest row in one of 11."""
    taught = [{each.body.text for each in search(seed) if each.level == 1} for seed in range(6)]
    assert sum("b(b(b(b(.))))" in bodies for bodies in taught) >= 4


def test_no_body_learns_a_level_twice():
    taught = [(each.body.canonical_text, each.level) for each in search(3)]
    assert len(set(taught)) == len(taught)
    assert {level for _, level in taught} == {0, 1}


def test_a_space_that_is_searched_out_goes_on_with_what_is_known():
    config = BodiesConfig(algorithm="surrogate", largest=2, children=3, population_size=4)
    found = SurrogateSearch(config, LearningConfig(levels=(1, 2)), np.random.default_rng(0))
    for _ in range(8):
        assignments = found.ask()
        assert assignments
        found.tell([make_result(a.body, score(a.body), a.level) for a in assignments])


def test_first_levels_that_tell_nothing_are_not_followed():
    rng = np.random.default_rng(1)
    noise = {body.text: rng.normal() for body in BODIES}
    results = [make_result(body, noise[body.text], 0) for body in BODIES]
    results += [make_result(body, rng.normal()) for body in BODIES[::2]]
    mean, _ = Prediction(results, 1).predict(BODIES[1::2])
    assert np.ptp(mean) < 0.5 * np.ptp([noise[body.text] for body in BODIES[1::2]])
