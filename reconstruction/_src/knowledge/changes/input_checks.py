"""Refuse new readings that cannot belong to the surface, and origins that are none."""

import numpy as np
from jaxtyping import Float

from reconstruction._src.base.errors import ReconstructionError

NUM_SCALE_PROBES = 2048  # As many points of each cloud are enough to compare their sizes


def check_origins(origins: object, num_points: int) -> Float[np.ndarray, "M 3"]:
    """Return where each reading was made from; one place `[3]` stands for all."""
    try:
        array = np.asarray(origins)
        if array.dtype.kind not in "fiu":
            raise TypeError(f"values are {array.dtype}")
    except (TypeError, ValueError) as error:
        raise ReconstructionError(f"origins must be real numbers x, y, z: {error}") from error
    array = array.astype(np.float64)
    if array.shape not in ((3,), (num_points, 3)):
        raise ReconstructionError(
            f"origins must have the shape [3] (one place for all) or [{num_points}, 3] (one a point), "
            f"got {list(array.shape)}"
        )
    if not np.isfinite(array).all():
        raise ReconstructionError(
            f"{int((~np.isfinite(array)).sum())} of the values in origins are NaN or infinite; "
            "leave out the points whose origin is unknown"
        )
    return np.ascontiguousarray(np.broadcast_to(array, (num_points, 3)))


def check_free_rays(free_rays: object) -> Float[np.ndarray, "K 2 3"]:
    """Return rays that met nothing: where each began, and how far it went."""
    try:
        array = np.asarray(free_rays, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ReconstructionError(f"free_rays must be real numbers: {error}") from error
    if array.ndim != 3 or array.shape[1:] != (2, 3):
        raise ReconstructionError(
            f"free_rays must have the shape [K, 2, 3] (begin and end of each), got {list(array.shape)}"
        )
    if not np.isfinite(array).all():
        raise ReconstructionError("free_rays holds NaN or infinity; end each ray where it was surely free")
    return array


def check_scale(
    new_points: Float[np.ndarray, "M 3"], old_points: Float[np.ndarray, "N 3"], max_scale: float = 30.0
) -> None:
    """Refuse new points that cannot belong to the same place: another unit, or another frame."""
    old_points, new_points = (
        points[:: max(1, len(points) // NUM_SCALE_PROBES)] for points in (old_points, new_points)
    )
    center = old_points.mean(axis=0)
    size = float(np.linalg.norm(np.ptp(old_points, axis=0)))
    new_size = float(np.linalg.norm(np.ptp(new_points, axis=0)))
    distance = float(np.linalg.norm(np.median(new_points, axis=0) - center))
    if new_size > max_scale * size or distance > max_scale * size:
        raise ReconstructionError(
            f"the new points extend over {new_size:.3g} m, {distance:.3g} m from a surface that extends over "
            f"{size:.3g} m; give them in meters and in the frame of the first scan"
        )
