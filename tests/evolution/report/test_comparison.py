"""Runs side by side: one figure, one table, and clear words where there is nothing to compare."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import toys

from evolution._src.cli.main import run as run_command
from evolution._src.report.comparison import COLUMNS, tabulate
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve
from evolution._src.search.stages import Stage

TOY = EvolutionConfig(arena="truth", generations=4, stop_when_solved=False)


@pytest.fixture
def folders(tmp_path: Path) -> list[Path]:
    staged = replace(TOY, seed=1, stages=(Stage("simple", 2, "budget"), Stage("truth")))
    for name, config in (("fine", TOY), ("staged", staged)):
        evolve(replace(config, folder=str(tmp_path / name)), simulate=toys.bowl)
    return [tmp_path / "fine", tmp_path / "staged"]


def test_a_table_shows_the_results_of_runs(folders, capsys):
    assert run_command(["compare", *map(str, folders), "--json"]) == 0
    first, second = json.loads(capsys.readouterr().out)["runs"]
    assert tuple(first) == COLUMNS
    assert (first["run"], first["arenas"], first["seed"]) == (str(folders[0]), "truth", 0)
    assert second["arenas"] == "simple -> truth"
    assert second["generations"] == 4
    assert second["genotypes"] == 48


@pytest.mark.parametrize("name", ["curves.png", "page.html"])
def test_figure_and_page_are_written(folders, tmp_path, name):
    assert run_command(["compare", *map(str, folders), "--out", str(tmp_path / name), "--quiet"]) == 0
    content = (tmp_path / name).read_bytes()
    assert content.startswith(b"\x89PNG" if name.endswith("png") else b"<!")
    if name.endswith("html"):
        assert all(str(folder).encode() in content for folder in folders)


def test_a_run_that_has_just_begun_has_a_row_but_no_curve(tmp_path, capsys):
    folder = tmp_path / "young"
    run = evolve(replace(TOY, generations=0, folder=str(folder)), simulate=toys.bowl)
    assert tabulate({"young": run})[0][-1] == "none yet"
    assert run_command(["compare", str(folder), "--out", str(tmp_path / "page.html")]) == 1
    assert "nothing to draw yet" in capsys.readouterr().err
    assert not (tmp_path / "page.html").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [([], "run folders"), (["absent"], "contains no run"), (["RUN", "--out", "curves.txt"], ".png, .html")],
)
def test_wrong_usage_is_refused(folders, words, message, capsys):
    assert run_command(["compare", *[str(folders[0]) if word == "RUN" else word for word in words]]) == 2
    assert message in capsys.readouterr().err
