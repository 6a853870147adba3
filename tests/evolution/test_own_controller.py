"""Controllers of users in runs: on every backend, in the record, judged, played, as a policy, resumed or refused."""

import json
import sys
from pathlib import Path

import made_bodies
import numpy as np
import pytest
from own_controllers import Hold, Wave

import evolution as ev
from evolution._src.cli.main import main
from symbrion_gym._src.environment.organism_env import OrganismEnv

TINY = {
    "arena": "truth",
    "modules": 4,
    "generations": 2,
    "population_size": 4,
    "trials": 1,
    "environment": {"duration": 0.4},
}

ALLOW = ("own_controllers", "vanishing_controller")


@pytest.fixture(scope="module")
def run() -> ev.Run:
    return ev.evolve(ev.EvolutionConfig(controller=Wave, **TINY))


def test_a_run_searches_its_genes(run):
    assert run.champion is not None
    assert run.champion.names == ("size", "lag")
    assert all(not entry.outcome.error for entry in run.record.entries)


@pytest.mark.slow
def test_worker_processes_find_it(run):
    other = ev.evolve(ev.EvolutionConfig(controller="own_controllers:Wave", backend="processes", **TINY))
    assert (other.history["best"] == run.history["best"]).all()


def test_it_is_evaluated_judged_played_and_a_policy(run):
    fitness, outcomes = ev.evaluate(np.zeros((2, 2)), modules=4, controller=Wave, trials=1, duration=0.4)
    assert len(fitness) == 2
    assert not outcomes[0].error
    assert not ev.judge(run.champion, "truth", trials=2).error
    recording = ev.play(run.champion, "truth")
    assert np.isfinite(recording.progress)
    env = OrganismEnv(modules=4, duration=0.4, sensors=("hinge_angle",))
    policy = ev.ChampionPolicy(run.champion, env.observation_structure)
    observation, _ = env.reset(seed=0)
    rows = np.stack([observation, observation])
    actions, state = policy.predict(rows)
    again, _ = policy.predict(rows, state, episode_start=np.array([True, False]))
    assert again[0] == pytest.approx(actions[0])
    assert not np.array_equal(again[1], actions[1])
    env.close()


def test_a_record_names_it_and_is_resumed(run, tmp_path, monkeypatch):
    folder = tmp_path / "run"
    ev.evolve(ev.EvolutionConfig(controller=Wave, folder=str(folder), **TINY))
    stored = (folder / "config.json").read_text()
    for text in ('"own_controllers:Wave"', '"wave"', '"3"'):
        assert text in stored
    more = ev.resume(folder, generations=3, allow=ALLOW)
    assert (more.history["best"][:2] == run.history["best"]).all()
    champion = ev.load_champion(folder)
    assert champion.names == ("size", "lag")
    assert json.loads((folder / "champion.json").read_text())
    monkeypatch.setattr(Wave, "version", "4")
    with pytest.raises(ev.RunError, match=r"version '4', the record of '3'"):
        ev.resume(folder, generations=4, allow=ALLOW)


def test_a_run_whose_controller_is_gone_is_refused(tmp_path, monkeypatch):
    module = tmp_path / "vanishing_controller.py"
    module.write_text("from own_controllers import Wave\n\n\nclass Mine(Wave):\n    name = 'mine'\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    folder = tmp_path / "run"
    run = ev.evolve(ev.EvolutionConfig(controller="vanishing_controller:Mine", folder=str(folder), **TINY))
    module.unlink()
    monkeypatch.delitem(sys.modules, "vanishing_controller")
    read = ev.load_run(folder)
    assert (read.history == run.history).all()
    assert (read.champion, read.is_solved) == (run.champion, run.is_solved)
    with pytest.raises(SystemExit) as end:
        main(["replay", str(folder), "--help"])
    assert not end.value.code
    assert "vanishing_controller" not in sys.modules
    with pytest.raises(ev.RunError, match="'vanishing_controller' cannot be imported"):
        ev.resume(folder, generations=3, allow=ALLOW)


def test_what_a_record_or_worker_cannot_find_again_is_refused_at_once(tmp_path: Path):
    for options in ({"folder": str(tmp_path / "run")}, {"backend": "processes"}):
        with pytest.raises(ev.RunError, match="lambda"):
            ev.EvolutionConfig(controller=lambda organism: Wave(organism), **TINY, **options)
    run = ev.evolve(
        ev.EvolutionConfig(controller=lambda organism: Wave(organism), **TINY | {"generations": 1})
    )
    assert run.champion is not None


def test_what_bodies_with_it_have_learned_is_read_where_it_is_allowed(tmp_path):
    bodies = ev.BodiesConfig(algorithm="exhaustive", smallest=2, largest=3, children=20)
    config = made_bodies.make_config(
        controller=Wave, track_control="constant", bodies=bodies, folder=tmp_path / "run"
    )
    run = ev.evolve(config, simulate=made_bodies.simulate)
    unknown, known = ev.load_run(tmp_path / "run"), ev.load_run(tmp_path / "run", ALLOW)
    assert (unknown.results, unknown.champion) == ((), run.champion)
    assert (known.results, known.champion) == (run.results, run.champion)
    with pytest.raises(ev.RunError, match="is not allowed"):
        ev.confirm(unknown, simulate=made_bodies.simulate)
    assert ev.confirm(known, 3, simulate=made_bodies.simulate).champion.trials


def test_its_own_mistakes_end_the_run_and_are_named():
    with pytest.raises(ev.RunError, match=r"act of controller 'hold' returns actions of shape \(8, 9\)"):
        ev.evaluate(np.zeros((1, 0)), modules=4, controller=Hold(9), trials=1, duration=0.4)


def test_the_command_line_finds_a_module_in_the_working_folder(tmp_path, monkeypatch):
    (tmp_path / "nearby_controller.py").write_text("from own_controllers import Wave\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    words = "evolve --arena truth --modules 4 --controller nearby_controller:Wave --generations 1 --trials 1 --quiet"
    with pytest.raises(SystemExit) as end:
        main([*words.split(), "--population-size", "4", "--folder", str(tmp_path / "run")])
    assert end.value.code == 0
    assert ev.load_champion(tmp_path / "run").controller.source == "own_controllers:Wave"
