"""The story of a swarm, and docking trials: what counts as a success, refusals, equal seeds, resuming."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import symbrion_gym as sg
from evolution._src.errors import RunError
from evolution._src.experiments.swarm import run
from evolution._src.experiments.swarm.docking_trials import TrialSetup, run_docking_trials
from evolution._src.experiments.swarm.film import choose_moments, draw_timeline
from evolution._src.experiments.swarm.run import claim_folder, list_stories
from evolution._src.experiments.swarm.story import StoryConfig, SwarmRunConfig, tell_story
from symbrion_gym._src.swarm.behavior.hearing import HearingConfig
from symbrion_gym._src.swarm.behavior.memory import Mode
from symbrion_gym._src.swarm.placing import find_field


def test_a_swarm_that_may_not_dock_is_not_across() -> None:
    config = StoryConfig(arena="truth", num_robots=2, docks=False, gather_time=3.0)
    arena = sg.load_arena("truth")
    story = tell_story(config, arena, None)
    assert not story.success
    assert story.across == 0
    assert story.reason == "no whole organism within 3 s"
    assert story.as_dict()["gathered"] is None
    assert (story.track.mode == Mode.EXPLORE).all()
    again = tell_story(config, arena, None)
    for one, other in zip(story.track, again.track, strict=True):
        np.testing.assert_array_equal(one, other)
    figure = draw_timeline(story.track, find_field(arena))
    assert len(figure.axes) == 2
    moments = choose_moments(story.track, None)
    assert moments == sorted(moments)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"num_robots": 1}, "at least 2"),
        ({"seed": -1}, "seed is -1; give 0 or more"),
        ({"cross_time": 0.0}, "cross_time"),
    ],
)
def test_bad_stories_are_refused(values: dict, message: str) -> None:
    with pytest.raises(RunError, match=message):
        StoryConfig(**values)


def test_a_folder_of_other_options_or_files_is_refused(tmp_path: Path) -> None:
    claim_folder(SwarmRunConfig(tmp_path / "a", StoryConfig(seed=1)))
    claim_folder(SwarmRunConfig(tmp_path / "a", StoryConfig(seed=1), trials=3))
    with pytest.raises(RunError, match="results of other options"):
        claim_folder(SwarmRunConfig(tmp_path / "a", StoryConfig(seed=2)))
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "film.mp4").write_bytes(b"mine")
    with pytest.raises(RunError, match="would be overwritten"):
        claim_folder(SwarmRunConfig(tmp_path / "b", StoryConfig()))


def test_trials_have_seeds_of_their_own_and_a_baseline() -> None:
    stories = list_stories(SwarmRunConfig(Path("x"), StoryConfig(seed=5), trials=2))
    assert [story.seed for story in stories] == [5, 6, 7, 5, 6, 7]
    assert [story.docks for story in stories] == [True] * 3 + [False] * 3


def test_docking_trials_lock_without_errors_of_hearing_and_repeat_by_the_seed() -> None:
    hearing = HearingConfig(bearing_noise=0.0, departure_noise=0.0, bias=0.0, distance_noise=0.0, loss=0.0)
    setup = TrialSetup(duration=40.0, hearing=hearing)
    times = run_docking_trials(np.array([2, 3]), setup, seed=1)
    assert times.locked.all()
    assert times.recoveries.tolist() == [0, 0]
    assert times.seconds[0] > times.seconds[1]  # position 2 is farther away
    again = run_docking_trials(np.array([2, 3]), setup, seed=1)
    np.testing.assert_array_equal(times.seconds, again.seconds)


def test_an_interrupted_run_goes_on_to_equal_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "find_champion", lambda config, progress: None)
    monkeypatch.setattr(run, "BASELINE_TIME", 1.0)
    story = StoryConfig(arena="truth", num_robots=2, gather_time=2.0)

    def begin(stops: bool) -> Callable[[str], AbstractContextManager[SimpleNamespace]]:
        def progress(what: str, share: float) -> None:
            if stops and "story 2 of 2" in what:
                raise KeyboardInterrupt

        return lambda title: nullcontext(SimpleNamespace(progress=progress))

    def tell(name: str, stops: bool = False) -> run.SwarmResult:
        return run.run_swarm(SwarmRunConfig(tmp_path / name, story, trials=1), begin(stops))  # pyright: ignore[reportArgumentType]

    straight = tell("straight")
    with pytest.raises(KeyboardInterrupt):
        tell("stopped", stops=True)
    assert not (tmp_path / "stopped" / "results.json").exists()
    again = tell("stopped")
    assert again.rows == straight.rows
    assert [row["docks"] for row in again.rows] == [True, True, False, False]
    for name in ("stories.json", "results.json", "swarm.json"):
        assert (tmp_path / "stopped" / name).read_bytes() == (tmp_path / "straight" / name).read_bytes()
    for one, other in zip(again.track, straight.track, strict=True):
        np.testing.assert_array_equal(one, other)
