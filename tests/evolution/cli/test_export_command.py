"""`symbrion export`: a ready-made arena for other simulators, and refusals before anything is written."""

import json
from typing import get_args, get_type_hints

import mujoco
import pytest

import symbrion_gym as sg
from evolution._src.cli.commands.view import Export
from evolution._src.cli.main import run
from symbrion_gym._src.arenas.export.export import FORMATS


def test_the_formats_are_those_of_the_library():
    assert list(get_args(get_type_hints(Export)["to"])) == list(FORMATS)


def test_an_exported_arena_is_loaded_by_mujoco(tmp_path, capsys):
    assert run(["export", "truth", "--to", "mjcf", "--out", str(tmp_path / "out"), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["num_solids"] == len(sg.load_arena("truth").pieces)
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "out/arena.xml")).ngeom == summary["num_solids"] + 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nowhere"], "no arena 'nowhere'"),
        (["truth", "--to", "fbx"], "mjcf"),
        (["truth", "--out", "{folder}"], "is not empty and holds no export"),
    ],
)
def test_refusals_write_nothing(words, message, tmp_path, capsys):
    (tmp_path / "notes.txt").write_text("mine")
    assert run(["export", *(word.format(folder=tmp_path) for word in words)]) == 2
    assert message in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]
