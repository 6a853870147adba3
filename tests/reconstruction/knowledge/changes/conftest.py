"""A surface that new readings are compared with."""

import numpy as np
import pytest

SIDE = 21
SPACING = 0.1


@pytest.fixture(scope="module")
def sheet() -> tuple[np.ndarray, np.ndarray]:
    """A flat sheet 2 m x 2 m: (vertices, faces)."""
    x, y = np.meshgrid(np.arange(SIDE), np.arange(SIDE), indexing="ij")
    corner = (np.arange(SIDE - 1)[:, None] * SIDE + np.arange(SIDE - 1)).ravel()
    lower = np.stack([corner, corner + SIDE, corner + SIDE + 1], axis=1)
    upper = np.stack([corner, corner + SIDE + 1, corner + 1], axis=1)
    vertices = SPACING * np.stack([x.ravel(), y.ravel(), np.zeros(SIDE**2)], axis=1)
    return vertices, np.concatenate([lower, upper])
