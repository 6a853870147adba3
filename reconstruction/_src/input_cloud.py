"""What `reconstruct` is given, as one cloud: points with viewpoints and colors, near the origin of their frame."""

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from reconstruction._src.base.errors import ReconstructionError, ScanError
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.frames import find_offset
from reconstruction._src.scans.point_rows import check_points

_NUM_PROBES = 2048  # As many points of each cloud are enough to compare their sizes
_MAX_SCALE = 30.0  # New points belong to the same place within this many of its sizes


def make_cloud(
    points: ArrayLike | Cloud,
    *,
    viewpoints: ArrayLike | None = None,
    seen_from: ArrayLike | None = None,
    colors: ArrayLike | None = None,
) -> Cloud:
    """Return the points as a cloud, recentered where they are far from the origin."""
    cloud = points if isinstance(points, Cloud) else Cloud(check_points(points))
    changes: dict[str, object] = {"points": check_points(cloud.points)}
    if viewpoints is not None:
        changes |= {"viewpoints": _check_viewpoints(viewpoints), "seen_from": None}
    if seen_from is not None:
        changes["seen_from"] = seen_from
    if colors is not None:
        changes["colors"] = colors
    try:
        cloud = cloud.replace(**changes)
    except ScanError as error:
        raise ReconstructionError(str(error)) from error
    offset = find_offset(cloud.points)
    return cloud.shift(offset) if offset.any() else cloud


def make_cloud_of_rays(
    points: Float[np.ndarray, "N 3"],
    origins: Float[np.ndarray, "N 3"] | None,
    offset: Float[np.ndarray, " 3"],
) -> Cloud:
    """Return the cloud of points with the positions that they were seen from, or None where these are unknown."""
    if origins is None:
        return Cloud(points, offset=offset)
    viewpoints, index = np.unique(origins, axis=0, return_inverse=True)
    return Cloud(points, viewpoints=viewpoints, seen_from=index.ravel(), offset=offset)


def join_clouds(first: Cloud, second: Cloud) -> Cloud:
    """Return the points of both, which share a frame; what only one of them knows of its points is left out.

    So are viewpoints that only one of them has: points would be taken as seen from places that nobody saw them from,
    and the surface there turned around. Where a point's own of several is unknown for one cloud, it is for all.
    """
    viewpoints = [cloud.viewpoints for cloud in (first, second) if cloud.viewpoints is not None]
    if len(viewpoints) < 2 and first.num_points and second.num_points:
        viewpoints = []
    seen_from = colors = None
    if first.seen_from is not None and second.seen_from is not None:
        seen_from = np.concatenate([first.seen_from, second.seen_from + len(viewpoints[0])])
    if first.colors is not None and second.colors is not None:
        colors = np.concatenate([first.colors, second.colors])
    return Cloud(
        np.concatenate([first.points, second.points]),
        colors=colors,
        viewpoints=np.concatenate(viewpoints) if viewpoints else None,
        seen_from=seen_from,
        offset=first.offset,
    )


def check_origins(origins: ArrayLike, num_points: int) -> Float[np.ndarray, "M 3"]:
    """Return where each reading was made from; one place `[3]` stands for all."""
    array = _as_numbers("origins", origins)
    if array.shape not in ((3,), (num_points, 3)):
        raise ReconstructionError(
            f"origins must have the shape [3] (one place for all) or [{num_points}, 3], got {list(array.shape)}"
        )
    return np.ascontiguousarray(np.broadcast_to(array, (num_points, 3)))


def check_free_rays(free_rays: ArrayLike) -> Float[np.ndarray, "K 2 3"]:
    """Return rays that met nothing: where each began, and how far it went."""
    array = _as_numbers("free_rays", free_rays)
    if array.ndim != 3 or array.shape[1:] != (2, 3):
        raise ReconstructionError(
            f"free_rays must have the shape [K, 2, 3] (begin and end of each), got {list(array.shape)}"
        )
    return array


def check_scale(new_points: Float[np.ndarray, "M 3"], old_points: Float[np.ndarray, "N 3"]) -> None:
    """Refuse new points that cannot belong to the same place: another unit, or another frame."""
    old, new = (points[:: max(1, len(points) // _NUM_PROBES)] for points in (old_points, new_points))
    size, new_size = (float(np.linalg.norm(np.ptp(points, axis=0))) for points in (old, new))
    distance = float(np.linalg.norm(np.median(new, axis=0) - old.mean(axis=0)))
    if max(new_size, distance) > _MAX_SCALE * size:
        raise ReconstructionError(
            f"the new points extend over {new_size:.3g} m, {distance:.3g} m from a surface that extends over "
            f"{size:.3g} m; give them in meters and in the frame of the first scan"
        )


def _check_viewpoints(viewpoints: ArrayLike) -> Float[np.ndarray, "K 3"]:
    array = _as_numbers("viewpoints", viewpoints)
    if array.shape[-1:] != (3,) or array.ndim > 2 or not array.size:
        raise ReconstructionError(f"viewpoints must be one or more positions x, y, z, got {viewpoints!r}")
    return array.reshape(-1, 3)


def _as_numbers(name: str, values: ArrayLike) -> np.ndarray:
    """Return finite real numbers as an array."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ReconstructionError(f"{name} must be real numbers: {error}") from error
    if not np.isfinite(array).all():
        raise ReconstructionError(f"{name} must be finite, got NaN or infinity; leave those out")
    return array
