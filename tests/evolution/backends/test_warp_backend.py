"""Backend "warp": samples on a device, candidates for the champion on the C engine, and a record that says so."""

import json
from dataclasses import replace

import pytest
import toys

import reconstruction._src.base.extras
from evolution._src.backends import cluster, rollout
from evolution._src.backends.cluster import make_backend
from evolution._src.search import loop
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.evaluation import evaluate
from evolution._src.search.loop import evolve, load_run, resume
from evolution._src.search.record import VALIDATION
from evolution._src.search.validation import Validation
from reconstruction._src.base.extras import MissingExtraError

CONFIG = EvolutionConfig(arena="truth", generations=3, backend="warp", stop_when_solved=False)


@pytest.fixture
def engines(monkeypatch):
    """Toys in place of both engines, as if the extra were installed."""
    device, exact = toys.Observed(), toys.Observed()
    monkeypatch.setattr(cluster, "require_extras", lambda *_: None)
    monkeypatch.setattr(loop, "_prepare", lambda *_: None)
    monkeypatch.setattr(rollout, "simulate_on_device", device)
    monkeypatch.setattr(rollout, "simulate", exact)
    return device, exact


def test_without_the_extra_one_line_names_the_command(monkeypatch, tmp_path):
    monkeypatch.setattr(reconstruction._src.base.extras, "find_spec", lambda name: None)
    message = r"^backend 'warp' needs the extra 'gpu' .*: pip install 'symbrion-gym\[gpu\]'$"
    with pytest.raises(MissingExtraError, match=message):
        make_backend("warp")
    with pytest.raises(MissingExtraError, match=message):
        evolve(replace(CONFIG, folder=str(tmp_path / "run")))
    assert not (tmp_path / "run").exists()


def test_candidates_are_tried_on_the_c_engine(engines):
    device, exact = engines
    run = evolve(CONFIG)
    kinds = [job.trials.seed[1] for job in exact.jobs]
    assert kinds, "there were candidates"
    assert set(kinds) == {VALIDATION}
    assert VALIDATION not in {job.trials.seed[1] for job in device.jobs}
    assert len(kinds) + len(device.jobs) == len(run.record.entries)


def test_the_record_says_what_a_resume_repeats(engines, tmp_path):
    evolve(replace(CONFIG, folder=str(tmp_path / "warp"), generations=1))
    evolve(replace(CONFIG, folder=str(tmp_path / "batch"), backend="batch"))
    said = {name: json.loads((tmp_path / name / "config.json").read_text()) for name in ("warp", "batch")}
    assert "in distribution only" in said["warp"]["resumes"]
    assert "resumes" not in said["batch"]
    resume(tmp_path / "warp", generations=2, backend="batch")
    content = json.loads((tmp_path / "warp" / "config.json").read_text())
    assert "in distribution only" in content["resumes"]
    assert content["config"]["backend"] == "batch"
    assert len(load_run(tmp_path / "warp").history) == 2


@pytest.mark.long
def test_a_generation_runs_on_the_cpu_device(tmp_path):
    pytest.importorskip("mujoco_warp", reason="needs the extra gpu")
    config = replace(
        CONFIG,
        folder=str(tmp_path / "run"),
        modules=3,
        population_size=4,
        trials=1,
        generations=1,
        controller="path",
        start="pit",
        environment={"pit": 0.2, "duration": 4.0},  # pyright: ignore[reportArgumentType]
        validation=Validation(rounds=(2,)),
    )
    run = evolve(config)
    assert len(run.history) == 1
    assert not any(entry.outcome.error for entry in run.record.entries)
    sample = run.record.entries[0]
    options = {"arena": "truth", "modules": 3, "trials": 1, "controller": "path", "pit": 0.2, "duration": 4.0}
    again = evaluate(sample.genotype, **options, backend="warp")
    assert again.outcomes[0].seconds > 0.0
