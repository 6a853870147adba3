"""A published landscape is made again to the bit: on made physics, and the one of the package by physics (slow)."""

from dataclasses import replace

import numpy as np
import pytest

from evolution._src.backends.outcome import Outcome
from evolution._src.bodies.genome import genome_of
from evolution._src.errors import RunError
from evolution._src.landscape.assembly import assemble
from evolution._src.landscape.config import LandscapeConfig
from evolution._src.landscape.judging import judge_bodies
from evolution._src.landscape.making import let_bodies_learn
from evolution._src.landscape.places import save_places
from evolution._src.landscape.remaking import draw_places, find_differences
from evolution._src.landscape.table import load_landscape

CONFIG = LandscapeConfig(largest=3, population_size=4, generations=(2,), exam_trials=2)


def simulate(jobs, threads):
    """Larger bodies go farther; the truth is harder; the seed of a trial is its luck."""
    outcomes = []
    for job in jobs:
        size = genome_of(job.trials.body.find_organism()).num_modules
        progress = 0.3 * size - 0.2 * float(np.abs(job.genotype - 0.5).mean()) + 0.01 * sum(job.trials.seed)
        progress -= 0.5 * (job.trials.arena == "truth")
        outcomes.append(Outcome(progress, 0.1, (progress > 0.5,) * job.trials.count, seconds=1.5))
    return outcomes


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made")
    runs = let_bodies_learn(CONFIG, {"pit": "gsrm"}, folder, simulate=simulate)
    return assemble(CONFIG, runs, judge_bodies(CONFIG, runs, {"pit": "truth"}, folder, simulate=simulate), {})


def test_bodies_are_made_again_whatever_learns_beside_them(table):
    everything = list(range(len(table.bodies)))
    for places in (everything, [4, 2], [7]):
        found = find_differences(table, "pit", "gsrm", "truth", places, simulate=simulate)
        assert found == dict.fromkeys(places, ())


@pytest.mark.parametrize(
    "name", ["fitness", "seconds", "effort", "curve", "genotypes", "again_fitness", "truth_successes"]
)
def test_a_number_that_differs_is_named(table, name):
    values = np.array(getattr(table, name), dtype=float)
    values[0, 3] = np.nextafter(values[0, 3], 10.0)
    changed = replace(table, **{name: values})
    found = find_differences(changed, "pit", "gsrm", "truth", [2, 3], simulate=simulate)
    assert found == {2: (), 3: (name,)}


def test_places_are_drawn_once_and_refused_beyond_the_table(table):
    assert draw_places(table, len(table.bodies)) == list(range(len(table.bodies)))
    assert draw_places(table, 3, seed=1) == draw_places(table, 3, seed=1)
    with pytest.raises(RunError, match="count is 99; the landscape has 10 bodies"):
        draw_places(table, 99)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pit", "stairs", "rough"])
def test_the_published_landscape_is_made_again_to_the_bit(name, tmp_path):
    """Survey, network, arena, learning and judgments of two random bodies, from nothing."""
    table = load_landscape()
    arenas, truths = save_places(tmp_path, [name])
    places = draw_places(table, 2)
    found = find_differences(table, name, arenas[name], truths[name], places)
    assert found == dict.fromkeys(places, ())
