"""The kernel of Warp, compiled at its first launch; imported only where the extra `gpu` is known to be installed."""

import warp as wp


@wp.kernel(enable_backward=False)
def write_rows(
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
