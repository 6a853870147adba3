"""Descriptors of many trials as plain arrays: values one after the other, and their shapes."""

from collections.abc import Mapping, Sequence

import numpy as np

from evolution._src.backends.descriptors import Records

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
