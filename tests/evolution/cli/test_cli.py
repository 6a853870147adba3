"""The command line: help, refusals in one line, and no partial output."""

import json
from importlib.metadata import version

import numpy as np
import pytest
import toys

import evolution as ev
import symbrion_gym as sg
from evolution._src.cli.commands import COMMANDS
from evolution._src.cli.commands.replay import choose_arena
from evolution._src.cli.main import run


@pytest.fixture
def cloud(tmp_path):
    """A file of points on a wavy sheet."""
    points = np.random.default_rng(0).uniform(-1, 1, (3000, 3))
    points[:, 2] = 0.1 * np.sin(3 * points[:, 0])
    path = tmp_path / "sheet.xyz"
    np.savetxt(path, points)
    return path


def refuse(words, code, capsys):
    """Run a command line that must fail with one line on standard error; return that line."""
    assert run(words) == code
    errors = capsys.readouterr().err
    (line,) = [line for line in errors.splitlines() if line.startswith("symbrion: ")]
    assert "Traceback" not in errors
    return line


@pytest.mark.slow
def test_a_file_beyond_the_limit_is_refused_until_it_is_raised(cloud, tmp_path, capsys):
    words = ["reconstruct", str(cloud), "--raw", "--units", "100", "--out", str(tmp_path / "a.ply")]
    line = refuse([*words, "--max-gigabytes", "0.00005"], 1, capsys)
    assert "sheet.xyz" in line
    assert "limit of 5e-05 GB" in line
    assert "--max-gigabytes" in line
    assert "above 0" in refuse([*words, "--max-gigabytes", "0"], 2, capsys)
    assert not (tmp_path / "a.ply").exists()
    assert run([*words, "--max-gigabytes", "0.001", "--quiet"]) == 0
    assert "the surface extends over x " in capsys.readouterr().out


@pytest.mark.parametrize("name", COMMANDS)
def test_help_teaches(name, capsys):
    assert run([name, "--help"]) == 0
    text = capsys.readouterr().out
    assert "--json" in text
    assert ("--seed" in text) == (name not in ("resume", "export"))
    assert "Example" in text


def test_help_lists_every_subcommand(capsys):
    assert run(["--help"]) == 0
    text = capsys.readouterr().out
    assert all(name in text for name in COMMANDS)


def test_version(capsys):
    assert run(["--version"]) == 0
    assert capsys.readouterr().out == f"symbrion-gym {version('symbrion-gym')}\n"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("evolv", "command: there is no 'evolv'; there are: evolve, survey, "),
        ("reconstruct a.ply --unit mile", "one of ('cm', 'ft', 'in', 'm', 'mm', 'us-ft'); see symbrion"),
        ("--foo", "; see symbrion --help"),
        ("survey truth --seed -1", "--seed -1 is too few"),
        ("survey nowhere", "no arena 'nowhere'"),
        ("survey truth --out log.txt", ".npz"),
        ("reconstruct absent.ply", "no such file"),
        ("reconstruct", "SCAN"),
        ("reconstruct absent.ply --method poisson", "poisson"),
        ("arena absent.ply", "no such file"),
        ("evolve --seed x", "--seed: 'x' is not a whole number; see symbrion evolve --help"),
        ("evolve --trials x", "--trials: 'x' is not a whole number; see symbrion evolve --help"),
        ("evolve --bodies x", "--bodies: 'x' is not whole numbers; see symbrion evolve --help"),
        ("evolve --bodies 0 3", "smallest must be"),
        ("evolve --bodies 2 1", "smallest <= largest modules, got 2 and 1; see symbrion evolve --help"),
        (
            "evolve --bodies 1 2 3",
            "for example --bodies 1 8; or one number for both; see symbrion evolve --help",
        ),
        ("evolve --bodies 1 3 --backend warp", "backend: there is no 'warp'; there are: batch"),
        ("evolve --algorithm random", "--algorithm is of a search for bodies"),
        ("evolve --algorithm foo --bodies 1 2", "'exhaustive', "),
        ("evolve --start 1", "--start: '1' is not floor, pit or 2 numbers; see symbrion evolve --help"),
        ("evolve --modules 0", "modules must be a whole number from 1 to 50, got 0"),
        (
            "evolve --arena nowhere",
            "no arena 'nowhere'; give one of truth, simple, stairs, gsrm, gg, an arena folder or",
        ),
        ("evolve --generations 0", "--generations 0"),
        ("evolve --goal 1", "`FLOAT FLOAT`; see symbrion"),
        ("evolve --organism SF0F0000", "a body of 1 module has no hinge"),
        ("evolve --organism H --modules 8", "modules is 8 and organism, too, is given"),
        ("evolve --workers 0", "--workers 0 is too few"),
        ("evolve --task", "see symbrion evolve --help"),
        ("resume absent", "contains no run"),
        ("resume absent --seed 1", "--seed"),
        ("resume absent --backend cluster", "cluster"),
        ("replay absent", "contains no run"),
        ("replay", "see symbrion replay --help"),
        ("bench-suite run --methods x", "perhaps you meant --method; see symbrion bench-suite --help"),
        ("demo --seed -5", "--seed -5 is too few"),
    ],
)
def test_wrong_usage_is_one_line_that_names_the_help_and_no_class_of_ours(
    words, message, capsys, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert run(words.split()) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("symbrion: ")
    assert message in line
    assert line.count("; see symbrion ") == 1
    assert line.endswith(" --help")
    assert not any(word in line for word in ("Error parsing", "NoneType", "<class", "Got errors"))
    assert list(tmp_path.iterdir()) == []


def test_what_is_in_the_folder_of_a_training_is_named(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("pump/arena/arena.json", "pump/run/config.json"):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_text("{}")
    assert "give pump/arena" in refuse(["view", "pump", "--picture", "a.png"], 2, capsys)
    assert "give pump/run" in refuse(["replay", "pump"], 2, capsys)


@pytest.mark.parametrize("content", ["", "nan nan nan\n" * 100, "0 0 0\n", "hello world\n", "1 2\n3 4\n"])
def test_unusable_clouds_are_refused(content, capsys, tmp_path):
    scan = tmp_path / "scan.xyz"
    scan.write_text(content)
    assert "scan.xyz" in refuse(["reconstruct", str(scan), "--out", str(tmp_path / "out.ply")], 1, capsys)
    assert list(tmp_path.iterdir()) == [scan]


@pytest.mark.parametrize("words", ["--units 3", "--units -1", "--crop 1 0 0 1 0 1"])
def test_too_few_units_and_an_empty_crop_are_refused(words, cloud, capsys):
    assert " ".join(words.split()[:2]) in refuse(["reconstruct", str(cloud), *words.split()], 2, capsys)


@pytest.mark.parametrize(
    ("words", "option"),
    [
        (["survey", "truth", "--out", "file/log.npz"], "--out"),
        (["reconstruct", "file", "--out", "file/surface.npz"], "--out"),
        (["arena", "file", "--out", "file/arena"], "--out"),
        (["evolve", "--folder", "file/run"], "--folder"),
        (["demo", "--out", "file/demo"], "--out"),
    ],
)
def test_outputs_that_cannot_be_written_are_refused(words, option, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("in the way")
    assert option in refuse(words, 2, capsys)


@pytest.mark.slow
def test_reconstruct_writes_mesh_and_summary(cloud, tmp_path, capsys):
    out = tmp_path / "surface.ply"
    assert run(["reconstruct", str(cloud), "--units", "100", "--out", str(out), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["points"] == pytest.approx(3000, rel=0.1)
    assert summary["quality"]["topology"]["non_manifold_edges"] == 0
    assert out.stat().st_size > 1000
    assert sorted(p.name for p in tmp_path.iterdir()) == ["sheet.xyz", "surface.ply"]


@pytest.mark.slow
def test_evolve_then_resume_then_replay(tmp_path, capsys):
    folder = tmp_path / "run"
    start = ["evolve", "--arena", "truth", "--modules", "3", "--population-size", "4", "--trials", "1"]
    assert run([*start, "--json", "--generations", "2", "--folder", str(folder)]) == 0
    assert json.loads(capsys.readouterr().out)["generations"] == 2
    assert "contains this run already" in refuse(
        [*start, "--json", "--generations", "2", "--folder", str(folder)], 1, capsys
    )
    assert run(["resume", str(folder), "--generations", "3", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["generations"] == 3
    assert run(["replay", str(folder), "--trials", "2", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["trials"] == 2


def test_a_champion_is_judged_under_the_conditions_of_its_run(tmp_path, monkeypatch):
    folder, seen = str(tmp_path / "a"), []
    conditions = ev.Randomization(friction=(0.6, 0.6))
    options = {"generations": 1, "population_size": 4, "trials": 1, "duration": 0.5, "modules": 2}
    ev.evolve(ev.EvolutionConfig(arena="truth", folder=folder, randomization=conditions, **options))
    judge = ev.judge
    monkeypatch.setattr(ev, "judge", lambda *a, **k: seen.append(k["randomization"]) or judge(*a, **k))
    assert run(["replay", folder, "--trials", "1", "--quiet"]) == 0
    assert seen == [ev.Randomization(friction=(0.6, 0.6), stretch=(1.0,))]


@pytest.mark.slow
def test_a_search_for_bodies_is_replayed_and_has_no_curve(tmp_path, capsys):
    bodies = ev.BodiesConfig(largest=2, children=2)
    learning = ev.LearningConfig(population_size=4, levels=(1,), exam_trials=1)
    folder = str(tmp_path / "bodies")
    arena = str(tmp_path / "mine")
    sg.load_arena("truth").save(arena)
    options = {"arena": arena, "track_control": "body", "duration": 0.5, "folder": folder, "iterations": 1}
    ev.evolve(ev.BodyEvolutionConfig(task="cross_gap", bodies=bodies, learning=learning, **options))
    assert run(["replay", folder, "--trials", "1", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["trials"], told["arena"]) == (1, arena)


DAMAGE = {
    "friction": lambda about: about | {"friction": "rough"},
    "num_pieces": lambda about: about | {"num_pieces": 2},
    "quality": lambda about: about | {"quality": None},
}


@pytest.mark.parametrize("field", DAMAGE)
def test_a_damaged_arena_is_refused_by_file_and_field(field, tmp_path, capsys):
    sg.load_arena("truth").save(tmp_path / "pit")
    about = tmp_path / "pit" / "arena.json"
    about.write_text(json.dumps(DAMAGE[field](json.loads(about.read_text()))))
    for words in (
        ["evolve", "--arena", str(tmp_path / "pit"), "--folder", str(tmp_path / "run")],
        ["survey", str(tmp_path / "pit"), "--out", str(tmp_path / "log.npz")],
    ):
        message = refuse(words, 1, capsys)
        assert "arena.json" in message
        assert field in message
    assert [path.name for path in tmp_path.iterdir()] == ["pit"]


@pytest.mark.parametrize(
    ("field", "value"), [("sigma", float("nan")), ("modules", 10**9), ("sigma", "7"), ("wings", 2)]
)
def test_a_damaged_run_is_refused_by_file_and_field(field, value, tmp_path, capsys):
    config = ev.EvolutionConfig(arena="truth", generations=1, folder=str(tmp_path / "run"))
    ev.evolve(config, simulate=toys.bowl)
    path = tmp_path / "run" / "config.json"
    content = json.loads(path.read_text())
    content["config"][field] = value
    path.write_text(json.dumps(content))
    for command in ("resume", "replay"):
        message = refuse([command, str(tmp_path / "run")], 1, capsys)
        assert "config.json" in message
        assert field in message


@pytest.mark.parametrize(
    ("arena", "wanted"),
    [("gsrm", "truth"), ("truth", "truth"), ("arenas/mine", "arenas/mine"), ("stairs", "stairs")],
)
def test_a_champion_of_an_own_arena_is_replayed_there(arena, wanted):
    assert choose_arena(arena) == wanted
