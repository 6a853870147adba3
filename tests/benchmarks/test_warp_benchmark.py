"""The benchmark of Warp runs to its end, without a GPU as well, and where only Warp sees one."""

import numpy as np
import pytest

import benchmarks.warp as benchmark
from benchmarks.material import warp_speed
from benchmarks.material.warp_ppo import QUICK
from evolution._src.backends import rollout
from evolution._src.backends.trials import Job, Trials, find_trial_controller
from symbrion_gym._src.errors import OptionError


@pytest.fixture
def stored(monkeypatch):
    """Parts that were stored, in place of the file of results."""
    kept = {}

    class Kept:
        def __init__(self, name):
            assert name == "warp"

        content = kept

        def put(self, part, figures):
            kept[part] = figures

    monkeypatch.setattr(benchmark, "Results", Kept)
    return kept


@pytest.fixture
def needs_gpu():
    pytest.importorskip("mujoco_warp", reason="needs the extra gpu")


def test_a_part_that_fails_stops_no_other(monkeypatch, capsys, stored):
    def fail(setting):
        raise ValueError("no such kernel")

    parts = {"ticks": fail, "speed": lambda setting: setting.results.put("speed", {"device": setting.device})}
    monkeypatch.setattr(benchmark, "PARTS", parts)
    monkeypatch.setattr(benchmark, "find_missing", lambda *_: ())
    assert benchmark.run(device="cuda:7") == ["ticks"]
    assert stored == {"speed": {"device": "cuda:7"}}
    assert "no such kernel" in capsys.readouterr().err
    assert benchmark.run(device="cuda:7", only=("speed",)) == []


def test_without_the_extra_nothing_is_measured(monkeypatch, capsys, stored):
    monkeypatch.setattr(benchmark, "find_missing", lambda *_: ("warp",))
    assert benchmark.run() == []
    assert "pip install 'symbrion-gym[gpu]'" in capsys.readouterr().out
    assert not stored


def test_a_scanned_place_is_driven_from_place_to_place():
    assert warp_speed.find_task("truth") == {}
    assert warp_speed.find_task("arenas/room")["task"] == "traverse"


@pytest.mark.long
def test_ppo_learns_on_the_c_engine_as_well(monkeypatch, stored):
    monkeypatch.setattr(benchmark, "find_missing", lambda *_: ())
    assert benchmark.run(True, "cpu", only=("ppo_host",)) == []
    (found,) = stored["ppo_host"]["runs"]
    assert [row["decisions"] for row in found["curve"]] == [128, 256]
    assert {"zero", "random", "judged"} <= set(found)


@pytest.mark.long
@pytest.mark.usefixtures("needs_gpu")
@pytest.mark.parametrize("part", ["ticks", "crossings", "speed", "generation", "ppo"])
def test_every_part_runs_without_a_gpu(part, stored):
    assert benchmark.run(True, "cpu", worlds=(2,), only=(part,), arenas=("truth",)) == []
    found = stored[part]
    if part == "ppo":
        assert len(found["curve"]) == QUICK.updates
        assert {"zero", "random", "judged"} <= set(found)


@pytest.mark.long
@pytest.mark.usefixtures("needs_gpu")
def test_speed_is_measured_with_torch(stored):
    pytest.importorskip("torch", reason="torch is not installed")
    assert benchmark.run(True, "cpu", worlds=(2,), only=("speed",), arenas=("truth",), array="torch") == []
    assert stored["speed_torch"]["truth"]["2 worlds"]["robot_seconds_per_second"] > 0.0


@pytest.mark.long
@pytest.mark.usefixtures("needs_gpu")
def test_where_jax_sees_no_gpu_only_the_physics_is_on_it(monkeypatch, stored):
    from symbrion_gym._src.environment.warp import device_vector_env

    def refuse(device):
        raise OptionError("JAX does not see device")

    monkeypatch.setattr(device_vector_env, "find_jax_device", refuse)
    assert benchmark.run(True, "cpu", worlds=(2,), only=("speed",), arenas=("truth",)) == []
    assert stored["speed_numpy"]["array"] == "numpy"
    trials = Trials(arena="truth", modules=3, controller="path", count=1, duration=0.5, start="pit")
    genotype = np.zeros(len(find_trial_controller(trials).parameters))
    assert rollout.simulate_on_device([Job(genotype, trials)])[0].seconds > 0.0
