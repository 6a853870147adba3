"""Descriptors of bodies: values known by hand, cells of archives, and what is refused."""

from dataclasses import replace
from importlib.util import find_spec

import made_bodies
import pytest

import evolution as ev
from evolution._src.bodies.genome import parse_genome
from evolution._src.body_search.descriptors import (
    DESCRIPTORS,
    MAX_EFFORT,
    measure_effort,
    measure_modules,
    measure_used_hinges,
    measure_width_to_length,
)
from evolution._src.body_search.learning import Lesson, Pupil
from evolution._src.errors import RunError

LESSON = Lesson(
    pupil=Pupil(parse_genome("b(.)m(.)")),
    rung=0,
    fitness=1.0,
    successes=1,
    trials=2,
    effort=0.05,
    genotype=(0.3, 0.0, 0.05, -0.02),
    names=("amplitude_back", "offset_back", "amplitude_left", "offset_right"),
    curve=(1.0,),
    seconds=1.0,
)


def test_values_known_by_hand():
    assert measure_modules(LESSON) == 4.0
    assert measure_used_hinges(LESSON) == 1.0
    assert measure_used_hinges(LESSON._replace(genotype=(0.0, -0.2, 0.1, 0.1))) == 3.0
    assert measure_used_hinges(LESSON._replace(names=("a", "b", "c", "d"))) == 3.0
    assert measure_effort(LESSON) == 0.05
    assert measure_effort(LESSON._replace(effort=9.0)) == MAX_EFFORT
    row = LESSON._replace(pupil=Pupil(parse_genome("b(b(.))")))
    assert measure_width_to_length(row) < 0.5 < measure_width_to_length(LESSON)


def test_every_cell_of_an_axis_lies_between_its_ends():
    for name, axis in DESCRIPTORS.items():
        count, low, high = axis.limits(2, 5)
        assert count >= 1, name
        assert low < high, name
    assert DESCRIPTORS["modules"].limits(2, 5) == (4, 1.5, 5.5)


def test_elites_are_the_fittest_of_their_cells():
    run = ev.evolve(made_bodies.make_config(), simulate=made_bodies.simulate)
    elites = run.find_elites(("modules",))
    assert list(elites) == [(0,), (1,), (2,)]
    for lesson in run.record.lessons:
        assert lesson.fitness <= elites[(lesson.pupil.body.num_modules - 1,)].fitness
    assert len(run.find_elites(("modules", "width_to_length"))) > 3


def test_evolve_takes_both_configurations():
    config = made_bodies.make_config()
    both = (
        ev.evolve(config, simulate=made_bodies.simulate),
        ev.evolve_bodies(config, simulate=made_bodies.simulate),
    )
    assert both[0].history == both[1].history
    with pytest.raises(RunError, match="BodyEvolutionConfig"):
        ev.EvolutionConfig(body=ev.BodiesConfig())


def test_axes_are_checked_and_those_by_default_keep_the_digest():
    for axes in ((), ("moon",), ("energy", "energy")):
        with pytest.raises(RunError, match="axes"):
            ev.BodiesConfig(axes=axes)
    config = made_bodies.make_config()
    other = replace(
        config, bodies=ev.BodiesConfig(algorithm="exhaustive", largest=3, children=20, axes=("energy",))
    )
    assert config.digest() != other.digest()
    assert config.digest() == ev.BodyEvolutionConfig.from_json(config.to_json()).digest()
    before = config.to_json()
    del before["axes"], before["randomization"]["patch_friction"]
    assert config.digest() == ev.BodyEvolutionConfig.from_json(before).digest()


@pytest.mark.skipif(find_spec("ribs") is None, reason="the extra 'ribs' is not installed")
@pytest.mark.parametrize("algorithm", ["map_elites", "cma_mae"])
def test_archives_of_all_axes_are_equal_for_equal_seeds(algorithm):
    bodies = ev.BodiesConfig(algorithm=algorithm, largest=4, children=4, axes=tuple(DESCRIPTORS))
    runs = [
        ev.evolve(made_bodies.make_config(bodies=bodies, iterations=4), simulate=made_bodies.simulate)
        for _ in range(2)
    ]
    assert runs[0].history == runs[1].history
