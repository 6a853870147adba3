"""The swarm among the paper's experiments: its rows, files and section, where it was told and where it was not."""

from dataclasses import replace
from pathlib import Path

import pytest

import symbrion_gym as sg
from evolution._src.experiments.paper import swarm
from evolution._src.experiments.paper.config import PaperConfig
from evolution._src.experiments.paper.page.context import PaperContext
from evolution._src.experiments.paper.page.swarm import add_swarm
from evolution._src.experiments.swarm.config import StoryConfig
from evolution._src.experiments.swarm.story import Story, tell_story
from evolution._src.report.page import Page


def test_stories_become_rows_files_and_a_section(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def tell_briefly(config: StoryConfig, *about: object) -> Story:
        return tell_story(replace(config, gather_time=1.0), about[0], None)  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(swarm, "load_arena", lambda folder, name: sg.load_arena(name))
    monkeypatch.setattr(swarm, "tell_story", tell_briefly)
    monkeypatch.setattr(swarm, "encode_film", lambda *about: None)
    config, champion = PaperConfig(modules=2, swarm_stories=2, seed=5), None
    figures = swarm.tell_stories(tmp_path, champion, config)  # pyright: ignore[reportArgumentType]
    assert [row["seed"] for row in figures["stories"]] == [5, 6]
    assert [row["docks"] for row in figures["without_docking"]] == [False, False]
    assert not figures["film"]
    assert (tmp_path / "films" / "swarm_timeline.png").read_bytes().startswith(b"\x89PNG")
    assert not (tmp_path / "films" / "swarm.mp4").exists()
    record = {"figures": figures, "machine": "a processor", "date": "2026-11-23"}
    page = Page("title")
    add_swarm(PaperContext(tmp_path, config, {"swarm": record}, page))
    page.write(tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text()
    assert "0 of 2 swarms are across" in text
    assert "failed attempts to dock" in text


def test_a_reduced_run_has_no_section(tmp_path: Path) -> None:
    page = Page("title")
    add_swarm(PaperContext(tmp_path, PaperConfig(), {}, page))
    page.write(tmp_path / "page.html")
    assert "swarm" not in (tmp_path / "page.html").read_text()
