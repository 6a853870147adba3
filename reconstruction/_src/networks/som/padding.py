"""Round array lengths up, so that a new size seldom means a new compilation."""

import numpy as np
from jaxtyping import Shaped


def padded_length(length: int, minimum: int = 64) -> int:
    """Return the smallest permitted length that holds `length`, of four sizes an octave."""
    length = max(int(length), minimum)
    step = max(1, 2 ** (length.bit_length() - 1) // 4)
    return -(-length // step) * step


def half_octave_length(length: int) -> int:
    """Return the smallest permitted length that holds `length`, of two sizes an octave."""
    step = 2 ** ((length - 1).bit_length() - 2)
    return -(-length // step) * step


def pad_rows(
    array: Shaped[np.ndarray, "N ..."], length: int, value: float = 0
) -> Shaped[np.ndarray, "length ..."]:
    """Return `array` with rows of `value` added until it has `length` rows."""
    if len(array) == length:
        return array
    padding = np.full((length - len(array), *array.shape[1:]), value, dtype=array.dtype)
    return np.concatenate([array, padding])
