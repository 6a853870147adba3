"""Searches for bodies on a made landscape: what is learned, resuming to the bit, and what is refused."""

import json
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from evolution._src.search.bodies.loop import evolve_bodies, load_bodies, resume_bodies
from evolution._src.search.bodies.record import BodyRecord

import evolution as ev
from evolution._src.backends.trials import Job, Outcome
from evolution._src.errors import RunError
from evolution._src.search.bodies.config import ALGORITHMS, BodiesConfig, BodyEvolutionConfig, LearningConfig
from evolution._src.search.bodies.genome import enumerate_bodies, genome_of, parse_genome
from evolution._src.search.loop import load_run

BEST = "b(b(.)m(.))"
"""The best body of the made landscape."""
LEARNING = LearningConfig(population_size=4, levels=(1, 2, 4), exam_trials=2)
BODIES = BodiesConfig(algorithm="surrogate", largest=6, children=6, population_size=6)


def landscape(jobs: Sequence[Job], threads: int) -> list[Outcome]:
    """Progress: how many modules are those of the best body, less the distance of the genes from 0.3."""
    wanted = _list_places(parse_genome(BEST))
    outcomes = []
    for job in jobs:
        places = _list_places(genome_of(job.trials.find_organism()))
        likeness = len(places & wanted) / len(places | wanted)
        distance = float(np.abs(job.genotype - 0.3).mean())
        luck = np.random.default_rng([*job.trials.seed, len(places)]).normal(0.0, 0.01)
        progress = likeness - 0.1 * distance + luck
        outcomes.append(Outcome(progress, 0.1, (progress > 0.9,) * job.trials.count, seconds=1.0))
    return outcomes


def _list_places(genome):
    return set(genome.develop().find_paths())


def make_config(**changes):
    values = {
        "arena": "gsrm",
        "track_control": "skid",
        "bodies": BODIES,
        "learning": LEARNING,
        "iterations": 8,
    }
    return BodyEvolutionConfig(**values | changes)


def find_bytes(run):
    return run.record.to_bytes(run.config.digest())


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_equal_seeds_give_equal_runs_and_others_do_not(algorithm):
    config = make_config(bodies=replace(BODIES, algorithm=algorithm), iterations=3)
    first, second = (evolve_bodies(config, simulate=landscape) for _ in range(2))
    assert (find_bytes(first), first.history) == (find_bytes(second), second.history)
    other = evolve_bodies(replace(config, seed=1), simulate=landscape)
    assert find_bytes(other) != find_bytes(first)


def test_a_resumed_run_equals_one_that_never_stopped(tmp_path):
    bodies = BODIES
    whole = evolve_bodies(make_config(folder=tmp_path / "whole", bodies=bodies), simulate=landscape)
    evolve_bodies(make_config(folder=tmp_path / "parts", iterations=3, bodies=bodies), simulate=landscape)
    resumed = resume_bodies(tmp_path / "parts", iterations=8, simulate=landscape)
    assert resumed.history == whole.history
    for name in ("record.json", "bodies.csv", "champion.json"):
        assert (tmp_path / "parts" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    loaded = load_bodies(tmp_path / "parts")
    assert (loaded.history, find_bytes(loaded)) == (whole.history, find_bytes(whole))


def test_a_kill_within_an_iteration_loses_only_that(tmp_path):
    count = 0

    def dying(jobs, threads):
        nonlocal count
        count += len(jobs)
        if count > 120:
            raise KeyboardInterrupt
        return landscape(jobs, threads)

    with pytest.raises(KeyboardInterrupt):
        evolve_bodies(make_config(folder=tmp_path / "killed"), simulate=dying)
    assert load_bodies(tmp_path / "killed").record.num_generations > 0
    resumed = resume_bodies(tmp_path / "killed", simulate=landscape)
    assert find_bytes(resumed) == find_bytes(evolve_bodies(make_config(), simulate=landscape))


def test_exhaustive_search_tries_every_body_once_and_ends():
    bodies = BodiesConfig(algorithm="exhaustive", smallest=2, largest=4, children=10)
    run = evolve_bodies(make_config(bodies=bodies, iterations=100), simulate=landscape)
    tried = [result.body.text for result in run.results if result.level == 2]
    assert sorted(tried) == sorted(body.text for count in (2, 3, 4) for body in enumerate_bodies(count))
    assert len(run.history) == 4


def test_what_a_body_learns_depends_on_no_other():
    alone = make_config(bodies=BodiesConfig(algorithm="exhaustive", smallest=3, largest=3, children=1))
    together = make_config(bodies=BodiesConfig(algorithm="exhaustive", smallest=1, largest=3, children=99))
    first, second = (evolve_bodies(config, simulate=landscape).record for config in (alone, together))
    for result in first.results:
        assert second.find(result.body.canonical_text, result.level) == result


def test_as_many_learn_on_as_make_all_levels_cost_the_same():
    assert [LEARNING.count_trials(level) for level in range(3)] == [1 + 2, 4 + 2, 2 * 4 + 2]
    assert [LEARNING.compute_promoted_share(level) for level in range(2)] == [0.5, 0.6]
    cheap = replace(LEARNING, levels=(1, 4), is_examined_early=False)
    assert [cheap.count_trials(level) for level in range(2)] == [1, 3 * 4 + 2]
    config = make_config(iterations=20, learning=cheap, bodies=replace(BODIES, smallest=6))
    run = evolve_bodies(config, simulate=landscape)
    counts = [sum(result.level == level for result in run.results) for level in range(2)]
    assert 14 * (counts[1] - 2) <= counts[0] <= 14 * counts[1]


def test_the_fitness_of_a_body_is_that_of_its_exam():
    """The best sample of learning is flattered by its luck; the exam has other conditions."""
    run = evolve_bodies(make_config(), simulate=landscape)
    flattery = [max(result.curve) - result.fitness for result in run.results]
    assert np.mean(flattery) != 0.0
    assert all(result.trials == LEARNING.exam_trials for result in run.results)


def test_mirror_images_are_one_body():
    one, other = parse_genome("l(b(.))"), parse_genome("r(b(.))")
    assert one.canonical_text == other.canonical_text


def test_the_champion_is_a_champion_as_of_any_run(tmp_path):
    run = evolve_bodies(make_config(folder=tmp_path / "run"), simulate=landscape)
    champion = ev.load_champion(tmp_path / "run")
    assert champion == run.champion
    assert champion.find_organism().num_modules == run.best.body.num_modules


def test_a_record_of_another_configuration_is_refused(tmp_path):
    evolve_bodies(make_config(folder=tmp_path / "run", iterations=1), simulate=landscape)
    path = tmp_path / "run" / "config.json"
    content = json.loads(path.read_text())
    content["config"]["seed"] = 7
    path.write_text(json.dumps(content))
    with pytest.raises(RunError, match="another configuration"):
        resume_bodies(tmp_path / "run", simulate=landscape)


@pytest.mark.parametrize("content", [b"", b"{}", b'{"format": "symbrion bodies 9"}', b"[1]", b"\x00\xff"])
def test_a_damaged_record_is_refused(content):
    with pytest.raises(RunError, match=r"damaged|has format"):
        BodyRecord.from_bytes(content, "digest", "record.json")


def test_folders_are_refused_in_one_line(tmp_path):
    with pytest.raises(RunError, match="contains no run"):
        resume_bodies(tmp_path / "nothing", simulate=landscape)
    assert not (tmp_path / "nothing").exists()
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "record.json").write_text("mine")
    with pytest.raises(RunError, match=r"contains record\.json"):
        evolve_bodies(make_config(folder=tmp_path / "notes"), simulate=landscape)
    assert (tmp_path / "notes" / "record.json").read_text() == "mine"
    with pytest.raises(RunError, match="cannot change"):
        resume_bodies(tmp_path / "notes", seed=3)


def test_a_task_that_the_arena_does_not_have_leaves_no_folder(tmp_path):
    folder = tmp_path / "run"
    config = BodyEvolutionConfig(arena="truth", task="dock", track_control="skid", folder=str(folder))
    with pytest.raises(RunError, match="cannot be made: no objects 'station'"):
        evolve_bodies(config)
    assert not folder.exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"modules": 5}, "modules is given, and bodies are searched"),
        ({"track_control": "constant"}, "bodies of 1 module have no hinge"),
        ({"smallest": 5}, "smallest"),
        ({"arena": 3}, "arena is int"),
    ],
)
def test_configurations_that_cannot_be_are_refused(change, message):
    with pytest.raises(RunError, match=message):
        make_config(**change)


@pytest.mark.parametrize(
    ("change", "message"),
    [({"algorithm": "luck"}, "luck"), ({"smallest": 5, "largest": 2}, "got 5 and 2")],
)
def test_bodies_that_cannot_be_are_refused(change, message):
    with pytest.raises(RunError, match=message):
        BodiesConfig(**change)


@pytest.mark.parametrize("levels", [(), (0, 1), (3, 3), (4, 2)])
def test_levels_rise(levels):
    with pytest.raises(RunError, match="levels is"):
        LearningConfig(levels=levels)


def test_a_run_that_has_ended_says_so_when_it_is_resumed(tmp_path, caplog):
    evolve_bodies(make_config(iterations=1, folder=str(tmp_path / "run")), simulate=landscape)
    again = resume_bodies(tmp_path / "run", simulate=landscape)
    assert len(again.history) == 1
    assert "nothing more is tried, as the run has reached iterations=1" in caplog.text


def test_a_search_for_bodies_is_no_other_run(tmp_path):
    evolve_bodies(make_config(iterations=1, folder=str(tmp_path / "run")), simulate=landscape)
    with pytest.raises(RunError, match="contains a search for bodies; read it by"):
        load_run(tmp_path / "run")


def test_progress_of_a_resumed_run_begins_where_it_stands(tmp_path):
    config = make_config(folder=tmp_path / "run", iterations=2)
    evolve_bodies(config, simulate=landscape)
    told = []
    resume_bodies(
        tmp_path / "run",
        iterations=4,
        simulate=landscape,
        progress=lambda text, share: told.append((text, share)),
    )
    assert told[0] == ("iteration 3 of 4", 0.5)
    assert told[-1] == ("iteration 4 of 4", 1.0)
    shares = [share for _, share in told]
    assert shares == sorted(shares)
