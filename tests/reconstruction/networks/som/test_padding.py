"""Array lengths are rounded up to one of few."""

import numpy as np

from reconstruction._src.networks.som.compilation import half_octave_length, pad_rows, padded_length


def test_padding_has_few_sizes_and_wastes_little():
    sizes = {padded_length(n) for n in range(64, 4097)}
    assert len(sizes) < 30
    assert all(n <= padded_length(n) <= 1.25 * n + 1 for n in range(64, 4097))
    np.testing.assert_array_equal(pad_rows(np.array([[1, 2]]), 3, 7), [[1, 2], [7, 7], [7, 7]])


def test_two_sizes_an_octave_are_fewer():
    sizes = {half_octave_length(n) for n in range(64, 4097)}
    assert len(sizes) <= 14
    assert all(n <= half_octave_length(n) <= 1.5 * n for n in range(64, 4097))
