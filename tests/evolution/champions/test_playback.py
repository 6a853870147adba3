"""Champions are judged by equal trials for equal seeds, and filmed where there is OpenGL."""

import numpy as np
import pytest
import toys

from evolution._src.champions.playback import judge, play
from evolution._src.controllers.controller import make_controller
from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.evaluation import make_backend
from evolution._src.search.loop import evolve
from evolution._src.search.validation import Champion
from symbrion_gym._src.environment.organism_env import OrganismEnv


@pytest.fixture
def champion() -> Champion:
    """A short body with the law that a search begins with."""
    controller = make_controller("reactive", 3)
    return Champion(
        genotype=controller.initial,
        names=controller.parameters,
        controller="reactive",
        modules=3,
        arena="truth",
        generation=0,
        fitness=0.0,
        environment=(("duration", 2.0),),
    )


def test_equal_seeds_give_equal_judgements(champion: Champion) -> None:
    first, second = (judge(champion, trials=3, seed=4, workers=workers) for workers in (1, 2))
    assert first == second
    assert first.trials == 3
    assert judge(champion, trials=3, seed=5) != first


@pytest.mark.parametrize("wrong", [{"trials": 0}, {"trials": -1}, {"seed": -1}])
def test_a_judgement_refuses_wrong_numbers(champion: Champion, wrong: dict[str, int]) -> None:
    with pytest.raises(RunError, match=f"{next(iter(wrong))} must be a whole number"):
        judge(champion, **wrong)


def test_a_judgement_repeats_no_conditions_of_a_run_with_the_same_seed(
    champion: Champion, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_run, in_judgement = toys.Observed(), toys.Observed()
    config = EvolutionConfig(seed=4, trials=3, generations=5, stop_when_solved=False)
    evolve(config, simulate=in_run)
    monkeypatch.setattr(
        "evolution._src.champions.playback.make_backend",
        lambda backend, workers: make_backend(backend, workers, simulate=in_judgement),
    )
    assert judge(champion, trials=3, seed=4).successes == 3
    (job,) = in_judgement.jobs
    assert (job.trials.count, job.trials.start, job.trials.modules) == (3, "floor", 3)
    assert not toys.find_conditions(job) & frozenset().union(*map(toys.find_conditions, in_run.jobs))


def test_a_recording_holds_the_whole_body(champion: Champion) -> None:
    recording = play(champion)
    assert recording.positions.shape == (100, 3, 3)
    assert recording.rotations.shape == (100, 3, 3, 3)
    assert recording.seconds == pytest.approx(2.0)
    assert not recording.success
    assert recording.frames == []
    assert np.all(np.diff(recording.positions[-1, :, 0]) < 0)  # head first


def test_without_opengl_there_are_no_frames_and_all_else(
    champion: Champion, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(self: OrganismEnv) -> None:
        raise RuntimeError("no context")

    monkeypatch.setattr(OrganismEnv, "render", fail)
    recording = play(champion, film=True)
    assert recording.frames == []
    assert len(recording.positions) == 100
    assert "no video" in caplog.text


def test_a_window_shows_the_robot_at_its_pace_and_is_left_out_without_a_display(
    champion: Champion, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    slept = []
    monkeypatch.setattr("evolution._src.champions.playback.time.sleep", slept.append)
    recording = play(champion, window=True, film=True, speed=2.0)
    assert recording.frames == []
    assert len(slept) == 100
    assert max(slept) <= 1.0  # 2 s at twice the speed
    assert np.array_equal(recording.positions, play(champion).positions)
    assert "no display" in caplog.text
