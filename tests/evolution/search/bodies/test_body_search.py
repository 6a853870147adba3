"""Searches for bodies on a made landscape: what is learned, resuming to the bit, and what is refused."""

import json
from dataclasses import replace

import made_bodies
import numpy as np
import pytest
from histories import without_times

import evolution as ev
from evolution._src.controllers.oscillators import TWIST_GENES
from evolution._src.errors import RunError
from evolution._src.report.body_page import make_body_page
from evolution._src.search.bodies.config import ALGORITHMS
from evolution._src.search.bodies.genome import BodyGenome, enumerate_bodies
from evolution._src.search.loop import evolve, load_run, resume

BEST = BodyGenome.parse("b(b(.)m(.))")
"""The best body of the made landscape."""
LEARNING = ev.LearningConfig(population_size=4, levels=(1, 2, 4), exam_trials=2)
BODIES = ev.BodiesConfig(algorithm="surrogate", largest=6, children=6, population_size=6)
FILES = ("record.npz", "bodies.csv", "champion.json")


def landscape(jobs, threads):
    """Progress: how many modules are those of the best body, less the distance of the genes from 0.3."""
    wanted = _list_places(BEST.to_organism())
    outcomes = []
    for job in jobs:
        places = _list_places(job.trials.find_organism())
        likeness = len(places & wanted) / len(places | wanted)
        luck = np.random.default_rng([*job.trials.seed, len(places)]).normal(0.0, 0.01)
        progress = likeness - 0.1 * float(np.abs(job.genotype - 0.3).mean()) + luck
        outcomes.append(ev.Outcome(progress, 0.1, (progress > 0.9,) * job.trials.count, seconds=1.0))
    return outcomes


def _list_places(organism):
    return {(round(pose.x, 3), round(pose.y, 3)) for pose in organism.compute_poses()}


def make_config(**changes):
    values = {"track_control": "skid", "bodies": BODIES, "learning": LEARNING, "iterations": 5}
    return ev.BodyEvolutionConfig(**values | changes)


def summarize(run):
    return run.results, run.champion, without_times(run.history)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return evolve(make_config(folder=tmp_path_factory.mktemp("whole")), simulate=landscape)


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_equal_seeds_give_equal_runs_and_others_do_not(algorithm):
    config = make_config(bodies=replace(BODIES, algorithm=algorithm), iterations=2)
    first, second = (evolve(config, simulate=landscape) for _ in range(2))
    assert summarize(first) == summarize(second)
    assert summarize(evolve(replace(config, seed=1), simulate=landscape)) != summarize(first)


@pytest.mark.slow
def test_a_resumed_run_equals_one_that_never_stopped_also_after_a_kill(whole, tmp_path):
    count = 0

    def dying(jobs, threads):
        nonlocal count
        count += len(jobs)
        if count > 120:
            raise KeyboardInterrupt
        return landscape(jobs, threads)

    with pytest.raises(KeyboardInterrupt):
        evolve(make_config(folder=tmp_path), simulate=dying)
    assert 0 < len(load_run(tmp_path).history) < 5
    assert summarize(ev.resume(tmp_path, simulate=landscape, workers=3)) == summarize(whole)
    assert summarize(load_run(tmp_path)) == summarize(load_run(whole.folder)) == summarize(whole)
    assert (tmp_path / "bodies.csv").read_bytes() == (whole.folder / "bodies.csv").read_bytes()
    assert ev.load_champion(tmp_path) == whole.champion


def test_the_champion_is_the_fittest_body(whole):
    assert whole.champion.organism == whole.best.body.to_organism()
    assert whole.champion.fitness == whole.history["best"][-1] == whole.best.fitness


def test_exhaustive_search_tries_every_body_once_and_ends():
    bodies = ev.BodiesConfig(algorithm="exhaustive", smallest=2, largest=4, children=10)
    run = evolve(make_config(bodies=bodies, iterations=100), simulate=landscape)
    tried = [result.body.text for result in run.results if result.level == 2]
    assert sorted(tried) == sorted(body.text for count in (2, 3, 4) for body in enumerate_bodies(count))
    assert len(run.history) == 4


def test_what_a_body_learns_depends_on_no_other():
    alone, together = (
        ev.BodiesConfig(algorithm="exhaustive", smallest=smallest, largest=3, children=99)
        for smallest in (3, 1)
    )
    first, second = (
        evolve(make_config(bodies=bodies), simulate=landscape).results for bodies in (alone, together)
    )
    assert set(first) < set(second)


@pytest.mark.slow
def test_as_many_learn_on_as_make_all_levels_cost_the_same():
    assert [LEARNING.count_trials(level) for level in range(3)] == [1 + 2, 4 + 2, 2 * 4 + 2]
    cheap = replace(LEARNING, levels=(1, 4), is_examined_early=False)
    assert [cheap.count_trials(level) for level in range(2)] == [1, 3 * 4 + 2]
    config = make_config(iterations=8, learning=cheap, bodies=replace(BODIES, smallest=6))
    run = evolve(config, simulate=landscape)
    counts = [sum(result.level == level for result in run.results) for level in range(2)]
    assert 14 * (counts[1] - 2) <= counts[0] <= 14 * counts[1] + BODIES.children
    assert {result.trials for result in run.results if result.level == 0} == {0}


def test_the_fitness_of_a_body_is_that_of_its_exam(whole):
    """The best sample of learning is flattered by its luck; the exam has other conditions."""
    assert np.mean([max(result.curve) - result.fitness for result in whole.results]) != 0.0
    assert all(result.trials == LEARNING.exam_trials for result in whole.results)


@pytest.mark.slow
def test_progress_counts_the_trials_of_an_iteration_and_of_a_resumed_run_what_was_left(tmp_path):
    evolve(make_config(folder=tmp_path, iterations=2), simulate=landscape)
    told = []
    resume(tmp_path, iterations=4, simulate=landscape, progress=lambda *each: told.append(each))
    assert told[0][0].startswith("iteration 3 of 4: ")
    assert told[-1] == ("iteration 4 of 4", 1.0)
    shares = [share for _, share in told]
    assert 0.0 < shares[0] < 0.1
    assert shares == sorted(shares)


def test_folders_of_other_runs_are_refused_in_one_line(whole, tmp_path):
    with pytest.raises(RunError, match="contains no run"):
        ev.resume(tmp_path / "nothing", simulate=landscape)
    assert not (tmp_path / "nothing").exists()
    with pytest.raises(RunError, match="cannot change"):
        resume(whole.folder, seed=3)
    content = json.loads((whole.folder / "config.json").read_text())
    content["config"]["seed"] = 7
    evolve(ev.EvolutionConfig(generations=0, folder=tmp_path / "other"), simulate=landscape)
    (tmp_path / "other" / "config.json").write_text(json.dumps(content))
    with pytest.raises(RunError, match="another configuration"):
        resume(tmp_path / "other", simulate=landscape)


def test_a_task_that_the_arena_does_not_have_leaves_no_folder(tmp_path):
    config = make_config(arena="truth", task="reach", goal="station", folder=tmp_path / "run")
    with pytest.raises(RunError, match="cannot be made: no objects 'station'"):
        evolve(config)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("make", "change", "message"),
    [
        (make_config, {"modules": 5}, "modules is given, and bodies are searched"),
        (make_config, {"track_control": "constant"}, "a body of 1 module has no hinge"),
        (make_config, {"arena": 3}, "arena is int"),
        (make_config, {"backend": "warp"}, "backend"),
        (ev.BodiesConfig, {"algorithm": "luck"}, "luck"),
        (ev.BodiesConfig, {"smallest": 5, "largest": 2}, "got 5 and 2"),
        (ev.BodiesConfig, {"dofs": 3}, "dofs"),
        (ev.LearningConfig, {"levels": ()}, "levels is"),
        (ev.LearningConfig, {"levels": (0, 1)}, "levels is"),
        (ev.LearningConfig, {"levels": (3, 3)}, "levels is"),
    ],
)
def test_configurations_that_cannot_be_are_refused(make, change, message):
    with pytest.raises(RunError, match=message):
        make(**change)


def test_bodies_of_twelve_modules_with_two_joints_each_go_from_search_to_page(tmp_path):
    bodies = ev.BodiesConfig(largest=12, dofs=2, children=4, population_size=6)
    learning = ev.LearningConfig(population_size=4, levels=(1, 2), exam_trials=1)
    config = make_config(bodies=bodies, learning=learning, iterations=3, folder=tmp_path / "run")
    run = evolve(config, simulate=made_bodies.simulate)
    assert max(result.body.num_modules for result in run.results) > 8
    for result in run.results:
        twists = {name.rsplit("_", 1)[0] for name in result.names if name.startswith("twist_")}
        assert twists == (set(TWIST_GENES) if result.body.num_modules > 1 else set())
        assert "track_steering" in result.names
    champion = ev.load_champion(tmp_path / "run")
    assert champion == run.champion
    assert champion.find_organism().scout.dofs == 2
    make_body_page(run).write(tmp_path / "bodies.html")
    assert run.best.body.to_plan() in (tmp_path / "bodies.html").read_text()
