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
