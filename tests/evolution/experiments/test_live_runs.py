"""Whole runs of `symbrion live`: equal seeds give equal files."""

import contextlib
from pathlib import Path

import numpy as np
import pytest

import symbrion_gym as sg
from evolution._src.experiments.live.drive import DriveConfig
from evolution._src.experiments.live.live import LiveConfig, run_live
from evolution._src.experiments.live.scene import SceneConfig
from symbrion_gym._src.sensing.friction_robot import FrictionRobot


class Step:
    def progress(self, *_: object) -> None:
        pass


def run_small(folder: Path, seed: int = 0, workers: int = 1):
    config = LiveConfig(
        folder,
        seed,
        SceneConfig(widening=0.03),
        drive=DriveConfig(duration=30.0),
        feel=FrictionRobot(spacing=0.9),
        modules=2,
        units=1200,
        generations=1,
        trials=2,
        workers=workers,
    )
    return run_live(config, lambda _title: contextlib.nullcontext(Step()))


@pytest.mark.slow
def test_two_whole_runs_are_equal_to_the_bit(tmp_path):
    one, other = run_small(tmp_path / "a"), run_small(tmp_path / "b", workers=2)
    assert one.as_dict() == other.as_dict()
    for name in ("before.npz", "readings.npz", "refined.npz", "slip.npz", "after.npz"):
        with np.load(tmp_path / "a" / name) as a, np.load(tmp_path / "b" / name) as b:
            assert sorted(a) == sorted(b)
            for key in a:
                np.testing.assert_array_equal(a[key], b[key], err_msg=f"{name}: {key}")
    for arena in ("before", "after"):
        files = [
            {
                path.relative_to(folder): path.read_bytes()
                for path in sorted(folder.rglob("*"))
                if path.is_file()
            }
            for folder in (tmp_path / run / "arenas" / arena for run in "ab")
        ]
        assert files[0] == files[1]
    assert (tmp_path / "a" / "results.json").read_bytes() == (tmp_path / "b" / "results.json").read_bytes()
    # What is there already is read, not made again.
    assert run_small(tmp_path / "a").as_dict() == one.as_dict()
    # The model after knows the ice that the docked Scouts felt.
    loaded = sg.Arena.load(tmp_path / "a" / "arenas" / "after")
    assert loaded.friction_source == "estimated"
    assert one.friction["ice"].error_after < 0.5 * one.friction["ice"].error_before
