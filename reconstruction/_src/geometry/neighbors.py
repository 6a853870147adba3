"""Nearest neighbors of many points, found by several threads."""

import os
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree


def query_tree(
    tree: cKDTree, places: Float[np.ndarray, "N ... 3"], **options: Any
) -> tuple[Float[np.ndarray, "N ..."], Int[np.ndarray, "N ..."]]:
    """Return distances and numbers of the nearest points of a tree, as `tree.query` does with the same options.

    An interruption waits for the threads: those of `workers=` go on and write into memory that is free by then.
    """
    parts = np.array_split(places, os.cpu_count() or 1)
    with ThreadPoolExecutor(len(parts)) as pool:
        found = list(pool.map(lambda part: tree.query(part, **options), parts))
    distances, numbers = (np.concatenate(each) for each in zip(*found, strict=True))
    return distances, numbers
