"""Round array lengths up, so that a new size seldom means a new compilation."""

import numpy as np


def padded_length(length: int, minimum: int = 64) -> int:
    """Return the smallest permitted length that holds `length`: four sizes an octave."""
    length = max(int(length), minimum)
    step = max(1, 2 ** (length.bit_length() - 1) // 4)
    return -(-length // step) * step


def pad_rows(array: np.ndarray, length: int, value: float = 0) -> np.ndarray:
    """Return `array` with rows of `value` added until it has `length` rows."""
    if len(array) == length:
        return array
    padding = np.full((length - len(array), *array.shape[1:]), value, dtype=array.dtype)
    return np.concatenate([array, padding])
