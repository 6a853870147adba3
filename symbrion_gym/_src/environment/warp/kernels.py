"""Kernels of Warp, compiled at their first launch; imported only where the extra `gpu` is known to be installed."""

import warp as wp


@wp.kernel(enable_backward=False)
def write_entries(
    rows: wp.array[int], columns: wp.array[int], source: wp.array2d[float], target: wp.array2d[float]
):
    """Write `source[i, k]` to `target[rows[i], columns[k]]`."""
    i, k = wp.tid()  # pyright: ignore
    target[rows[i], columns[k]] = source[i, k]  # pyright: ignore


@wp.kernel(enable_backward=False)
def write_all(columns: wp.array[int], source: wp.array2d[float], target: wp.array2d[float]):
    """Write `source[i, k]` to `target[i, columns[k]]`."""
    i, k = wp.tid()  # pyright: ignore
    target[i, columns[k]] = source[i, k]  # pyright: ignore


@wp.kernel(enable_backward=False)
def write_chosen(
    mask: wp.array[wp.bool],
    numbers: wp.array[int],
    columns: wp.array[int],
    source: wp.array2d[float],
    target: wp.array2d[float],
):
    """Write `source[numbers[i], k]` to `target[i, columns[k]]` where `mask[i]`."""
    i, k = wp.tid()  # pyright: ignore
    if mask[i]:
        target[i, columns[k]] = source[numbers[i], k]  # pyright: ignore


@wp.kernel(enable_backward=False)
def clear_chosen(mask: wp.array[wp.bool], target: wp.array2d[float]):
    """Set all entries of the worlds of a mask to 0."""
    i, k = wp.tid()  # pyright: ignore
    if mask[i]:
        target[i, k] = 0.0  # pyright: ignore
