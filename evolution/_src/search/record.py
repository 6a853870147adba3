"""Everything a run has tried, in columns. Replaying it rebuilds the run, so the record is the checkpoint.

One `.npz` file of plain arrays: no pickle, so nothing in it can run code, and the checksums of its
container reveal damage.
"""

import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple, TypeAlias

import msgspec
import numpy as np
from jaxtyping import Float, Shaped

from evolution._src.backends.scoring import Outcome
from evolution._src.backends.trials import Job
from evolution._src.errors import RunError
from reconstruction._src.base.bounded_read import read_npz

FORMAT = "symbrion run 3"
SAMPLE, EXAM, VALIDATION, CONFIRMATION = range(4)
"""Kinds of an evaluation, part of the seeds of its trials: a genotype of a generation; what a body has learned at the
end of a level; new trials of a candidate for the champion; those of the fittest bodies, after the search."""
HISTORY = np.dtype(
    [
        ("generation", "<i4"),
        ("evaluations", "<i4"),
        ("wall_seconds", "<f8"),
        ("best", "<f8"),
        ("median", "<f8"),
        ("sigma", "<f8"),
        ("successes", "<i4"),
        ("population_size", "<i4"),
        ("restarts", "<i4"),
        ("trials", "<i4"),
        ("validated", "<i4"),
        ("champion_successes", "<i4"),
        ("champion_trials", "<i4"),
        ("failures", "<i4"),
    ]
)
"""One row per generation: `evaluations` (genotypes tried) and `trials` (of all kinds) count from the start of
the run, `successes` and `failures` are this generation's genotypes that succeeded in all trials or could not be
tried, `champion_*` the validation trials of the champion so far. In a search for bodies a row is an iteration:
`population_size` counts the bodies that learned, `best` is the best fitness so far of one that has learned to the end,
`median` that of this iteration's bodies, and `sigma` is 0."""
TIMES = ("wall_seconds",)  # Columns that differ between equal runs
_NUMBERS = ("generation", "kind", "index")
_MEASURES = {"progress": float, "effort": float, "seconds": float, "diverged": int, "error": str}
_Packed: TypeAlias = list[list[dict[str, tuple[tuple[int, ...], bytes]]]]
"""Shape and content of each array that is kept of each trial of each entry."""


class Attempt(NamedTuple):
    """A genotype that is to be tried."""

    kind: int
    index: int  # pyright: ignore[reportIncompatibleMethodOverride]  (it replaces `tuple.index`)
    job: Job
    body: str = ""  # text of the genome of the body, in a search for bodies


class Entry(NamedTuple):
    """One evaluation of a genotype."""

    generation: int  # generation in which it was tried
    kind: int
    # index of the genotype in its generation, one more than the last stands for the mean of the search distribution;
    # for bodies the generation of the body's own learning, or the level of an exam
    index: int  # pyright: ignore[reportIncompatibleMethodOverride]  (it replaces `tuple.index`)
    genotype: Float[np.ndarray, " G"]
    fitness: float  # higher is better
    outcome: Outcome
    body: str = ""  # as in `Attempt`


Try: TypeAlias = Callable[[Sequence[Attempt]], list[Entry]]
"""Tries genotypes, all of one kind, or takes their outcomes from a record."""


class Record:
    """The entries and the history of a run, in order; entries after the last row are those of a confirmation."""

    def __init__(self, entries: Sequence[Entry] = (), history: Sequence[np.void] | np.ndarray = ()) -> None:
        self.entries = list(entries)
        self._rows = list(history)

    @property
    def history(self) -> Shaped[np.ndarray, " generations"]:
        """Structured array of `HISTORY`, one row per generation."""
        return np.array(self._rows, dtype=HISTORY) if self._rows else np.empty(0, dtype=HISTORY)

    @property
    def num_generations(self) -> int:
        """Number of generations that are complete."""
        return len(self._rows)

    def add_generation(self, entries: Sequence[Entry], row: Mapping[str, float]) -> None:
        """Append a complete generation; a confirmation was that of a shorter run."""
        self.entries[len(self.entries) - len(self.confirmation) :] = entries
        self._rows.append(np.array([tuple(row[name] for name in HISTORY.names or ())], dtype=HISTORY)[0])

    def set_in_last_row(self, **values: float) -> None:
        """Set what is known of the last generation only when it is complete, or replayed."""
        for name, value in values.items():
            self._rows[-1][name] = value

    def generations(self) -> Iterator[tuple[list[Entry], np.void]]:
        """Yield the entries and the row of each generation."""
        place = 0
        for row in self._rows:
            own = self.find_from(place, int(row["generation"]))
            place += len(own)
            yield own, row

    def find_from(self, place: int, generation: int) -> list[Entry]:
        """Return the entries of a generation that follow each other from a place on."""
        end = place
        while end < len(self.entries) and self.entries[end].generation == generation:
            end += 1
        return self.entries[place:end]

    @property
    def confirmation(self) -> list[Entry]:
        """Entries of the confirmation after the last generation."""
        return [entry for entry in self.entries if entry.generation == self.num_generations]

    def columns(self) -> dict[str, Shaped[np.ndarray, " entries *_"]]:
        """Return the entries as arrays, one per column, with one row per entry; short genotypes end with NaN."""
        entries, outcomes = self.entries, [entry.outcome for entry in self.entries]
        genotypes = np.full((len(entries), max((len(each.genotype) for each in entries), default=0)), np.nan)
        for row, entry in zip(genotypes, entries, strict=True):
            row[: len(entry.genotype)] = entry.genotype
        flags = ["".join("01"[succeeded] for succeeded in outcome.succeeded) for outcome in outcomes]
        columns = {name: np.array([getattr(each, name) for each in entries], "<i4") for name in _NUMBERS}
        columns |= {"genotype": genotypes, "fitness": np.array([each.fitness for each in entries], "<f8")}
        columns |= {
            name: np.array([getattr(each, name) for each in outcomes], kind)
            for name, kind in _MEASURES.items()
        }
        bodies = np.array([each.body for each in entries], np.str_)
        return columns | {"succeeded": np.array(flags, np.str_), "body": bodies}

    def to_bytes(self, digest: str) -> bytes:
        """Return the content of the file."""
        buffer = io.BytesIO()
        arrays = {f"entry_{name}": column for name, column in self.columns().items()}
        arrays |= {"format": np.array(FORMAT), "digest": np.array(digest), "history": self.history}
        arrays["descriptors"] = _pack([entry.outcome.descriptors for entry in self.entries])
        np.savez(buffer, **arrays)  # pyright: ignore[reportArgumentType]
        return buffer.getvalue()

    @classmethod
    def from_bytes(cls, content: bytes, source: str) -> tuple["Record", str]:
        """Read the content of the file; return the record and the digest of its configuration."""
        try:
            arrays = read_npz(io.BytesIO(content))
            found = str(arrays["format"])
            if found != FORMAT:
                raise RunError(
                    f"{source} has format {found!r}, not {FORMAT!r}: continue with the release "
                    "that began it, or start again in another folder"
                )
            return cls._from_arrays(arrays), str(arrays["digest"])
        except RunError:
            raise
        except Exception as error:  # a damaged or foreign file can be wrong in any way
            raise RunError(
                f"{source} is damaged or not a record of a run ({error}); restore it from a copy, "
                "or start again in another folder"
            ) from error

    @classmethod
    def _from_arrays(cls, arrays: Mapping[str, np.ndarray]) -> "Record":
        history = arrays["history"]
        names = [name for name in arrays if name.startswith("entry_")]
        columns = {name.removeprefix("entry_"): arrays[name] for name in names}
        if history.dtype != HISTORY:
            raise ValueError(f"history has columns {history.dtype.names}")
        if not np.array_equal(history["generation"], np.arange(len(history))):
            raise ValueError("generations are missing")
        if len({len(column) for column in columns.values()}) != 1 or columns["genotype"].dtype != "<f8":
            raise ValueError("columns differ in length")
        record = cls(history=history)
        for row, kept in zip(range(len(columns["kind"])), _unpack(arrays["descriptors"]), strict=True):
            value = {name: column[row].item() for name, column in columns.items() if name != "genotype"}
            succeeded = tuple(flag == "1" for flag in str(value["succeeded"]))
            measures = {name: kind(value[name]) for name, kind in _MEASURES.items()}
            genotype = columns["genotype"][row]
            record.entries.append(
                Entry(
                    **{name: int(value[name]) for name in _NUMBERS},
                    genotype=genotype[~np.isnan(genotype)],
                    fitness=float(value["fitness"]),
                    outcome=Outcome(**measures, succeeded=succeeded, descriptors=kept),
                    body=str(value["body"]),
                )
            )
        return record


def _pack(records: Sequence[Sequence[Mapping[str, np.ndarray]]]) -> np.ndarray:
    """Return bytes of the descriptors of all entries and trials."""
    content = [
        [
            {name: (each.shape, each.astype("<f8").tobytes()) for name, each in trial.items()}
            for trial in trials
        ]
        for trials in records
    ]
    return np.frombuffer(msgspec.msgpack.encode(content), np.uint8)


def _unpack(packed: np.ndarray) -> list[tuple[dict[str, np.ndarray], ...]]:
    """Return the descriptors that `_pack` packed."""
    content = msgspec.msgpack.decode(packed.tobytes(), type=_Packed)
    return [
        tuple(
            {name: np.frombuffer(data, "<f8").reshape(shape) for name, (shape, data) in trial.items()}
            for trial in trials
        )
        for trials in content
    ]
