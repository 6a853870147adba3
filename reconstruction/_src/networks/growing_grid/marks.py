"""Marked units of a grid: widen them, close the gaps between them, find their patches."""

import numpy as np
from jaxtyping import Bool
from scipy.ndimage import binary_dilation, binary_erosion, label

_SQUARE = np.ones((3, 3), dtype=bool)


def dilate(is_marked: Bool[np.ndarray, "R C"], rings: int) -> Bool[np.ndarray, "R C"]:
    """Return the marked units and `rings` rings of neighbors, diagonal ones included."""
    if rings == 0:
        return is_marked
    return np.asarray(binary_dilation(is_marked, _SQUARE, iterations=rings), dtype=bool)


def close_gaps(is_marked: Bool[np.ndarray, "R C"], reach: int) -> Bool[np.ndarray, "R C"]:
    """Return the marked units with those in gaps of up to `2 * reach` units between them."""
    if reach == 0:
        return is_marked
    wide = dilate(np.pad(is_marked, reach), reach)
    closed = binary_erosion(wide, _SQUARE, iterations=reach, border_value=1)
    return np.asarray(closed, dtype=bool)[reach:-reach, reach:-reach]


def find_open_patches(is_marked: Bool[np.ndarray, "R C"]) -> Bool[np.ndarray, "R C"]:
    """Return the marked units of patches that reach the border of the grid."""
    patches = np.zeros(is_marked.shape, dtype=np.int32)
    label(is_marked, _SQUARE, output=patches)
    border = np.unique(np.concatenate([patches[0], patches[-1], patches[:, 0], patches[:, -1]]))
    return is_marked & np.isin(patches, border)
