"""Everything a run has tried, in columns. Replaying it rebuilds the run, so the record is the checkpoint.

One `.npz` file of plain arrays: no pickle, so nothing in it can run code, and the checksums of its
container reveal damage.
"""

import io
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Shaped

from evolution._src.backends.outcome import Outcome
from evolution._src.backends.scoring import Records
from evolution._src.errors import RunError
from reconstruction._src.base.bounded_read import read_npz

PREFIX = "descriptor_"
_COUNT = f"{PREFIX}count"
_SHAPE = "_shape"
_MAX_AXES = 8


def pack(records: Sequence[Sequence[Records]]) -> dict[str, np.ndarray]:
    """Return arrays of the descriptors of entries; none where there are no descriptors."""
    counts = [len(trials) for trials in records]
    flat = [trial for trials in records for trial in trials]
    if not flat:
        return {}
    arrays = {_COUNT: np.array(counts, dtype="<i4")}
    for name in flat[0]:
        values = [trial[name] for trial in flat]
        shapes = np.full((len(values), _MAX_AXES), -1, dtype="<i4")
        for row, value in enumerate(values):
            shapes[row, : value.ndim] = value.shape
        arrays[f"{PREFIX}{name}"] = np.concatenate([value.ravel() for value in values]).astype("<f8")
        arrays[f"{PREFIX}{name}{_SHAPE}"] = shapes
    return arrays


def unpack(arrays: Mapping[str, np.ndarray], num_entries: int) -> list[tuple[Records, ...]]:
    """Return the descriptors that `pack` packed; of files without any, empty ones."""
    if _COUNT not in arrays:
        return [()] * num_entries
    counts = arrays[_COUNT]
    if len(counts) != num_entries or counts.min(initial=0) < 0:
        raise ValueError("descriptors do not belong to the entries")
    total = int(counts.sum())
    flat: list[Records] = [{} for _ in range(total)]
    for key in arrays:
        if key.startswith(PREFIX) and key.endswith(_SHAPE):
            name = key.removeprefix(PREFIX).removesuffix(_SHAPE)
            values = _split(arrays[f"{PREFIX}{name}"], arrays[key], total)
            for trial, value in zip(flat, values, strict=True):
                trial[name] = value
    ends = np.cumsum(counts)
    return [tuple(flat[end - count : end]) for end, count in zip(ends, counts, strict=True)]


def _split(values: np.ndarray, shapes: np.ndarray, total: int) -> list[np.ndarray]:
    if shapes.shape != (total, _MAX_AXES) or values.dtype != "<f8":
        raise ValueError("shapes of descriptors do not belong to their values")
    lengths = [tuple(int(axis) for axis in shape if axis >= 0) for shape in shapes]
    sizes = [int(np.prod(length, dtype=np.int64)) for length in lengths]
    if sum(sizes) != len(values):
        raise ValueError("descriptors are missing")
    parts = np.split(values, np.cumsum(sizes)[:-1]) if sizes else []
    return [part.reshape(length) for part, length in zip(parts, lengths, strict=True)]


FORMAT = "symbrion run 2"
SAMPLE, VALIDATION = 0, 2
"""Kinds of an evaluation, part of the seeds of its trials: a genotype of a generation, new trials of a candidate."""

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
tried, `champion_*` the validation trials of the champion so far."""

TIMES = ("wall_seconds",)  # Columns that differ between equal runs


class Entry(NamedTuple):
    """One evaluation of a genotype.

    Attributes:
        generation: generation in which it was tried.
        kind: SAMPLE or VALIDATION.
        index: index of the genotype in its generation; one more than the last stands for the mean of the search
            distribution.
        genotype: genes of the controller.
        fitness: higher is better.
        outcome: outcome of its trials.
    """

    generation: int
    kind: int
    index: int  # pyright: ignore[reportIncompatibleMethodOverride]  (it replaces `tuple.index`)
    genotype: Float[np.ndarray, " G"]
    fitness: float
    outcome: Outcome


class Record:
    """The entries and the history of a run, in order."""

    def __init__(self) -> None:
        self.entries: list[Entry] = []
        self._rows: list[np.void] = []

    @property
    def history(self) -> Shaped[np.ndarray, " generations"]:
        """Structured array of `HISTORY`, one row per generation."""
        return np.array(self._rows, dtype=HISTORY) if self._rows else np.empty(0, dtype=HISTORY)

    @property
    def num_generations(self) -> int:
        """Number of generations that are complete."""
        return len(self._rows)

    def add_generation(self, entries: list[Entry], row: dict[str, float]) -> None:
        """Append a complete generation."""
        self.entries.extend(entries)
        self._rows.append(np.array([tuple(row[name] for name in HISTORY.names or ())], dtype=HISTORY)[0])

    def set_wall_seconds(self, seconds: float) -> None:
        """Set the time of the last generation, when it is replayed."""
        self._rows[-1]["wall_seconds"] = seconds

    def set_champion(self, successes: int, trials: int) -> None:
        """Set the validation trials of the champion after the last generation."""
        self._rows[-1]["champion_successes"], self._rows[-1]["champion_trials"] = successes, trials

    def generations(self) -> Iterator[tuple[list[Entry], np.void]]:
        """Yield the entries and the row of each generation."""
        entries = iter(self.entries)
        following = next(entries, None)
        for row in self._rows:
            own: list[Entry] = []
            while following is not None and following.generation == row["generation"]:
                own.append(following)
                following = next(entries, None)
            yield own, row

    def columns(self) -> dict[str, Shaped[np.ndarray, " entries *_"]]:
        """Return the entries as arrays, one per column, with one row per entry."""
        outcomes = [entry.outcome for entry in self.entries]
        flags = ["".join("01"[succeeded] for succeeded in outcome.succeeded) for outcome in outcomes]
        return {
            "generation": np.array([entry.generation for entry in self.entries], dtype="<i4"),
            "kind": np.array([entry.kind for entry in self.entries], dtype="<i4"),
            "index": np.array([entry.index for entry in self.entries], dtype="<i4"),
            "genotype": np.array([entry.genotype for entry in self.entries], dtype="<f8"),
            "fitness": np.array([entry.fitness for entry in self.entries], dtype="<f8"),
            "progress": np.array([outcome.progress for outcome in outcomes], dtype="<f8"),
            "effort": np.array([outcome.effort for outcome in outcomes], dtype="<f8"),
            "seconds": np.array([outcome.seconds for outcome in outcomes], dtype="<f8"),
            "diverged": np.array([outcome.diverged for outcome in outcomes], dtype="<i4"),
            "succeeded": np.array(flags, dtype=np.str_),
            "error": np.array([outcome.error for outcome in outcomes], dtype=np.str_),
        }

    def to_bytes(self, digest: str) -> bytes:
        """Return the content of the file."""
        buffer = io.BytesIO()
        arrays = {f"entry_{name}": column for name, column in self.columns().items()}
        np.savez(
            buffer,
            format=np.array(FORMAT),
            digest=np.array(digest),
            history=self.history,
            **arrays | pack([entry.outcome.descriptors for entry in self.entries]),  # pyright: ignore[reportArgumentType]
        )
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
            columns = {
                name.removeprefix("entry_"): column
                for name, column in arrays.items()
                if name.startswith("entry_")
            }
            descriptors = unpack(arrays, len(columns["kind"]))
            return cls._from_arrays(arrays["history"], columns, descriptors), str(arrays["digest"])
        except RunError:
            raise
        except Exception as error:  # a damaged or foreign file can be wrong in any way
            raise RunError(
                f"{source} is damaged or not a record of a run ({error}); restore it from a copy, "
                "or start again in another folder"
            ) from error

    @classmethod
    def _from_arrays(
        cls,
        history: np.ndarray,
        columns: dict[str, np.ndarray],
        descriptors: list[tuple[Records, ...]],
    ) -> "Record":
        if history.dtype != HISTORY:
            raise ValueError(f"history has columns {history.dtype.names}")
        record = cls()
        record._rows = list(history)
        if not np.array_equal(history["generation"], np.arange(len(history))):
            raise ValueError("generations are missing")
        if len({len(column) for column in columns.values()}) != 1 or columns["genotype"].dtype != "<f8":
            raise ValueError("columns differ in length")
        for row in range(len(columns["kind"])):
            value = {name: column[row] for name, column in columns.items()}
            outcome = Outcome(
                progress=float(value["progress"]),
                effort=float(value["effort"]),
                succeeded=tuple(flag == "1" for flag in str(value["succeeded"])),
                seconds=float(value["seconds"]),
                diverged=int(value["diverged"]),
                error=str(value["error"]),
                descriptors=descriptors[row],
            )
            numbers = {name: int(value[name]) for name in ("generation", "kind", "index")}
            fitness = float(value["fitness"])
            record.entries.append(
                Entry(**numbers, genotype=value["genotype"], fitness=fitness, outcome=outcome)
            )
        return record
