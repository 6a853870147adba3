"""`symbrion reconstruct --tile`: large scans on the command line."""

import json

import numpy as np
import pytest

from benchmarks.material.landscape import make_landscape, write_scan
from evolution._src.cli.main import run


@pytest.fixture
def scan(tmp_path):
    write_scan(tmp_path / "scan.npy", make_landscape(8.0, 0.5, 0.2, roughness=3.0), 4000, 0.01)
    return tmp_path / "scan.npy"


@pytest.mark.slow
def test_a_scan_becomes_a_folder_of_tiles(scan, capsys):
    words = f"reconstruct {scan} --tile 4 --units-per-area 3 --out {scan.parent}/tiles".split()
    assert run([*words, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["number"] == 4
    assert len(list((scan.parent / "tiles").glob("tile_*.npz"))) == 4


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--tile", "-1"], "tile is -1"),
        (["--tile", "5", "--workers", "0"], "--workers 0 is too few"),
        (["--tile", "5", "--units", "100"], "--units does not go with --tile; use --units-per-area"),
        (["--tile", "5", "--thin", "0.1"], "--thin does not go with --tile"),
        (["--tile", "5", "--units-per-area", "0"], "units_per_area is 0"),
    ],
)
def test_impossible_tiles_are_refused(words, message, scan, capsys):
    assert run(["reconstruct", str(scan), "--out", str(scan.parent / "tiles"), *words]) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert not (scan.parent / "tiles").exists()


def test_a_folder_of_others_is_refused(scan, capsys):
    assert run(["reconstruct", str(scan), "--tile", "4", "--out", str(scan.parent)]) == 1
    assert "is not empty and holds no tiles" in capsys.readouterr().err
    assert np.load(scan).shape == (4000, 3)
