"""What rays pass through is no longer there."""

import numpy as np

from reconstruction.errors import ReconstructionError
from reconstruction.geometry.boxes import find_near_box
from reconstruction.geometry.rows import any_corner, cross_rows, find_lengths, sum_rows

MAX_SCALE = 30.0
"""New readings that reach so many times as far as the old ones are of another unit."""
MIN_RAYS = 3
"""So many rays must pass through a vertex's faces before it is believed."""
MAX_RAYS = 4096
"""Of more rays than this only a part is followed."""
MAX_HITS = 8
"""Of each ray so many hits are looked at."""
BEYOND = 0.01
"""Behind a hit the ray is taken up again, so many margins on."""
NUM_STRETCHES = 6
"""The rays are cut into so many stretches, and only faces in the box round one of these are looked at."""
NUM_SCALE_PROBES = 2048
PASSING_SHARE = 0.3
"""Gone is a vertex where rays that pass are more than this share of them and the readings that agree."""


def check_origins(origins: object, num_points: int) -> np.ndarray:
    """Return where each reading was made from, `[M, 3]`; one place `[3]` is meant for all.

    Raises:
        ReconstructionError: another shape, not numbers, NaN or infinity.
    """
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


def check_scale(new_points: np.ndarray, old_points: np.ndarray) -> None:
    """Refuse new points that cannot belong to the same place: another unit, or another frame.

    Raises:
        ReconstructionError: they reach, or lie, hundreds of times farther than the old ones, or the other way.
    """
    old_points, new_points = (
        points[:: max(1, len(points) // NUM_SCALE_PROBES)] for points in (old_points, new_points)
    )
    center = old_points.mean(axis=0)
    size = float(np.linalg.norm(np.ptp(old_points, axis=0)))
    new_size = float(np.linalg.norm(np.ptp(new_points, axis=0)))
    distance = float(np.linalg.norm(np.median(new_points, axis=0) - center))
    if new_size > MAX_SCALE * size or distance > MAX_SCALE * size:
        raise ReconstructionError(
            f"the new points extend over {new_size:.3g} m, {distance:.3g} m from a surface that extends over "
            f"{size:.3g} m; give them in metres and in the frame of the first scan"
        )


def find_passed(
    vertices: np.ndarray,
    faces: np.ndarray,
    points: np.ndarray,
    origins: np.ndarray,
    agreeing: np.ndarray,
    margin: float,
    reach: float,
) -> np.ndarray:
    """Return which vertices rays pass through: `[V]`.

    A ray passes through a face where it goes on by more than the margin behind it, measured along the face's
    normal, and neither ended nor met another face on that way: it did not only graze an edge.

    Args:
        vertices: `[V, 3]`.
        faces: `[F, 3]` int64.
        points: `[M, 3]` where the rays end.
        origins: `[M, 3]` where they begin.
        agreeing: `[V]` how many readings found each vertex where it was.
        margin: the distance up to which a reading agrees.
        reach: no face has all corners farther than this from all rays that meet it.
    """
    followed = max(1, -(-len(points) // MAX_RAYS))
    points, origins = points[::followed], origins[::followed]
    faces = _find_crossed(vertices, faces, points, origins, reach)
    if len(faces) == 0:
        return np.zeros(len(vertices), dtype=bool)
    ray, face, share, corner = _find_hits(vertices, faces, points, origins, margin)
    direction = (points - origins)[ray]
    a, b, c = vertices[faces[face]].swapaxes(0, 1)
    normal = cross_rows(b - a, c - a)
    normal /= np.maximum(find_lengths(normal)[..., None], 1e-300)
    steepness = np.abs(sum_rows(normal * direction))
    # The hits of one ray follow one another; the last is followed by the ray's end.
    is_last = np.append(ray[1:] != ray[:-1], True) if len(ray) else np.zeros(0, dtype=bool)
    onward = np.where(is_last, 1.0, np.append(share[1:], 1.0)) - share
    back = np.where(np.append(True, is_last[:-1]), np.inf, share - np.append(0.0, share[:-1]))
    passes = np.minimum(onward, back) * steepness > margin
    struck = faces[face, corner][passes]
    votes = np.bincount(struck, minlength=len(vertices))
    is_passed = (votes >= MIN_RAYS) & (votes > PASSING_SHARE * (votes + agreeing / followed))
    is_open = (votes > 0) & (agreeing == 0)
    while True:
        wider = is_passed.copy()
        wider[faces[any_corner(is_passed, faces)]] = True
        wider = is_passed | wider & is_open
        if (wider == is_passed).all():
            return is_passed
        is_passed = wider


def _find_crossed(
    vertices: np.ndarray, faces: np.ndarray, points: np.ndarray, origins: np.ndarray, reach: float
) -> np.ndarray:
    """Return the faces `[F', 3]` that rays may meet before their ends."""
    is_about = np.zeros(len(vertices), dtype=bool)
    first, last = np.ascontiguousarray(origins.T), np.ascontiguousarray(points.T)
    ends = [first + share * (last - first) for share in np.linspace(0, 1, NUM_STRETCHES + 1)]
    low, high = (np.array([pick(end, axis=1) for end in ends]) for pick in (np.min, np.max))
    for stretch in range(NUM_STRETCHES):
        box = np.concatenate([low[stretch : stretch + 2], high[stretch : stretch + 2]])
        is_about[find_near_box(vertices, box, reach)] = True
    return np.ascontiguousarray(faces[any_corner(is_about, faces)])


def _find_hits(
    vertices: np.ndarray,
    faces: np.ndarray,
    points: np.ndarray,
    origins: np.ndarray,
    reach: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the hits, in order: ray, face, share of the way, nearest corner, each `[H]`.

    The last of the way, as long as the reach, is left out: no ray passes through what it meets there.
    """
    import igl

    surface = igl.AABB()
    surface.init(vertices, faces)
    direction = points - origins
    length = np.maximum(find_lengths(direction), 1e-300)
    stop = 1 - reach / length
    ray, start = np.arange(len(points)), np.zeros(len(points))
    found: list[tuple[np.ndarray, ...]] = []
    for _ in range(MAX_HITS):
        way, left = direction[ray], stop[ray] - start
        at, share, _ = (
            np.asarray(part)
            for part in surface.intersect_ray_first(
                vertices, faces, origins[ray] + start[:, None] * way, left[:, None] * way, 1.0
            )
        )
        share = start + left * share
        is_hit = (at >= 0) & (left > 0) & (share < stop[ray])
        ray, face, share = ray[is_hit], at[is_hit], share[is_hit]
        if len(ray) == 0:
            break
        place = origins[ray] + share[:, None] * direction[ray]
        found.append((ray, face, share, ((vertices[faces[face]] - place[:, None]) ** 2).sum(2).argmin(1)))
        start = share + BEYOND * reach / length[ray]
    if not found:
        nothing = np.empty(0, dtype=np.int64)
        return nothing, nothing, np.empty(0), nothing
    ray, face, share, corner = (np.concatenate(part) for part in zip(*found, strict=True))
    order = np.lexsort((share, ray))
    return ray[order], face[order], share[order], corner[order]
