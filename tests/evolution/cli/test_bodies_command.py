"""`symbrion evolve --bodies` and `resume` of such a run: confirmation, limits, what is printed."""

import made_bodies
import pytest

import evolution as ev
from evolution._src.backends.scoring import Outcome
from evolution._src.cli.main import run
from evolution._src.search.bodies.run import describe_success
from evolution._src.search.record import CONFIRMATION

SEARCH = ["evolve", "--arena", "truth", "--task", "cross_gap", "--bodies", "1", "2", "--generations", "1"]
SEARCH += ["--quiet"]


@pytest.fixture
def made(monkeypatch):
    """Physics that is made: no robot moves; as in `made_bodies`, nothing succeeds."""
    monkeypatch.setattr("evolution._src.backends.rollout.simulate", made_bodies.simulate)
    monkeypatch.setattr("evolution._src.search.loop.warm_up", lambda *_: None)


def search(folder, *more):
    return run([*SEARCH, "--folder", str(folder), *more])


def test_the_champion_is_confirmed_and_said_to_be(tmp_path, capsys, made):
    assert search(tmp_path / "run") == 0
    text = capsys.readouterr().out
    assert "no success: 0 of 8 fresh trials" in text
    assert "more learning may help" in text
    champion = ev.load_champion(tmp_path / "run")
    assert (champion.successes, champion.trials) == (0, 8)
    assert ev.load_run(tmp_path / "run").champion == champion


def test_options_of_bodies_are_refused_elsewhere(tmp_path, capsys):
    assert run(["evolve", "--algorithm", "random", "--folder", str(tmp_path / "run")]) == 2
    assert "--algorithm is of a search for bodies" in capsys.readouterr().err


def test_successes_are_said_in_plain_words(tmp_path):
    def simulate(jobs, threads):
        counts = [(job.trials.count, job.trials.count - (job.trials.seed[1] == CONFIRMATION)) for job in jobs]
        return [Outcome(1.0, 0.0, (True,) * won + (False,) * (count - won)) for count, won in counts]

    found = ev.evolve(made_bodies.make_config(), simulate=simulate)
    assert "succeeded in 1 of 1 trials of its exam, not confirmed" in describe_success(found)
    found = ev.evolve(made_bodies.make_config(folder=tmp_path / "run"), simulate=simulate)
    ev.confirm(found, simulate=simulate)
    assert "succeeded in 7 of 8 fresh trials" in describe_success(ev.load_run(tmp_path / "run"))
