"""The page of bodies: a card for each of the fittest, which opens."""

from dataclasses import replace
from types import SimpleNamespace

import made_bodies
import pytest

import evolution as ev
from evolution._src.errors import RunError
from evolution._src.report.body_page import make_body_page
from evolution._src.search.bodies.run import BodyRun
from evolution._src.search.record import CONFIRMATION, Record


def test_each_of_the_fittest_has_a_card_with_its_plan(tmp_path):
    run = ev.evolve(made_bodies.make_config(), simulate=made_bodies.simulate)
    make_body_page(run).write(tmp_path / "bodies.html")
    html = (tmp_path / "bodies.html").read_text()
    fittest = run.list_fittest()
    assert html.count("<details") == len(fittest)
    assert all(result.body.to_plan() in html for result in fittest)
    assert "<video" not in html


def test_a_run_without_bodies_has_no_page():
    with pytest.raises(RunError, match="resume the run"):
        make_body_page(BodyRun(made_bodies.make_config(), Record(), None))


def test_bodies_of_an_unfinished_level_are_shown(tmp_path):
    learning = ev.LearningConfig(population_size=4, levels=(1, 2), exam_trials=1)
    bodies = ev.BodiesConfig(largest=3, children=3)
    run = ev.evolve(made_bodies.make_config(learning=learning, bodies=bodies), simulate=made_bodies.simulate)
    fittest = run.list_fittest()
    assert {result.level for result in fittest} == {0}
    make_body_page(run).write(tmp_path / "bodies.html")
    html = (tmp_path / "bodies.html").read_text()
    assert html.count("<details") == len(fittest)
    assert "champion, not confirmed" in html


def test_the_confirmed_champion_has_a_card_of_its_own(tmp_path, monkeypatch):
    def simulate(jobs, threads):
        """Bodies of two modules alone succeed in fresh trials."""
        outcomes = []
        for job, outcome in zip(jobs, made_bodies.simulate(jobs, threads), strict=True):
            is_fresh = job.trials.seed[1] == CONFIRMATION
            modules = job.trials.find_organism().num_modules
            outcomes.append(replace(outcome, succeeded=(is_fresh and modules == 2,) * job.trials.count))
        return outcomes

    ev.evolve(made_bodies.make_config(folder=tmp_path / "run"), simulate=simulate)
    ev.confirm(ev.load_run(tmp_path / "run"), 20, simulate=simulate)
    run = ev.load_run(tmp_path / "run")
    film = SimpleNamespace(frames=[0], fps=5)
    monkeypatch.setattr("evolution._src.report.body_page.play", lambda *_, **__: film)
    monkeypatch.setattr("evolution._src.report.body_page.encode_video", lambda *_: b"film")
    make_body_page(run, num_films=2).write(tmp_path / "bodies.html")
    html = (tmp_path / "bodies.html").read_text()
    first, *others = html.split("<details")[1:]
    assert run.confirmation.result.body.num_modules == 2
    assert "class=marked" in first
    assert ">champion<" in first
    assert "48 of 48 fresh trials" in first
    assert f"fitness {run.confirmation.result.fitness:.2f} m" in first
    assert not any("champion<" in card for card in others)
    assert [">&#9654; film<" in card for card in (first, *others)][:3] == [True, True, False]
    assert "succeeded in 48 of 48 fresh trials" in html
    assert "Fitness is what the scoring of the run" in html
    champion = (run.confirmation.result.body.canonical_text, run.confirmation.result.level)
    fittest = {(result.body.canonical_text, result.level) for result in run.list_fittest()}
    assert len(others) + 1 == len(fittest | {champion})
