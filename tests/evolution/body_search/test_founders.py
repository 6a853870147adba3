"""Founders of a search for bodies: they learn first, and hand their genes on."""

from dataclasses import replace

import made_bodies
import pytest

import evolution as ev
from evolution._src.bodies.genome import BodyGenome, make_row
from evolution._src.errors import RunError

FOUNDERS = (make_row(5).text, "l(b(.))")
GENES = (("track_turn", 0.25), ("amplitude_back", 0.4))
LEARNING = ev.LearningConfig(population_size=4, rungs=(1, 2), exam_trials=1, is_inherited=True)


def make_config(algorithm="surrogate", **changes):
    bodies = ev.BodiesConfig(
        **{
            "algorithm": algorithm,
            "largest": 6,
            "founders": FOUNDERS,
            "founder_genes": GENES,
            "children": 3,
            "population_size": 3,
        }
        | changes
    )
    return made_bodies.make_config(bodies=bodies, learning=LEARNING, iterations=3)


def test_founders_learn_first_from_their_genes_and_hand_them_on():
    run = ev.evolve(make_config("surrogate"), simulate=made_bodies.simulate)
    first = [lesson.pupil for lesson in run.record.lessons if lesson.rung == 0][:3]
    assert [pupil.body.text for pupil in first[:2]] == list(FOUNDERS)
    assert [pupil.genes for pupil in first] == [GENES, GENES, ()]
    row = next(lesson for lesson in run.record.lessons if lesson.pupil.body == make_row(5))
    learned = dict(zip(row.names, row.genotype, strict=True))
    assert (learned["track_turn"], learned["amplitude_back"], learned["lag_back"]) == (0.25, 0.4, 0.0)
    children = [lesson.pupil for lesson in run.record.lessons if lesson.pupil.genes not in (GENES, ())]
    assert children


def test_without_founders_nothing_changes():
    plain = made_bodies.make_config(bodies=ev.BodiesConfig(largest=6, children=3, population_size=3))
    run = ev.evolve(plain, simulate=made_bodies.simulate)
    assert all(not lesson.pupil.genes for lesson in run.record.lessons)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"founders": ("b(b(",)}, "cannot read the genome"),
        ({"founders": (make_row(7).text,)}, "does not have 1 to 6 modules"),
        ({"founders": ("b(l(l(l(.))))",)}, "or they overlap"),
        ({"founders": ()}, "no founders"),
        ({"algorithm": "random"}, "does not begin with founders"),
        ({"algorithm": "exhaustive"}, "does not begin with founders"),
    ],
)
def test_founders_that_cannot_be_are_refused(changes, message):
    with pytest.raises(RunError, match=message):
        make_config(**changes)


def test_rows():
    assert make_row(1) == BodyGenome()
    assert make_row(3).text == "b(b(.))"
    with pytest.raises(RunError, match="at least 1"):
        make_row(0)


def test_the_configuration_is_stored(tmp_path):
    config = make_config()
    assert ev.BodyEvolutionConfig.from_json(config.to_json()) == config
    fewer = replace(config, bodies=replace(config.bodies, founders=FOUNDERS[:1]))
    assert fewer.digest() != config.digest()
