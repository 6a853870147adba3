"""The benchmark beyond the map: what is compared with what, and the made rubble."""

import json
from dataclasses import replace

import numpy as np
import pytest

from benchmarks import beyond
from benchmarks.claims.beyond import make_claims
from benchmarks.evolution_runs import Results
from benchmarks.material import beyond as material
from benchmarks.material import longer_training, rubble
from evolution.backends.trials import Randomization
from evolution.bodies.genome import make_row
from evolution.search.validation import Champion


def make_row_of_figures(seed, body, snake, zero=(0, 0.1), random=(0, 0.0), is_row=False):
    scores = {"body": body, "snake": snake, "zero": zero, "random": random}
    figures = {f"{who}_successes": score[0] for who, score in scores.items()}
    figures |= {f"{who}_fitness": score[1] for who, score in scores.items()}
    return {"seed": seed, "is_row": is_row, **figures}


def test_better_means_better_than_every_snake():
    rows = [
        make_row_of_figures(0, (20, 1.9), (18, 2.0)),
        make_row_of_figures(1, (20, 1.9), (12, 2.0), zero=(20, 1.8)),
        make_row_of_figures(2, (18, 1.9), (12, 2.0), zero=(19, 1.8)),
        make_row_of_figures(3, (20, 1.9), (10, 1.0), is_row=True),
        make_row_of_figures(4, (17, 1.9), (10, 1.0), random=(17, 1.9)),
    ]
    assert beyond.summarize(rows) == {"of": 5, "hold": 4, "snakes_hold": 3, "better": 2, "rows": 1}


def test_claims_read_the_summary():
    rows = [make_row_of_figures(seed, (20, 1.9), (18, 2.0)) for seed in range(5)]
    records = {"beyond": {"results": {"pit": beyond.summarize(rows)}}}
    hold, better = make_claims("pit")
    assert (hold.format(records), better.format(records)) == ("5 of 5 (5)", "5 of 5 (0)")
    assert "met" in hold.check_bar(records)


def test_a_measured_row_stays(tmp_path, monkeypatch):
    monkeypatch.setattr("benchmarks.report.RESULTS", tmp_path)
    measured = []

    def measure(name, seed, quick):
        measured.append((name, seed))
        return make_row_of_figures(seed, (20, 1.9), (18, 2.0))

    monkeypatch.setattr(beyond, "measure", measure)
    results = Results("beyond")
    beyond.run(places=["stairs"], seeds=[1], results=results)
    found = beyond.run(places=["stairs", "pit"], seeds=[0, 1], results=results)
    assert measured == [("stairs", 1), ("stairs", 0), ("pit", 0), ("pit", 1)]
    assert [row["seed"] for row in found["stairs"]["runs"]] == [0, 1]
    assert found["stairs"]["better"] == 2
    beyond.run(places=["stairs"], seeds=[1], results=results, again=True)
    assert measured[4:] == [("stairs", 1)]
    assert [row["seed"] for row in results.content["stairs"]["runs"]] == [0, 1]
    assert json.loads((tmp_path / "beyond.json").read_text())["results"] == found


@pytest.mark.parametrize("name", material.PLACES)
def test_body_and_snake_have_the_same_law_task_and_modules(name):
    place = material.PLACES[name]
    search = material.make_search(place, "gsrm", 3)
    snake = material.make_snake_run(place, "gsrm", 3, 10)
    assert (search.arena, search.seed, search.bodies.largest) == ("gsrm", 3, 12)
    assert search.controller == snake.controller == place.controller
    assert search.episode.task == snake.episode.task
    assert dict(search.episode.environment)["duration"] == dict(snake.episode.environment)["duration"]
    assert search.trial == snake.trial
    organism = snake.body.find_organism()
    assert organism == search.make_organism(make_row(10))
    assert organism.scout.dofs == 2
    known = set(search.control.make_controller(organism, search.episode).parameters)
    assert {gene for gene, _ in place.genes} <= known


def test_the_best_body_goes_on_learning_where_it_stands():
    search = material.make_search(material.PLACES["stairs"], "gsrm", 3)
    organism = search.make_organism(make_row(4))
    law = search.control.make_controller(organism, search.episode)
    champion = Champion(
        genotype=(0.1,) * len(law.parameters),
        names=law.parameters,
        arena="gsrm",
        generation=0,
        fitness=1.0,
        modules=organism,
        episode=search.episode,
        control=search.control,
    )
    training = material.make_training(search, champion)
    assert training.initial_genotype == champion.genotype
    assert training.is_start_tried
    assert (training.body.find_organism(), training.trial) == (organism, search.trial)
    snake = material.make_snake_run(material.PLACES["stairs"], "gsrm", 3, 4)
    assert (training.episode.task, training.scoring) == (snake.episode.task, snake.scoring)
    assert replace(snake.search, sigma=training.sigma, initial_genotype=champion.genotype) == training.search


def test_a_champion_is_restored_from_its_row_and_trains_on_under_harder_conditions(monkeypatch):
    place = material.PLACES["stairs"]
    search = material.make_search(place, "gsrm", 3)
    organism = search.make_organism(make_row(4))
    names = search.control.make_controller(organism, search.episode).parameters
    genes = {name: 0.01 * number for number, name in enumerate(names)}
    row = {"seed": 3, "genome": make_row(4).text, "body_genes": dict(reversed(genes.items()))}
    champion = longer_training.restore_champion(place, "gsrm", row)
    assert dict(zip(champion.names, champion.genotype, strict=True)) == genes
    asked = []
    monkeypatch.setattr(
        longer_training, "evolve_for", lambda config, seconds: asked.append((config, seconds))
    )
    longer_training.train_longer(place, "gsrm", row)
    ((config, seconds),) = asked
    assert seconds == 2 * place.seconds
    assert config.initial_genotype == champion.genotype
    assert config.trial.randomization == longer_training.HARDER
    assert config.search.trials == 3
    usual = Randomization()
    assert longer_training.HARDER.friction[0] < usual.friction[0]
    assert longer_training.HARDER.torque_scale[0] < usual.torque_scale[0]


def test_longer_rows_are_added_to_the_rows_that_exist(tmp_path, monkeypatch):
    monkeypatch.setattr("benchmarks.report.RESULTS", tmp_path)
    results = Results("beyond")
    results.put("pit", {"runs": [make_row_of_figures(seed, (20, 1.9), (18, 2.0)) for seed in range(3)]})
    successes = {0: 20, 1: 17, 2: 18}
    monkeypatch.setattr(
        beyond,
        "measure_longer",
        lambda name, row, quick: {"seed": row["seed"], "successes": successes[row["seed"]]},
    )
    beyond.run_longer(places=["pit", "stairs"], seeds=[2], results=results)
    found = beyond.run_longer(places=["pit", "stairs"], results=results)["longer pit"]
    assert ([row["seed"] for row in found["runs"]], found["hold"], found["of"]) == ([0, 1, 2], 2, 3)
    assert "longer stairs" not in results.content


def test_plain_snakes_are_the_same_row():
    organism = material.make_search(material.PLACES["stairs"], "gsrm", 0).make_organism(make_row(4))
    snake = Champion(
        genotype=(0.1, 0.2),
        names=("a", "b"),
        controller="oscillators",
        modules=organism,
        arena="gsrm",
        generation=0,
        fitness=1.0,
        successes=7,
        trials=8,
    )
    plain = material.make_plain_snakes(snake, 0)
    assert plain["zero"].genotype == (0.0, 0.0)
    assert any(plain["random"].genotype)
    assert plain == material.make_plain_snakes(snake, 0)
    assert all(each.body == snake.body and each.trials == 0 for each in plain.values())


def test_rubble_is_made_of_the_blocks_it_names():
    blocks = rubble.make_blocks(3)
    assert len(blocks) == rubble.NUM_BLOCKS + 1
    assert all(block.is_convex for block in blocks)
    again = rubble.make_blocks(3)
    assert all(np.array_equal(one.vertices, two.vertices) for one, two in zip(blocks, again, strict=True))
    assert not np.allclose(blocks[1].vertices, rubble.make_blocks(4)[1].vertices)
    tops = np.array([block.bounds[1, 2] for block in blocks[1:]])
    assert np.all(tops > rubble.HEIGHTS[0])
    longest = np.hypot(rubble.EDGES[1], rubble.EDGES[1])
    assert np.all(tops < rubble.HEIGHTS[1] + longest * rubble.MAX_TILT)
    widths = np.array([np.ptp(block.bounds, axis=0)[:2].min() for block in blocks[1:]])
    assert np.all(widths > rubble.EDGES[0] + 2 * rubble.HEIGHTS[0] / rubble.SLOPE)
    assert np.all([block.bounds[0, 2] < 0.0 for block in blocks])


def test_the_true_rubble_is_one_closed_surface():
    arena = rubble.make_true_rubble(3)
    assert arena.surface.is_watertight
    assert arena.quality.num_pieces == len(arena.pieces) == rubble.NUM_BLOCKS + 1
