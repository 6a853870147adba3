"""From a scan to a robot that drives there, on a small floor."""

from pathlib import Path

import numpy as np
import pytest

import evolution as ev
import reconstruction as rc
import symbrion_gym as sg
from evolution._src.experiments import train as training
from evolution._src.experiments.train import split_readings
from symbrion_gym._src.tasks.paths import propose_way


def make_scan(seed: int = 0) -> rc.Cloud:
    """Return readings of a floor of 2.4 m by 2.4 m with 1 mm of noise, seen from above."""
    rng = np.random.default_rng(seed)
    places = np.stack(np.meshgrid(*[np.linspace(-1.2, 1.2, 80)] * 2), axis=-1).reshape(-1, 2)
    points = np.column_stack([places, np.zeros(len(places))]) + rng.normal(0.0, 1e-3, (len(places), 3))
    return rc.Cloud(rng.permutation(points), viewpoints=np.array([[0.0, 0.0, 1.0]]))


def test_halves_share_no_reading() -> None:
    log = sg.survey("truth", seed=0)
    clouds = split_readings(make_scan()), [rc.make_log_cloud(half) for half in split_readings(log)]
    for halves, count in zip(clouds, (6400, rc.make_log_cloud(log).num_points), strict=True):
        rows = np.concatenate([half.points for half in halves])  # pyright: ignore[reportAttributeAccessIssue]
        assert len(np.unique(rows, axis=0)) == len(rows) == count


def test_a_scan_becomes_a_robot_that_drives_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "GENERATIONS", 1)
    monkeypatch.setattr(training, "TRIALS", 6)
    result = ev.train(make_scan(), tmp_path / "mine", workers=2)
    assert result.verdict == result.arena.verdict
    assert result.held_in_training >= 5
    assert (result.held_in_other_half or 0) >= 5
    for drivers in result.held.values():
        assert max(drivers["doing nothing"], drivers["tracks forward"]) <= 1
    assert "holds in" in result.page.read_text(encoding="utf-8")

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("done again")

    monkeypatch.setattr(training, "_make_model", refuse)
    monkeypatch.setattr(ev, "evolve", refuse)
    again = ev.train(make_scan(), tmp_path / "mine", workers=1)
    assert (again.held, again.run.champion) == (result.held, result.run.champion)
    with pytest.raises(ev.RunError, match=r"other options \(scan\)"):
        ev.train(make_scan(seed=1), tmp_path / "mine")


def test_what_the_other_half_does_not_confirm_is_unseen() -> None:
    made = [sg.make_arena(rc.reconstruct(half, seed=k, units=500), cache=False)
            for k, half in enumerate(split_readings(make_scan()))]  # fmt: skip
    raised = made[1].surface.copy()
    raised.vertices[raised.vertices[:, 0] > 0.0, 2] += 0.1
    marked = training._mark_unconfirmed(made[0], sg.make_arena(raised, cache=False))
    places = marked.seen_surface.triangles_center[:, 0]
    assert 0.3 * len(made[0].surface.faces) < len(places) < 0.6 * len(made[0].surface.faces)
    assert places.max() < 0.1


def test_a_way_keeps_off_rims() -> None:
    floor = sg.make_arena(rc.reconstruct(make_scan(), units=500), cache=False)
    way = propose_way(floor, sg.snake(1))
    assert way is not None
    assert np.abs(way).max() < 1.2 - 0.14
