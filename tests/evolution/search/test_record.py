"""The record of a run: what goes in comes out, and what is damaged is refused."""

import io
from typing import Any

import numpy as np
import pytest

from evolution._src.backends.scoring import Outcome
from evolution._src.errors import RunError
from evolution._src.search.record import EXAM, FORMAT, HISTORY, SAMPLE, VALIDATION, Entry, Record


def make_row(generation: int) -> dict[str, float]:
    """Return a row in which every column has another value."""
    names = HISTORY.names or ()
    return {name: 100 * generation + place for place, name in enumerate(names)} | {"generation": generation}


def make_record() -> Record:
    record = Record()
    kept = ({"a": np.ones((2, 2)), "b": np.array(4.0)}, {}, {"a": np.zeros((0, 2))})
    first = Outcome(1.25, 0.5, (True, False, True), 12.5, 0, "", kept)
    second = Outcome(-1.0, 0.0, (False, False), 0.0, 2, "FloatingPointError: fell apart")
    third = Outcome(0.75, 0.25, (True,), 3.0, 1, "")
    record.add_generation(
        [
            Entry(0, SAMPLE, 0, np.array([0.1, -0.2]), 1.5, first),
            Entry(0, EXAM, 1, np.array([0.3]), -2.5, second, "b(.)"),
        ],
        make_row(0),
    )
    record.add_generation([Entry(1, VALIDATION, 12, np.array([1 / 3, np.pi]), 0.125, third)], make_row(1))
    return record


def test_everything_comes_out_as_it_went_in():
    record = make_record()
    again, digest = Record.from_bytes(record.to_bytes("a digest"), "a file")
    assert digest == "a digest"
    assert again.num_generations == record.num_generations == 2
    assert (
        again.history.tolist()
        == record.history.tolist()
        == [tuple(make_row(each).values()) for each in (0, 1)]
    )
    for ours, theirs in zip(again.entries, record.entries, strict=True):
        assert ours._replace(genotype=None) == theirs._replace(genotype=None)  # pyright: ignore[reportArgumentType]
        assert np.array_equal(ours.genotype, theirs.genotype)
    ours, theirs = (each.entries[0].outcome.descriptors for each in (again, record))
    np.testing.assert_equal(ours, theirs)
    assert ours[2]["a"].shape == (0, 2)
    assert again.to_bytes("a digest") == record.to_bytes("a digest")


def test_a_record_from_before_the_first_generation_is_empty():
    again, _ = Record.from_bytes(Record().to_bytes(""), "a file")
    assert again.entries == list(again.generations()) == []
    assert again.num_generations == len(again.history) == 0
    assert again.history.dtype == HISTORY


def test_a_generation_is_its_row_and_its_entries_and_what_follows_is_a_confirmation():
    record = make_record()
    later = record.entries[-1]._replace(generation=2)
    record.entries.append(later)
    generations = [
        ([entry.index for entry in entries], row["generation"]) for entries, row in record.generations()
    ]
    assert generations == [([0, 1], 0), ([12], 1)]
    assert record.confirmation == [later]
    record.add_generation([], make_row(2))
    assert record.confirmation == []
    assert len(record.entries) == 3, "the confirmation was that of a shorter run"


def damage(**changes: Any) -> bytes:
    """Return the file of a record with arrays replaced, or left out where None."""
    with np.load(io.BytesIO(make_record().to_bytes("a digest"))) as arrays:
        content = {name: arrays[name] for name in arrays} | changes
    buffer = io.BytesIO()
    np.savez(buffer, **{name: array for name, array in content.items() if array is not None})
    return buffer.getvalue()


@pytest.mark.parametrize(
    "changes",
    [
        {"history": make_record().history[1:]},
        {"history": make_record().history[["generation", "best"]]},
        {"digest": None},
        {"format": None},
        {"entry_kind": np.zeros(2, dtype="<i4")},
        {"entry_kind": np.full(3, np.inf)},
        {"entry_index": np.array(["one"] * 3)},
        {"entry_fitness": None},
        {"entry_genotype": np.zeros((3, 2), dtype="<f4")},
        {"entry_progress": np.array(["a", "b", "c"])},
        {"descriptors": np.zeros(3, np.uint8)},
        {"digest": np.array([{"a": 1}], dtype=object)},
    ],
)
def test_what_is_no_whole_record_is_refused(changes):
    assert len(Record.from_bytes(damage(), "a file")[0].entries) == 3
    with pytest.raises(
        RunError, match=r"^a file is damaged or not a record of a run .* restore it from a copy"
    ):
        Record.from_bytes(damage(**changes), "a file")


def test_another_format_is_named():
    with pytest.raises(RunError, match=f"^a file has format 'symbrion run 1', not '{FORMAT}'"):
        Record.from_bytes(damage(format=np.array("symbrion run 1")), "a file")


@pytest.mark.parametrize("content", [b"", b"PK", b"text", damage()[:-40], damage()[40:]])
def test_what_is_no_archive_is_refused(content):
    with pytest.raises(RunError, match=r"^a file is damaged or not a record of a run"):
        Record.from_bytes(content, "a file")
