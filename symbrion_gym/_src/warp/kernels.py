"""Kernels of Warp, compiled at their first launch; imported only where the extra `gpu` is known to be installed."""

import warp as wp


@wp.kernel(enable_backward=False)
def write_entries(
    rows: wp.array[int], columns: wp.array[int], source: wp.array2d[float], target: wp.array2d[float]
):
    """Write `source[i, k]` to `target[rows[i], columns[k]]`.

    Args:
        rows: `[R]` worlds that are written.
        columns: `[K]` entries of a world that are written.
        source: `[R, K]` values.
        target: `[N, C]` written in place.
    """
    i, k = wp.tid()  # pyright: ignore
    target[rows[i], columns[k]] = source[i, k]  # pyright: ignore


@wp.kernel(enable_backward=False)
def write_all(columns: wp.array[int], source: wp.array2d[float], target: wp.array2d[float]):
    """Write `source[i, k]` to `target[i, columns[k]]`.

    Args:
        columns: `[K]` entries of a world that are written.
        source: `[N, K]` values.
        target: `[N, C]` written in place.
    """
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
    """Write `source[numbers[i], k]` to `target[i, columns[k]]` where `mask[i]`.

    Args:
        mask: `[N]` worlds that are written.
        numbers: `[N]` row of the source for each world.
        columns: `[K]` entries of a world that are written.
        source: `[S, K]` values.
        target: `[N, C]` written in place.
    """
    i, k = wp.tid()  # pyright: ignore
    if mask[i]:
        target[i, columns[k]] = source[numbers[i], k]  # pyright: ignore


@wp.kernel(enable_backward=False)
def clear_chosen(mask: wp.array[wp.bool], target: wp.array2d[float]):
    """Set all entries of the worlds of a mask to 0.

    Args:
        mask: `[N]` worlds that are cleared.
        target: `[N, C]` written in place.
    """
    i, k = wp.tid()  # pyright: ignore
    if mask[i]:
        target[i, k] = 0.0  # pyright: ignore
