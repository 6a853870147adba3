"""The story of a swarm, and docking trials: what counts as a success, refusals, equal seeds, resuming."""

import json
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import symbrion_gym as sg
from evolution._src.errors import RunError
from evolution._src.experiments.swarm import run
from evolution._src.experiments.swarm.film import choose_moments, draw_timeline
from evolution._src.experiments.swarm.run import SwarmRunConfig
from evolution._src.experiments.swarm.story import StoryConfig, tell_story
from symbrion_gym._src.swarm.behavior.memory import Mode
from symbrion_gym._src.swarm.placing import find_field


def test_a_swarm_that_may_not_dock_is_not_across() -> None:
    config = StoryConfig(arena="truth", num_robots=2, docks=False, gather_time=3.0)
    arena = sg.load_arena("truth")
    figures, track = tell_story(config, arena, None)
    assert not figures["success"]
    assert figures["across"] == 0
    assert figures["reason"] == "no whole organism within 3 s"
    assert figures["gathered"] is None
    assert (track.mode == Mode.EXPLORE).all()
    again = tell_story(config, arena, None)
    assert again[0] == figures
    for one, other in zip(track, again[1], strict=True):
        np.testing.assert_array_equal(one, other)
    assert len(draw_timeline(track, find_field(arena)).axes) == 2
    moments = choose_moments(track, None)
    assert moments == sorted(moments)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"num_robots": 1}, "at least 2"),
        ({"seed": -1}, "seed is -1; give 0 or more"),
        ({"gather_time": 0.0}, "gather_time"),
    ],
)
def test_bad_stories_are_refused(values: dict, message: str) -> None:
    with pytest.raises(RunError, match=message):
        StoryConfig(**values)


def test_an_interrupted_run_goes_on_to_equal_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "find_champion", lambda config, progress: None)
    monkeypatch.setattr(run, "BASELINE_TIME", 1.0)
    story = StoryConfig(arena="truth", num_robots=2, gather_time=2.0)

    def begin(stops: bool) -> Callable[[str], AbstractContextManager[SimpleNamespace]]:
        stories: list[str] = []

        def progress(what: str, share: float) -> None:
            stories.append(what)
            if stops and what == "gathering" and stories.count("gathering") == 2:
                raise KeyboardInterrupt

        return lambda title: nullcontext(SimpleNamespace(progress=progress))

    def tell(name: str, stops: bool = False) -> tuple:
        return run.run_swarm(SwarmRunConfig(tmp_path / name, story), begin(stops))  # pyright: ignore[reportArgumentType]

    track, rows = tell("straight")
    with pytest.raises(KeyboardInterrupt):
        tell("stopped", stops=True)
    again, same_rows = tell("stopped")
    assert same_rows == rows
    assert [row["docks"] for row in rows] == [True, False]
    for name in ("results.json", "swarm.json"):
        assert (tmp_path / "stopped" / name).read_bytes() == (tmp_path / "straight" / name).read_bytes()
    for one, other in zip(again, track, strict=True):
        np.testing.assert_array_equal(one, other)


def test_files_that_are_no_results_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "find_champion", lambda config, progress: None)
    monkeypatch.setattr(run, "BASELINE_TIME", 0.5)
    config = SwarmRunConfig(tmp_path, StoryConfig(arena="truth", num_robots=2, gather_time=0.5))

    def tell() -> tuple:
        return run.run_swarm(config, lambda title: nullcontext(SimpleNamespace(progress=lambda *told: None)))

    track, rows = tell()
    for name in track._fields:
        broken = track._replace(**{name: np.zeros(1)})
        np.savez(tmp_path / "track.npz", **broken._asdict())
        with pytest.raises(RunError, match=r"track\.npz is no track of a swarm"):
            tell()
    for content in ("[{}, {}]", "{}7", json.dumps([rows[0] | {"crossed": "late"}])):
        (tmp_path / "results.json").write_text(content)
        with pytest.raises(RunError, match=r"results\.json .*remove it"):
            tell()
