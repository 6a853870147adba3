"""Array lengths are rounded up to one of few."""

import numpy as np

from reconstruction._src.networks.som.compilation import pad_rows, padded_length


def test_padding_has_few_sizes_and_wastes_little():
    assert len({padded_length(n) for n in range(1, 32769)}) == 13
    assert all(n <= padded_length(n) <= 1.5 * n for n in range(512, 32769))
    assert all(n <= padded_length(n) <= 1.25 * n for n in range(32769, 200_000, 7))
    np.testing.assert_array_equal(pad_rows(np.array([[1, 2]]), 3, 7), [[1, 2], [7, 7], [7, 7]])
