"""The fittest bodies learn longer, on made physics: they begin as before, are stored, judged and described."""

import json

import numpy as np
import pytest

from evolution._src.backends.outcome import Outcome
from evolution._src.bodies.genome import genome_of
from evolution._src.errors import RunError
from evolution._src.landscape.assembly import assemble
from evolution._src.landscape.config import LandscapeConfig
from evolution._src.landscape.judging import judge_bodies
from evolution._src.landscape.longer import (
    FILE,
    describe_longer,
    find_fittest,
    learn_longer,
    lengthen,
    load_longer,
    save_longer,
)
from evolution._src.landscape.making import let_bodies_learn
from evolution._src.report.landscape import draw_longer

CONFIG = LandscapeConfig(largest=3, population_size=4, generations=(2,), exam_trials=2)
ARENAS, TRUTHS = {"pit": "gsrm"}, {"pit": "truth"}
TIMES, COUNT = 6, 4


class Physics:
    """Two modules and more go the farther the nearer their genes are to 0.5; counts its genotypes."""

    def __init__(self):
        self.genotypes = 0

    def __call__(self, jobs, threads):
        self.genotypes += len(jobs)
        return [self._try(job) for job in jobs]

    def _try(self, job):
        size = genome_of(job.trials.body.find_organism()).num_modules
        progress = 0.3 * size - 0.2 * float(np.abs(job.genotype - 0.5).mean())
        progress -= 0.5 * (job.trials.arena == "truth")
        return Outcome(progress, 0.0, (False,) * job.trials.count, seconds=1.0)


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    folder = tmp_path_factory.mktemp("short")
    runs = let_bodies_learn(CONFIG, ARENAS, folder, simulate=Physics())
    return assemble(CONFIG, runs, judge_bodies(CONFIG, runs, TRUTHS, folder, simulate=Physics()), {})


def test_ten_times_the_genotypes_are_counted_by_hand():
    # 19 genotypes: the start and three generations of six; 190 need the start and 32 generations.
    assert lengthen(LandscapeConfig(), 10).generations == (33,)
    assert lengthen(LandscapeConfig(), 1) == LandscapeConfig()
    with pytest.raises(RunError, match="times is 0"):
        lengthen(LandscapeConfig(), 0)


def test_the_fittest_begin_as_before_and_gain(table, tmp_path):
    found = learn_longer(table, ARENAS, TRUTHS, tmp_path, TIMES, COUNT, simulate=Physics())["pit"]
    assert [each.place for each in found] == find_fittest(table, "pit", COUNT)
    for each in found:
        curve = table.curve[0, each.place]
        assert each.lesson.curve[: len(curve)] == tuple(curve)
        assert each.lesson.fitness >= table.fitness[0, each.place]
        assert each.truth.fitness == pytest.approx(each.lesson.fitness - 0.5)


def test_what_is_stored_is_not_tried_again(table, tmp_path):
    first, second = Physics(), Physics()
    once = learn_longer(table, ARENAS, TRUTHS, tmp_path, TIMES, COUNT, simulate=first)
    again = learn_longer(table, ARENAS, TRUTHS, tmp_path, TIMES, COUNT, simulate=second)
    assert once == again
    assert second.genotypes == COUNT  # the judgment in the truth alone
    with pytest.raises(RunError, match="another configuration"):
        learn_longer(table, ARENAS, TRUTHS, tmp_path, TIMES + 1, COUNT, simulate=second)


def test_the_rows_and_the_file_say_what_changed(table, tmp_path):
    found = learn_longer(table, ARENAS, TRUTHS, tmp_path, TIMES, COUNT, simulate=Physics())
    row = describe_longer(found, table)["pit"]
    long = [each.lesson.fitness for each in found["pit"]]
    assert row["bodies"] == COUNT
    assert row["best_fitness"] == max(long)
    assert row["first_is_now"] == sorted(long, reverse=True).index(long[0]) + 1
    assert row["best_was"] == long.index(max(long)) + 1
    assert row["gain"] > 0.0
    assert row["truth_rank"] == pytest.approx(1.0)
    save_longer(found, table, TIMES, tmp_path)
    stored = load_longer(tmp_path)
    assert [each["fitness"] for each in stored["tasks"]["pit"]] == long
    assert len(draw_longer(table, stored).axes) == 1
    assert stored["generations"] == lengthen(CONFIG, TIMES).generations[0]


def test_a_missing_or_foreign_file_is_refused_with_the_command(tmp_path):
    with pytest.raises(RunError, match=r"benchmarks\.landscape --only longer"):
        load_longer(tmp_path)
    (tmp_path / FILE).write_text(json.dumps({"format": "other"}))
    with pytest.raises(RunError, match="'other'"):
        load_longer(tmp_path)
