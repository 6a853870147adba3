"""What `reconstruct` is given, as one cloud: points with viewpoints and colors, near the origin of their frame."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from reconstruction._src.base.errors import ReconstructionError, ScanError
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.frames import find_offset
from reconstruction._src.scans.point_rows import check_points


def make_cloud(
    points: ArrayLike | Cloud,
    *,
    viewpoints: ArrayLike | None = None,
    seen_from: ArrayLike | None = None,
    colors: ArrayLike | None = None,
) -> Cloud:
    """Return the points as a cloud, recentered where they are far from the origin."""
    given = points if isinstance(points, Cloud) else None
    checked = check_points(points.points if isinstance(points, Cloud) else points)
    if viewpoints is not None:
        viewpoints = _check_viewpoints(viewpoints)
    elif given is not None:
        viewpoints = given.viewpoints
        seen_from = given.seen_from if seen_from is None else seen_from
    if colors is None and given is not None:
        colors = given.colors
    try:
        cloud = Cloud(
            checked,
            colors=None if colors is None else np.asarray(colors),
            viewpoints=viewpoints,
            seen_from=None if seen_from is None else np.asarray(seen_from),
            offset=np.zeros(3) if given is None else given.offset,
        )
    except ScanError as error:
        raise ReconstructionError(str(error)) from error
    offset = find_offset(cloud.points)
    return shift_frame(cloud, offset) if offset.any() else cloud


def shift_frame(cloud: Cloud, offset: Float[np.ndarray, " 3"]) -> Cloud:
    """Return a cloud with an offset subtracted from its positions, and added to its own offset [m]."""
    viewpoints = None if cloud.viewpoints is None else cloud.viewpoints - offset
    return cloud.replace(points=cloud.points - offset, viewpoints=viewpoints, offset=cloud.offset + offset)


def align(readings: Cloud, cloud: Cloud) -> Cloud:
    """Return readings in the frame of a cloud, with its viewpoints where they have none."""
    readings = shift_frame(readings, cloud.offset - readings.offset)
    if readings.viewpoints is None and cloud.viewpoints is not None:
        readings = readings.replace(viewpoints=cloud.viewpoints)
    return readings


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


def _check_viewpoints(viewpoints: ArrayLike) -> Float[np.ndarray, "K 3"]:
    """Return the viewpoints as an array `[K, 3]`."""
    try:
        array = np.asarray(viewpoints, dtype=np.float64)
        is_right = array.shape[-1:] == (3,) and array.ndim <= 2 and array.size and np.isfinite(array).all()
    except (TypeError, ValueError):
        array, is_right = np.zeros((0, 3)), False
    if not is_right:
        raise ReconstructionError(
            f"viewpoints must be one or more finite positions x, y, z, got {viewpoints!r}"
        )
    return array.reshape(-1, 3)
