"""`symbrion evolve --bodies` and `resume`: confirmation, what stops a search, the command that goes on, progress."""

import re
import shlex

import made_bodies
import pytest

import evolution as ev
from evolution._src.backends.scoring import Outcome
from evolution._src.cli.commands.evolve import describe_stop
from evolution._src.cli.main import run
from evolution._src.search.bodies.run import describe_success
from evolution._src.search.record import CONFIRMATION

SEARCH = ["evolve", "--arena", "truth", "--task", "cross_gap", "--bodies", "1", "2"]


@pytest.fixture(autouse=True)
def made(monkeypatch):
    """Physics that is made: no robot moves; as in `made_bodies`, nothing succeeds."""
    monkeypatch.setattr("evolution._src.backends.rollout.simulate", made_bodies.simulate)
    monkeypatch.setattr("evolution._src.search.loop.warm_up", lambda *_: None)


def test_the_champion_is_confirmed_and_said_to_be(tmp_path, capsys):
    assert run([*SEARCH, "--generations", "1", "--quiet", "--folder", str(tmp_path / "run")]) == 0
    text = capsys.readouterr().out
    assert "no success: 0 of 8 fresh trials" in text
    assert "more learning may help" in text
    champion = ev.load_champion(tmp_path / "run")
    assert (champion.successes, champion.trials) == (0, 8)
    assert ev.load_run(tmp_path / "run").champion == champion


def test_successes_are_said_in_plain_words(tmp_path):
    def simulate(jobs, threads):
        counts = [(job.trials.count, job.trials.count - (job.trials.seed[1] == CONFIRMATION)) for job in jobs]
        return [Outcome(1.0, 0.0, (True,) * won + (False,) * (count - won)) for count, won in counts]

    found = ev.evolve(made_bodies.make_config(), simulate=simulate)
    assert "succeeded in 1 of 1 trials of its exam, not confirmed" in describe_success(found)
    found = ev.evolve(made_bodies.make_config(folder=tmp_path / "run"), simulate=simulate)
    ev.confirm(found, simulate=simulate)
    assert "succeeded in 7 of 8 fresh trials" in describe_success(ev.load_run(tmp_path / "run"))


def test_the_command_that_is_proposed_goes_on(tmp_path, capsys):
    folder = tmp_path / "a run"
    assert run([*SEARCH, "--generations", "1", "--folder", str(folder)]) == 0
    printed = capsys.readouterr().out
    assert "stopped by --generations 1; to go on: " in printed
    command = re.search("to go on: symbrion (.*)", printed)
    assert command is not None
    before = len(ev.load_run(folder).history)
    assert run([*shlex.split(command[1])]) == 0
    assert len(ev.load_run(folder).history) > before


def test_a_search_without_anything_left_says_so():
    config = made_bodies.make_config(iterations=3)
    found = ev.evolve(config, simulate=made_bodies.simulate)
    assert describe_stop(found) == "every body has learned to the end: nothing is left to be tried"


@pytest.mark.parametrize("command", ["evolve", "resume"])
def test_an_interruption_names_the_command_that_goes_on(tmp_path, capsys, monkeypatch, command):
    folder = str(tmp_path / "run")
    if command == "resume":
        assert run([*SEARCH, "--generations", "1", "--folder", folder]) == 0
        capsys.readouterr()

    def interrupt(jobs, threads):
        raise KeyboardInterrupt

    monkeypatch.setattr("evolution._src.backends.rollout.simulate", interrupt)
    words = [*SEARCH, "--folder", folder] if command == "evolve" else ["resume", folder, "--generations", "2"]
    assert run([*words, "--quiet"]) == 130
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith(
        f"interrupted by the keyboard; all but what was unfinished is stored; to go on: symbrion resume {folder}"
    )
    monkeypatch.setattr("evolution._src.backends.rollout.simulate", made_bodies.simulate)
    assert run(["resume", folder, "--generations", "2"]) == 0
    assert len(ev.load_run(folder).history) == 2


def test_progress_within_an_iteration_changes_nothing(tmp_path):
    told = []
    config = made_bodies.make_config(
        iterations=2, bodies=ev.BodiesConfig(algorithm="exhaustive", largest=4, children=20)
    )
    silent = ev.evolve(config, simulate=made_bodies.simulate)
    shown = ev.evolve(config, simulate=made_bodies.simulate, progress=lambda *each: told.append(each))
    assert (shown.results, shown.champion) == (silent.results, silent.champion)
    first = [re.match(r"iteration 1 of 2: (\d+) of (\d+) trials", text) for text, _ in told]
    counts = [(int(each[1]), int(each[2])) for each in first if each]
    assert len(counts) > 3
    assert counts == sorted(counts)
    assert counts[-1][0] == counts[-1][1]
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_fewer_children_make_an_iteration_shorter(tmp_path, capsys):
    words = ["--bodies", "3", "--environment", "track_control", "skid", "--generations", "1"]
    assert run([*SEARCH[:5], *words, "--population-size", "2", "--folder", str(tmp_path / "run")]) == 0
    found = ev.load_run(tmp_path / "run")
    assert {result.body.num_modules for result in found.results} == {3}
    assert len(found.results) <= 2


def test_the_page_goes_into_a_folder_that_is_made(tmp_path):
    pytest.importorskip("matplotlib")
    folder, page = str(tmp_path / "run"), tmp_path / "no" / "folder" / "bodies.html"
    assert run([*SEARCH, "--generations", "1", "--folder", folder]) == 0
    assert run(["replay", folder, "--trials", "0", "--films", "0", "--page", str(page)]) == 0
    assert "Exam: 0 of 4 trials succeeded" in page.read_text(encoding="utf-8")
