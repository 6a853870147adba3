"""Evolution on a scan never reads the truth: it runs where there is none."""

import shutil
from pathlib import Path

import pytest

import evolution as ev
import symbrion_gym as sg
from symbrion_gym._src.arenas import arena as arena_module
from symbrion_gym._src.arenas import making
from symbrion_gym._src.arenas.course import Course, StairsCourse
from symbrion_gym._src.assets import find_assets


class TruthWasRead(Exception):
    """The truth was looked at."""


@pytest.fixture
def no_truth(monkeypatch, tmp_path):
    """Take away every way to the truth: its class, its files, what makes it."""

    def refuse(*_, **__):
        raise TruthWasRead

    shutil.copytree(find_assets() / "arenas" / "gsrm", tmp_path / "assets" / "arenas" / "gsrm")
    monkeypatch.setattr(making, "find_assets", lambda: tmp_path / "assets")
    for kind in (Course, StairsCourse):
        monkeypatch.setattr(kind, "__init__", refuse)
    monkeypatch.setattr(arena_module.Arena, "from_course", refuse)
    read_text, opened = Path.read_text, Path.open

    def check(path):
        if {"truth", "simple"} & set(Path(path).parts):
            raise TruthWasRead(path)

    def read(self, *args, **kwargs):
        check(self)
        return read_text(self, *args, **kwargs)

    def open_it(self, *args, **kwargs):
        check(self)
        return opened(self, *args, **kwargs)

    monkeypatch.setattr(Path, "read_text", read)
    monkeypatch.setattr(Path, "open", open_it)


def make_config(**fields) -> ev.EvolutionConfig:
    return ev.EvolutionConfig(
        arena="gsrm", generations=1, population_size=4, trials=1, workers=1, stop_when_solved=False, **fields
    )


def test_the_truth_is_really_out_of_reach(no_truth):
    with pytest.raises(TruthWasRead):
        sg.load_arena("truth")
    with pytest.raises(TruthWasRead):
        sg.OrganismEnv(arena="truth")
    with pytest.raises(TruthWasRead):
        sg.Course()


def test_evolution_on_a_scan_runs_without_the_truth(no_truth, tmp_path):
    run = ev.evolve(make_config(folder=str(tmp_path / "run"), environment=(("duration", 4.0),)))
    assert len(run.history) == 1
    assert ev.load_run(tmp_path / "run").history == run.history
