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
