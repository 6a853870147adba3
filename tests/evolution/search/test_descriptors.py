"""Outcomes keep what is asked of every trial; a run keeps it in its record and resumes with it."""

import json
from dataclasses import replace

import numpy as np
import pytest

from evolution._src.backends.scoring import RECORDERS, StoredDescriptors, check_descriptors
from evolution._src.backends.trials import Outcome
from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.evaluation import evaluate
from evolution._src.search.loop import evolve, load_run, resume
from evolution._src.search.record import pack, unpack

SHORT = {"modules": 3, "duration": 1.0}
CONFIG = EvolutionConfig(
    arena="truth",
    generations=1,
    population_size=4,
    trials=2,
    stop_when_solved=False,
    descriptors=("pose", "trajectory"),
    **SHORT,
)


def find_head(state):
    """The position of the head."""
    return state.position[:, 0]


def test_outcomes_have_what_is_asked_of_every_trial():
    names = ("pose", "extremes", "contacts", "trajectory", find_head)
    (outcome,) = evaluate(np.zeros(8), trials=3, descriptors=names, **SHORT).outcomes
    assert len(outcome.descriptors) == 3
    for kept in outcome.descriptors:
        assert kept["final_position"].shape == (3, 3)
        assert kept["final_rotation"].shape == (3, 3, 3)
        assert kept["trajectory"].shape[1:] == (3, 3)
        assert np.array_equal(kept["find_head"], kept["final_position"][0])
        assert np.all(kept["lowest"] <= kept["final_position"].min(axis=0))
        assert 0 <= kept["ground_share"].min() <= 1
    assert evaluate(np.zeros(8), trials=3, **SHORT).outcomes[0] == outcome
    assert evaluate(np.zeros(8), trials=1, **SHORT).outcomes[0].descriptors == ()


def test_a_run_keeps_descriptors_in_its_record_and_resumes_with_them(tmp_path):
    run = evolve(replace(CONFIG, folder=str(tmp_path / "run")))
    again = resume(tmp_path / "run", generations=2, allow=(__name__,))
    assert [len(entry.outcome.descriptors) for entry in again.record.entries] == [2] * 8
    for read in (again, load_run(tmp_path / "run")):
        for one, other in zip(run.record.entries, read.record.entries, strict=False):
            for mine, theirs in zip(one.outcome.descriptors, other.outcome.descriptors, strict=True):
                assert list(mine) == list(theirs)
                assert all(np.array_equal(mine[name], theirs[name]) for name in mine)
    assert replace(CONFIG, descriptors=()).digest() != CONFIG.digest()


def test_descriptors_of_a_file_are_not_imported_until_they_are_restored():
    config = replace(CONFIG, descriptors=(RECORDERS["pose"], find_head))
    stored = EvolutionConfig.from_json(json.loads(json.dumps(config.to_json())))
    assert isinstance(stored.descriptors, StoredDescriptors)
    assert stored.digest() == config.digest()
    assert stored.restore((__name__,)).descriptors == config.descriptors


@pytest.mark.parametrize("descriptors", ["shape", (7,), ("pose", None)])
def test_what_is_no_descriptor_is_refused(descriptors):
    with pytest.raises(RunError, match="descriptors has"):
        check_descriptors(descriptors)


def test_a_descriptor_that_no_file_can_keep_is_refused_before_anything_is_written(tmp_path):
    config = replace(CONFIG, descriptors=(lambda state: state.progress,), folder=str(tmp_path / "run"))
    with pytest.raises(RunError, match=r"descriptors: .*cannot be restored"):
        evolve(config)
    assert not (tmp_path / "run").exists()


def test_arrays_of_any_shape_are_packed():
    records = [
        ({"a": np.zeros((0, 2)), "b": np.array(3.0)},),
        (),
        ({"a": np.ones((2, 2)), "b": np.array(4.0)}, {"a": np.ones((1, 2)), "b": np.array(5.0)}),
    ]
    again = unpack(pack(records), 3)
    assert [len(trials) for trials in again] == [1, 0, 2]
    assert again[2][0]["a"].tolist() == [[1, 1], [1, 1]]
    assert again[0][0]["a"].shape == (0, 2)
    assert again[2][1]["b"] == 5.0
    assert unpack(pack([(), ()]), 2) == [(), ()]
    assert Outcome(0.0, 0.0, ()).descriptors == ()


@pytest.mark.parametrize("damage", ["count", "a", "a_shape"])
def test_damaged_descriptors_are_refused(damage):
    arrays = pack([({"a": np.ones((2, 2))},)])
    arrays[f"descriptor_{damage}"] = arrays[f"descriptor_{damage}"][:0]
    with pytest.raises(ValueError, match="descriptors"):
        unpack(arrays, 1)
