"""The record of a run: what goes in comes out, and what is damaged is refused."""

import io
from typing import Any

import numpy as np
import pytest

from evolution._src.backends.trials import Outcome
from evolution._src.errors import RunError
from evolution._src.search.record import FORMAT, HISTORY, SAMPLE, VALIDATION, Entry, Record


def make_row(generation: int) -> dict[str, float]:
    """Return a row in which every column has another value."""
    names = HISTORY.names or ()
    return {name: 100 * generation + place for place, name in enumerate(names)} | {"generation": generation}


def make_record() -> Record:
    record = Record()
    first = Outcome(1.25, 0.5, (True, False, True), 12.5, 0, "")
    second = Outcome(-1.0, 0.0, (False, False), 0.0, 2, "FloatingPointError: fell apart")
    third = Outcome(0.75, 0.25, (True,), 3.0, 1, "")
    record.add_generation(
        [
            Entry(0, SAMPLE, 0, np.array([0.1, -0.2]), 1.5, first),
            Entry(0, SAMPLE, 1, np.array([0.3, 0.4]), -2.5, second),
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
    assert again.history.tolist() == record.history.tolist()
    for ours, theirs in zip(again.entries, record.entries, strict=True):
        assert ours._replace(genotype=None) == theirs._replace(genotype=None)  # pyright: ignore[reportArgumentType]
        assert np.array_equal(ours.genotype, theirs.genotype)
    assert again.to_bytes("a digest") == record.to_bytes("a digest")


def test_a_record_from_before_the_first_generation_is_empty():
    again, digest = Record.from_bytes(Record().to_bytes(""), "a file")
    assert digest == ""
    assert again.entries == []
    assert again.num_generations == len(again.history) == 0
    assert again.history.dtype == HISTORY


def test_columns_are_plain_numbers_and_text_of_one_width_everywhere():
    columns = make_record().columns()
    kinds = {name: column.dtype.str for name, column in columns.items() if column.dtype.kind != "U"}
    whole, real = ("generation", "kind", "index", "diverged"), ("genotype", "fitness", "progress")
    assert kinds == dict.fromkeys(whole, "<i4") | dict.fromkeys((*real, "effort", "seconds"), "<f8")
    assert columns["succeeded"].tolist() == ["101", "00", "1"]
    assert columns["error"].tolist() == ["", "FloatingPointError: fell apart", ""]
    assert columns["genotype"].shape == (3, 2)


def test_a_generation_is_its_row_and_its_entries():
    record = make_record()
    assert record.history[1].tolist() == tuple(make_row(1).values())
    generations = list(record.generations())
    assert [[entry.index for entry in entries] for entries, _ in generations] == [[0, 1], [12]]
    assert [row["generation"] for _, row in generations] == [0, 1]
    assert list(Record().generations()) == []


def test_only_the_last_generation_is_still_written():
    record = make_record()
    before = record.history
    record.set_champion(15, 16)
    record.set_wall_seconds(2.5)
    assert record.history[0] == before[0]
    expected = make_row(1) | {"champion_successes": 15, "champion_trials": 16, "wall_seconds": 2.5}
    assert record.history[1].tolist() == tuple(expected.values())


def damage(**changes: Any) -> bytes:
    """Return the file of a record with arrays replaced, or left out where None."""
    with np.load(io.BytesIO(make_record().to_bytes("a digest"))) as arrays:
        content = {name: arrays[name] for name in arrays} | changes
    buffer = io.BytesIO()
    np.savez(buffer, **{name: array for name, array in content.items() if array is not None})
    return buffer.getvalue()


def test_the_file_with_nothing_replaced_is_a_record():
    assert len(Record.from_bytes(damage(), "a file")[0].entries) == 3


@pytest.mark.parametrize(
    "changes",
    [
        {"history": make_record().history[1:]},
        {"history": make_record().history[["generation", "best"]]},
        {"history": np.zeros(2)},
        {"history": None},
        {"digest": None},
        {"format": None},
        {"entry_kind": np.zeros(2, dtype="<i4")},
        {"entry_fitness": None},
        {"entry_error": None},
        {"entry_genotype": np.zeros((3, 2), dtype="<f4")},
        {"entry_genotype": np.zeros((3, 2), dtype="<i8")},
        {"entry_progress": np.array(["a", "b", "c"])},
    ],
)
def test_what_is_no_whole_record_is_refused(changes):
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
