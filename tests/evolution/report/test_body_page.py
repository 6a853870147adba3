"""The page of bodies: a card for each elite, which opens."""

import made_bodies
import pytest

import evolution as ev
from evolution.body_search.record import BodyRecord
from evolution.body_search.run import BodyRun
from evolution.errors import RunError
from evolution.report.body_page import make_body_page


def test_every_elite_has_a_card_with_its_plan(tmp_path):
    run = ev.evolve(made_bodies.make_config(), simulate=made_bodies.simulate)
    make_body_page(run).write(tmp_path / "bodies.html")
    html = (tmp_path / "bodies.html").read_text()
    elites = run.find_elites()
    assert html.count("<details>") == len(elites)
    assert all(lesson.pupil.body.to_plan() in html for lesson in elites.values())
    assert "<video" not in html


def test_a_run_without_bodies_has_no_page():
    with pytest.raises(RunError, match="resume the run"):
        make_body_page(BodyRun(made_bodies.make_config(), BodyRecord(), ()))


def test_bodies_of_an_unfinished_rung_are_shown(tmp_path):
    learning = ev.LearningConfig(population_size=4, rungs=(1, 2), exam_trials=1)
    bodies = ev.BodiesConfig(algorithm="halving", largest=3, children=3)
    run = ev.evolve(made_bodies.make_config(learning=learning, bodies=bodies), simulate=made_bodies.simulate)
    elites = run.find_elites()
    assert {lesson.rung for lesson in elites.values()} == {0}
    make_body_page(run).write(tmp_path / "bodies.html")
    assert (tmp_path / "bodies.html").read_text().count("<details>") == len(elites)
