"""`symbrion arena` and `symbrion view`: honest tables, warnings, pictures, exit codes."""

import dataclasses
import json

import numpy as np
import pytest
import trimesh
from PIL import Image

import symbrion_gym as sg
from evolution._src.cli.main import run


@pytest.fixture
def sheet(tmp_path, monkeypatch):
    """A mesh file of uneven ground."""
    monkeypatch.setenv("SYMBRION_CACHE", str(tmp_path / "cache"))
    mesh = trimesh.creation.box((4, 2, 0.2)).subdivide().subdivide()
    mesh.update_faces(mesh.face_normals[:, 2] > 0.5)
    mesh.remove_unreferenced_vertices()
    mesh.vertices[:, 2] += 0.05 * (mesh.vertices[:, 0] > 0.7)
    path = tmp_path / "sheet.ply"
    mesh.export(path)
    return path


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr("evolution._src.report.arena_view.WIDTH", 400)


def make(sheet, *words):
    return ["arena", str(sheet), "--kind", "prisms", "--out", str(sheet.parent / "out"), "--quiet", *words]


def test_quality_is_told_and_kept(sheet, capsys):
    assert run(make(sheet, "--viewpoint", "0", "0", "2", "1", "0", "2", "--accuracy", "0.01")) == 0
    table = capsys.readouterr().out
    for words in ("accuracy wanted", "accuracy reached", "beams that end", "free space", "pieces"):
        assert words in table
    kept = json.loads((sheet.parent / "out" / "arena.json").read_text())["quality"]
    assert kept["beams_surface"] == 1.0
    assert kept["beams_contact"] > 0.95
    assert kept["free_space"] < 0.01


def test_a_height_field_is_not_called_pieces(sheet, capsys):
    words = make(sheet)
    words[words.index("prisms")] = "hfield"
    assert run(words) == 0
    text = capsys.readouterr().out
    assert "a height field in" in text
    assert "none: a height field" in text
    assert "0 pieces" not in text


def test_a_missed_accuracy_is_a_warning_and_with_strict_an_exit_code(sheet, capsys, caplog):
    words = make(sheet, "--accuracy", "1e-9", "--max-pieces", "1", "--json")
    assert run(words) == 0
    summary = json.loads(capsys.readouterr().out)
    assert not summary["accuracy"]["is_reached"]
    assert len(summary["accuracy"]["worst"]) == 3
    assert "at (" in caplog.text
    assert run([*words, "--strict"]) == 3
    assert (sheet.parent / "out" / "arena.json").is_file()
    assert run(make(sheet, "--strict")) == 0


@pytest.mark.slow
def test_a_picture(sheet):
    assert run(make(sheet)) == 0
    seen = sheet.parent / "new" / "seen.png"
    assert run(["view", str(sheet.parent / "out"), "--picture", str(seen), "--quiet"]) == 0
    assert Image.open(seen).size[0] > 500


def test_an_arena_that_nobody_saw_is_drawn_without_a_way(tmp_path, capsys):
    arena = sg.load_arena("gsrm")
    dataclasses.replace(arena, unseen=tuple(range(len(arena.surface.faces)))).save(tmp_path / "a")
    assert run(["view", str(tmp_path / "a"), "--picture", str(tmp_path / "a.png")]) == 0
    assert "no route: an arena without surface that was seen" in capsys.readouterr().out
    assert Image.open(tmp_path / "a.png").size[0] > 500


@pytest.mark.slow
def test_view_tells_ground_and_route(sheet, capsys):
    assert run(["view", "truth", "--picture", str(sheet.parent / "a.png"), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["ground"]["drivable_area"] > 1.0
    assert summary["route"]["length"] > 0.5
    assert np.shape(summary["straight_way"]) == (2, 2)
    assert summary["bounds"][0] < summary["bounds"][1]
    assert run(["view", "truth", "--picture", str(sheet.parent / "a.png"), "--modules", "4", "--quiet"]) == 0
    printed = capsys.readouterr().out
    for part in (
        "it extends over x -",
        "route for 4 modules: (",
        "straight way for 4 modules: symbrion evolve --arena truth --modules 4 --start ",
    ):
        assert part in printed
    bare = ["view", "truth", "--picture", str(sheet.parent / "a.png"), "--json", "--layers", "surface"]
    assert run(bare) == 0
    assert "ground" not in json.loads(capsys.readouterr().out)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--accuracy", "0"], "--accuracy 0"),
        (["--max-pieces", "0"], "--max-pieces 0"),
        (["--reach", "0"], "--reach 0"),
        (["--viewpoint", "nan", "0", "0"], "not finite"),
    ],
)
def test_impossible_options_are_refused(sheet, words, message, capsys):
    assert run(make(sheet, *words)) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nowhere"], "no arena 'nowhere'"),
        (["."], ". holds no arena.json"),
        (["truth"], "no display"),
        (["truth", "--picture", "a.txt"], ".png"),
        (["truth", "--picture", "a.png", "--modules", "0"], "--modules 0"),
        (["truth", "--picture", "a.png", "--layers"], "--layers"),
        (["truth", "--picture", "a.png", "--layers", "fog"], "fog"),
    ],
)
def test_what_cannot_be_viewed_is_refused(words, message, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("evolution._src.cli.commands.view.has_display", lambda: False)
    assert run(["view", *words]) == 2
    assert message in capsys.readouterr().err
