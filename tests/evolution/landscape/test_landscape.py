"""The landscape of bodies on made physics: made in parts, stored, judged; and searches replayed on it."""

import json
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest

from evolution._src.backends.outcome import Outcome
from evolution._src.bodies.genome import genome_of
from evolution._src.body_search.config import BodiesConfig
from evolution._src.errors import RunError
from evolution._src.landscape.assembly import assemble
from evolution._src.landscape.config import LandscapeConfig, make_search
from evolution._src.landscape.judging import judge_bodies
from evolution._src.landscape.making import count_rounds, let_bodies_learn, list_bodies
from evolution._src.landscape.places import PLACES, find_published_arena, make_hills, make_true_arena
from evolution._src.landscape.reliability import correlate_ranks, describe_reliability, find_goal
from evolution._src.landscape.replay import Replay, Table, measure_area, replay, summarize
from evolution._src.landscape.scores import IN_RUNGS, find_rungs, score_searches
from evolution._src.landscape.table import ARRAYS, load_landscape

CONFIG = LandscapeConfig(largest=4, population_size=4, generations=(2,), exam_trials=2)
ARENAS = {"pit": "gsrm", "rough": "simple"}
TRUTHS = {"pit": "truth", "rough": "truth"}


def simulate(jobs, threads):
    """Long bodies go far; genes near 0.3 help; the truth is 0.5 harder; luck depends on the conditions."""
    outcomes = []
    for job in jobs:
        body = genome_of(job.trials.body.find_organism()).canonical_text
        depth = max(np.cumsum([(c == "(") - (c == ")") for c in body]), default=0)
        luck = np.random.default_rng([*job.trials.seed, len(body)]).normal(0.0, 0.01)
        progress = 0.3 * depth - 0.1 * float(np.abs(job.genotype - 0.3).mean()) + luck
        progress -= 0.5 * (job.trials.arena == "truth")
        outcomes.append(
            Outcome(progress, 0.01, (bool(progress > 0.8),) * job.trials.count, seconds=float(depth + 1))
        )
    return outcomes


def make(folder, **changes):
    runs = let_bodies_learn(CONFIG, ARENAS, folder, simulate=simulate, **changes)
    judged = judge_bodies(CONFIG, runs, TRUTHS, folder, simulate=simulate)
    return assemble(CONFIG, runs, judged, {"command": "test"})


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("landscape")


@pytest.fixture(scope="module")
def table(folder):
    return make(folder)


def test_every_body_has_learned_every_task(table):
    assert table.tasks == tuple(ARENAS)
    assert len(table.bodies) == 1 + 2 + 7 + 29 == len(list_bodies(4))
    assert table.fitness.shape == (2, 39)
    assert table.curve.shape == (2, 39, 2)
    best = table.bodies[int(np.argmax(table.fitness[0]))]
    assert best.canonical_text.count("(") == 3
    assert (table.fitness > table.truth_fitness).all()


def test_in_parts_and_at_once_the_bytes_are_equal(table, tmp_path):
    let_bodies_learn(CONFIG, ARENAS, tmp_path, rounds=2, simulate=simulate)
    again = make(tmp_path)
    assert again.to_bytes() == table.to_bytes()
    other = LandscapeConfig(largest=4, population_size=4, generations=(2,), exam_trials=2, seed=1)
    with pytest.raises(RunError, match="another configuration"):
        let_bodies_learn(other, ARENAS, tmp_path, simulate=simulate)


def test_what_is_stored_is_not_tried_again(table, folder):
    def refuse(jobs, threads):
        raise AssertionError("nothing is left to be tried")

    runs = let_bodies_learn(CONFIG, ARENAS, folder, simulate=refuse)
    judged = judge_bodies(CONFIG, runs, TRUTHS, folder, simulate=refuse)
    assert assemble(CONFIG, runs, judged, {}).to_bytes() == table.to_bytes()


def test_an_unfinished_landscape_is_refused(tmp_path):
    runs = let_bodies_learn(CONFIG, ARENAS, tmp_path, rounds=1, simulate=simulate)
    judged = judge_bodies(CONFIG, runs, TRUTHS, tmp_path, simulate=simulate)
    with pytest.raises(RunError, match="27 of 39 bodies have not learned"):
        assemble(CONFIG, runs, judged, {})
    assert count_rounds(CONFIG) == 4


def test_files_are_read_as_written_and_damage_is_seen(table, tmp_path):
    table.save(tmp_path)
    read = load_landscape(tmp_path)
    assert read.to_bytes() == table.to_bytes()
    assert (read.bodies, read.gene_names, read.config) == (table.bodies, table.gene_names, table.config)
    assert read.find_genotype(0, 38) == table.find_genotype(0, 38)
    (tmp_path / ARRAYS).write_bytes(table.to_bytes()[:-1])
    with pytest.raises(RunError, match="do not belong together"):
        load_landscape(tmp_path)
    with pytest.raises(RunError, match="no landscape"):
        load_landscape(tmp_path / "nothing")
    with pytest.raises(RunError, match="no task 'moon'"):
        table.find_task("moon")
    with pytest.raises(RunError, match="curve has"):
        replace(table, curve=table.curve[:1])


def test_the_configuration_refuses_what_it_cannot_do(tmp_path):
    with pytest.raises(RunError, match="largest"):
        LandscapeConfig(largest=7)
    with pytest.raises(RunError, match="rungs"):
        LandscapeConfig(generations=(3, 1))
    with pytest.raises(RunError, match="no task 'moon'"):
        make_search(CONFIG, "moon", "gsrm")


def test_ranks_and_goals_of_known_numbers(table):
    assert correlate_ranks(np.array([1.0, 2.0, 3.0]), np.array([10.0, 20.0, 30.0])) == pytest.approx(1.0)
    assert correlate_ranks(np.array([1.0, 2.0]), np.array([5.0, 5.0])) == 0.0
    known = replace(table, fitness=np.tile(np.arange(39.0), (2, 1)))
    assert find_goal(known, 0) == pytest.approx(19 + 0.95 * 19)
    rows = describe_reliability(table)
    assert rows["pit"]["truth_rank"] > 0.8
    assert rows["pit"]["bodies"] == 39


def test_the_area_of_known_curves():
    run = Replay(np.array([0.0, 10.0, 60.0]), np.array([-np.inf, 1.0, 2.0]), np.zeros(3))
    assert measure_area(run, 100.0, 0.0, 2.0) == pytest.approx(0.5 * 0.5 + 1.0 * 0.4)
    never = Replay(np.array([0.0]), np.array([-np.inf]), np.zeros(1))
    assert measure_area(never, 100.0, 0.0, 2.0) == 0.0
    mean, low, high = summarize([1.0, 2.0, 3.0])
    assert (mean, high - mean) == (pytest.approx(2.0), pytest.approx(4.302653 / np.sqrt(3)))
    assert low < mean


def test_exhaustive_replay_pays_for_all_and_finds_the_optimum(table):
    total = float(table.seconds[0].sum())
    run = replay(table, "pit", "exhaustive", 0, total + 1.0)
    assert run.best[-1] == table.fitness[0].max()
    paid = Table(table, "pit")
    from evolution._src.body_search.learner import Assignment
    from evolution._src.body_search.learning import Pupil

    lessons = [paid.look_up(Assignment(Pupil(body), 0)) for body in (*table.bodies, *table.bodies)]
    assert paid.seconds == pytest.approx(total)
    assert max(lesson.fitness for lesson in lessons) == table.fitness[0].max()


@pytest.mark.parametrize("name", ["freeze_thaw", "niches", "surrogate", "halving", "genetic", "random"])
def test_replays_are_equal_for_equal_seeds_and_keep_their_budget(table, name):
    budget = 0.4 * float(table.seconds[0].sum())
    rungs = (1, 2) if name in IN_RUNGS else None
    first, second, other = (replay(table, "pit", name, seed, budget, rungs=rungs) for seed in (3, 3, 4))
    np.testing.assert_equal(first, second)
    assert first.seconds[-1] <= budget
    assert len(first.seconds) != len(other.seconds) or (first.seconds != other.seconds).any()
    assert (np.diff(first.best[1:]) > 0).all()


def test_a_replay_refuses_what_the_table_lacks(table):
    with pytest.raises(RunError, match="learn to generation 2"):
        Table(table, "pit", (1, 3))
    from evolution._src.bodies.enumeration import enumerate_bodies
    from evolution._src.body_search.learning import Pupil

    with pytest.raises(RunError, match="no body"):
        Table(table, "pit").find_place(Pupil(enumerate_bodies(5)[0]))


def test_searches_are_scored(table):
    scores = score_searches(table, range(3), budget=0.5, bodies=BodiesConfig(children=3, population_size=4))
    row = scores["pit"]["searches"]["genetic"]
    assert 0.0 < row["area_low"] <= row["area"] <= row["area_high"] <= 1.5
    assert scores["pit"]["optimum"] == table.fitness[0].max()
    assert ("map_elites" in scores["pit"]["searches"]) == (find_spec("ribs") is not None)


def test_the_exact_places_are_known_by_hand():
    solids = make_hills()
    assert len(solids) == 46
    assert all(solid.is_watertight and solid.is_convex for solid in solids)
    np.testing.assert_equal(make_hills()[7].vertices, solids[7].vertices)
    arena = make_true_arena("rough")
    assert arena.surface.is_watertight
    assert arena.quality.num_pieces == 46
    assert make_true_arena("pit").course.pit == 0.18
    assert make_true_arena("one_step").course.steps == 1
    _, bar = make_true_arena("sill").pieces
    assert (bar.bounds[1, 2], np.ptp(bar.bounds[:, 1])) == (0.05, 2.0)
    assert bar.bounds[1, 0] == pytest.approx(0.05 + 0.05 + 0.10)  # half of its top, and sides of 45 degrees
    low, high = (make_hills(seed=3, slopes=slopes)[9].bounds[1, 2] for slopes in ((0.1, 0.2), (0.5, 1.0)))
    assert 0.0 < low < high
    assert PLACES == ("pit", "stairs", "rough")
    with pytest.raises(RunError, match="no place 'moon'"):
        find_published_arena("moon")


def test_the_json_names_the_command(table, tmp_path):
    table.save(tmp_path)
    assert json.loads((tmp_path / "landscape.json").read_text())["provenance"] == {"command": "test"}


def test_the_rungs_of_each_search():
    assert find_rungs("freeze_thaw", 4) == (1, 2, 4)
    assert find_rungs("freeze_thaw", 2) == (1, 2)
    assert find_rungs("niches", 4) == (1, 4)
    assert find_rungs("random", 4) == (4,)
    assert find_rungs("surrogate", 1) == (1,)
