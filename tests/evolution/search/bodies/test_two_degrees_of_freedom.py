"""Bodies of up to twelve modules with two degrees of freedom a module and steered tracks, from search to replay."""

from dataclasses import replace

import made_bodies
import pytest

import evolution as ev
from evolution._src.controllers.oscillators import TWIST_GENES
from evolution._src.errors import RunError
from evolution._src.report.body_page import make_body_page

BODIES = ev.BodiesConfig(algorithm="surrogate", largest=12, dofs=2, children=4, population_size=6)


def make_config(**changes):
    learning = ev.LearningConfig(population_size=4, levels=(1, 2), exam_trials=1)
    return made_bodies.make_config(**{"bodies": BODIES, "learning": learning, "iterations": 3} | changes)


@pytest.mark.parametrize("algorithm", ["surrogate", "random"])
def test_every_trial_has_modules_with_both_joints(algorithm):
    tried = []

    def watch(jobs, threads):
        tried.extend(job.trials.find_organism() for job in jobs)
        return made_bodies.simulate(jobs, threads)

    run = ev.evolve(make_config(bodies=replace(BODIES, algorithm=algorithm)), simulate=watch)
    assert {body.scout.dofs for body in tried} == {2}
    assert max(body.num_modules for body in tried) > 8
    sizes = {result.body.num_modules for result in run.record.results}
    assert sizes <= set(range(1, 13))
    for result in run.record.results:
        twists = {name.rsplit("_", 1)[0] for name in result.names if name.startswith("twist_")}
        assert twists == (set(TWIST_GENES) if result.body.num_modules > 1 else set())
        assert "track_steering" in result.names


def test_the_folder_the_champion_and_the_page_keep_both_joints(tmp_path):
    config = make_config(folder=tmp_path / "run", iterations=2)
    ev.evolve(config, simulate=made_bodies.simulate)
    resumed = ev.resume_bodies(tmp_path / "run", iterations=3, simulate=made_bodies.simulate)
    whole = ev.evolve(make_config(), simulate=made_bodies.simulate)
    assert resumed.history == whole.history
    champion = ev.load_champion(tmp_path / "run")
    assert champion.find_organism().scout.dofs == 2
    assert champion == resumed.champion
    make_body_page(resumed).write(tmp_path / "bodies.html")
    assert resumed.best is not None
    assert resumed.best.body.to_plan() in (tmp_path / "bodies.html").read_text()


@pytest.mark.parametrize("dofs", [0, 3])
def test_other_numbers_are_refused(dofs):
    with pytest.raises(RunError, match="dofs"):
        ev.BodiesConfig(dofs=dofs)
