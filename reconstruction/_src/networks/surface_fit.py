"""Fit a mesh to its samples by least squares: creases get sharp, the boundary comes out to the data.

A self-organizing map ends with every unit at the mean of the samples it wins. That rounds off edges and draws the
boundary inwards by half a cell. The fit takes the surface for what it is, a union of triangles, and moves the
vertices until the triangles, not the vertices, lie on the samples.

Per sample the closest point on the faces around its winner gives barycentric weights b and the residual r. Per vertex
ten moments are summed: b n nᵀ (upper triangle xx, xy, xz, yy, yz, zz; n the unit residual), b r and b. Vertices without
samples have zeros. A vertex moves by (A/c + aI)⁻¹ g/c, of its sums A of b n nᵀ, g of b r and c of b, a the stiffness.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int, Num

from reconstruction._src.geometry.rows import Faces, Vertices, compute_lengths
from reconstruction._src.networks.som.compilation import pad_rows, padded_length

Positions = Float[jax.Array, "V 3"]  # Of the vertices

_CPU_CHUNK, _GPU_CHUNK = 4096, 2**20
"""Samples treated at once: what fits the cache of a core, and plenty for a GPU. Powers of two, as array lengths are."""

OUTLIER_SCALE = 6.0
"""A sample this many times the mean residual from the faces around it has half its weight (Cauchy); lower
ignores more outliers, and more of the creases."""
MAX_RESIDUAL = 0.5  # Residuals count up to this for the mean, so that outliers do not raise it


class FitConfig(NamedTuple):
    """How a mesh is fitted to its samples. Lengths are in mean edges."""

    stiffness: float = 0.03
    """Share of the identity in every vertex's normal matrix: unwillingness to slide within the surface. Higher, and
    creases stay round; near 0 vertices without a crease drift."""
    step_limit: float = 0.4  # longest step of a vertex in one iteration; longer ones overshoot in folds
    reach: float = 2.0  # samples farther from the surface do not belong to it


def compute_chunk(num_samples: int) -> int:
    """Return how many samples to treat at once, a divisor of their number."""
    wanted = _CPU_CHUNK if next(iter(jnp.zeros(0).devices())).platform == "cpu" else _GPU_CHUNK
    while wanted > 1 and num_samples % wanted:
        wanted //= 2
    return wanted


class Samples(NamedTuple):
    """What a mesh is fitted to."""

    points: Float[jax.Array, "N 3"]
    winners: Int[jax.Array, " N"]  # nearest vertices
    weights: Float[jax.Array, " N"]
    order: Int[jax.Array, " N"] | None = None  # in which the faces round winners rise in number, for speed


def fit_once(
    vertices: Positions,
    ring: Int[jax.Array, "V D 2"],
    samples: Samples,
    config: FitConfig,
    chunk: int,
    is_movable: Bool[jax.Array, " V"],
    spread: Callable[[Float[jax.Array, "V 10"]], Float[jax.Array, "V 10"]] | None = None,
) -> Positions:
    """Return the vertices after one step towards the samples."""
    residual, corner, barycentric, along, weight = _compute_residuals(
        vertices, ring, samples, config.reach, chunk
    )
    capped = jnp.minimum(along, MAX_RESIDUAL)
    typical = jnp.sum(weight * capped) / jnp.maximum(jnp.sum(weight), 1e-9)
    weight = weight / (1 + (along / (OUTLIER_SCALE * typical + 1e-6)) ** 2)

    def accumulate(total, batch):
        r, corners, b, w = batch
        n = r / jnp.maximum(jnp.linalg.norm(r, axis=1, keepdims=True), 1e-12)
        outer = jnp.stack(
            [n[:, i] * n[:, j] for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))], axis=1
        )
        row = jnp.concatenate([outer, r, jnp.ones_like(r[:, :1])], axis=1)
        rows = (b * w[:, None])[:, :, None] * row[:, None, :]
        return total.at[corners.ravel()].add(rows.reshape(-1, 10)), None

    start = jnp.zeros((len(vertices), 10), vertices.dtype)
    moments = jax.lax.scan(accumulate, start, (residual, corner, barycentric, weight))[0]
    if spread is not None:
        moments = spread(moments)
    step = _solve_moments(moments, config.stiffness, config.step_limit)
    return vertices + jnp.where(is_movable[:, None], step, 0.0)


def _compute_residuals(
    vertices: Positions, ring: Int[jax.Array, "V D 2"], samples: Samples, reach: float, chunk: int
) -> tuple[jax.Array, ...]:
    """Return, in chunks, each sample's residual to the surface, and its weight, 0 beyond the reach.

    Between them: the corners of the nearest face, their barycentric weights, and the residual along its normal.
    """
    is_face = ring[..., 0] >= 0
    own = vertices[:, None]
    first = jnp.where(is_face[..., None], vertices[ring[..., 0]] - own, 0.0)
    second = jnp.where(is_face[..., None], vertices[ring[..., 1]] - own, 0.0)
    table = jnp.concatenate([first, second], axis=-1).transpose(1, 2, 0)  # [D, 6, V]
    degree = is_face.sum(axis=1)

    def select(batch):
        points, winner = batch
        offset = (points - vertices[winner]).T  # [3, n]
        return _closest_on_ring(offset, winner, table, degree[winner].max())

    def split(arrays):
        return jax.tree.map(lambda a: a.reshape(-1, chunk, *a.shape[1:]), arrays)

    def describe(batch):
        points, winner, weight, slot, second_weight, third_weight = batch
        offset = (points - vertices[winner]).T  # [3, n]
        sides = table.transpose(2, 0, 1)[winner, slot]  # [n, 6]
        side, other = sides[:, :3], sides[:, 3:]
        residual = offset.T - second_weight[:, None] * side - third_weight[:, None] * other
        corner = jnp.concatenate([winner[:, None], jnp.maximum(ring[winner, slot], 0)], axis=1)
        barycentric = jnp.stack([1 - second_weight - third_weight, second_weight, third_weight], axis=1)
        along = jnp.abs(_along_normal(side, other, residual))
        is_usable = is_face[winner, 0] & (jnp.sum(residual**2, axis=1) < reach**2)
        return residual, corner, barycentric, along, jnp.where(is_usable, weight, 0.0)

    points, winners, weights, order = samples
    sorted_by_degree = (points, winners) if order is None else (points[order], winners[order])
    found = [a.ravel() for a in jax.lax.map(select, split(sorted_by_degree))]
    if order is not None:
        found = [jnp.zeros_like(a).at[order].set(a, unique_indices=True) for a in found]
    return jax.lax.map(describe, split((points, winners, weights, *found)))


def _solve_moments(moments: Float[jax.Array, "V 10"], stiffness: float, step_limit: float) -> Positions:
    """Return every vertex's step (A/c + aI)⁻¹ g/c, a the stiffness, no longer than `step_limit`."""
    weight = jnp.maximum(moments[:, 9:], 1e-12)
    xx, xy, xz, yy, yz, zz = (moments[:, :6] / weight).T
    xx, yy, zz = xx + stiffness, yy + stiffness, zz + stiffness
    gx, gy, gz = (moments[:, 6:9] / weight).T
    # The inverse of a symmetric 3x3 matrix by its cofactors.
    cxx, cxy, cxz = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    cyy, cyz, czz = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    determinant = xx * cxx + xy * cxy + xz * cxz
    step = jnp.stack(
        [cxx * gx + cxy * gy + cxz * gz, cxy * gx + cyy * gy + cyz * gz, cxz * gx + cyz * gy + czz * gz], 1
    )
    step = jnp.where(moments[:, 9:] > 1e-9, step / determinant[:, None], 0.0)
    length = jnp.linalg.norm(step, axis=1, keepdims=True)
    return step * jnp.minimum(1.0, step_limit / jnp.maximum(length, 1e-12))


def _closest_on_ring(
    offset: Float[jax.Array, "3 n"],
    winner: Int[jax.Array, " n"],
    table: Float[jax.Array, "D 6 V"],
    depth: Int[jax.Array, ""],
) -> tuple[Int[jax.Array, " n"], Float[jax.Array, " n"], Float[jax.Array, " n"]]:
    """Return slot and the two barycentric weights of the closest point on a fan of faces."""

    def compare(slot, best):
        face = table[slot][:, winner]
        side, other = face[:3], face[3:]
        d00, d01, d11 = (side * side).sum(0), (side * other).sum(0), (other * other).sum(0)
        d20, d21 = (offset * side).sum(0), (offset * other).sum(0)
        determinant = d00 * d11 - d01 * d01
        inverse = 1 / jnp.where(determinant > 1e-9, determinant, 1.0)
        v, w = (d11 * d20 - d01 * d21) * inverse, (d00 * d21 - d01 * d20) * inverse
        is_inside = (v >= 0) & (w >= 0) & (v + w <= 1) & (determinant > 1e-9)
        on_side = jnp.clip(d20 / jnp.maximum(d00, 1e-12), 0, 1)
        on_other = jnp.clip(d21 / jnp.maximum(d11, 1e-12), 0, 1)
        across = d00 + d11 - 2 * d01
        on_across = jnp.clip((d21 - d20 - d01 + d00) / jnp.maximum(across, 1e-12), 0, 1)
        for cv, cw, allowed in (
            (v, w, is_inside),
            (on_side, 0.0 * on_side, ~is_inside),
            (0.0 * on_other, on_other, ~is_inside),
            (1 - on_across, on_across, ~is_inside),
        ):
            # |offset - v side - w other|² without its constant |offset|².
            distance = cv * (cv * d00 - 2 * d20 + 2 * cw * d01) + cw * (cw * d11 - 2 * d21)
            distance = jnp.where(allowed, distance, jnp.inf)
            is_closer = distance < best[0]
            best = jax.tree.map(partial(jnp.where, is_closer), (distance, slot, cv, cw), best)
        return best

    nothing = jnp.zeros(offset.shape[1], offset.dtype)
    start = (nothing + jnp.inf, jnp.zeros(offset.shape[1], jnp.int32), nothing, nothing)
    return jax.lax.fori_loop(0, depth, compare, start)[1:]


def _along_normal(
    side: Float[jax.Array, "n 3"], other: Float[jax.Array, "n 3"], residual: Float[jax.Array, "n 3"]
) -> Float[jax.Array, " n"]:
    """Return the part of the residual along the normal of the face between two sides."""
    normal = jnp.cross(side, other)
    return jnp.sum(normal * residual, axis=1) / jnp.maximum(jnp.linalg.norm(normal, axis=1), 1e-12)


_MIN_SAMPLES = 4096  # There is room for at least this many samples: smaller meshes share their programs
_MIN_DEPTH = 12  # There is room for this many faces around a vertex, or for twice as many, and so on
_CONFIG = FitConfig()  # How a mesh is fitted


def fit_surface(
    vertices: Num[np.ndarray, "V 3"],
    faces: Faces,
    samples: Num[np.ndarray, "N 3"],
    *,
    iterations: int = 3,
    winners: Int[np.ndarray, " N"],
    weights: Num[np.ndarray, " N"] | None = None,
    is_movable: Bool[np.ndarray, " V"] | None = None,
) -> Vertices:
    """Return vertices moved so that the faces lie on the samples.

    Samples beyond the boundary pull it out. Outliers count little: the weight falls with the part of the residual along
    the face's normal (Cauchy), and vanishes beyond `FitConfig.reach`.
    """
    vertices = np.asarray(vertices, dtype=np.float64)
    faces = np.asarray(faces)
    if len(faces) == 0 or len(samples) == 0 or iterations <= 0:
        return vertices.copy()
    center, scale = vertices.mean(axis=0), mean_edge_length(vertices, faces)
    if not scale > 0:
        return vertices.copy()
    num_samples, num_vertices = padded_length(len(samples), _MIN_SAMPLES), padded_length(len(vertices))
    ring = pad_rows(make_ring(faces, len(vertices)), num_vertices, -1)
    weights = np.ones(len(samples), np.float32) if weights is None else np.asarray(weights, np.float32)
    is_movable = np.ones(len(vertices), dtype=bool) if is_movable is None else is_movable
    scaled = pad_rows(np.asarray((vertices - center) / scale, dtype=np.float32), num_vertices)
    samples = pad_rows(np.asarray((samples - center) / scale, dtype=np.float32), num_samples)
    winners = pad_rows(np.asarray(winners, dtype=np.int32), num_samples)
    degree = (ring[..., 0] >= 0).sum(axis=1).astype(np.uint16)
    order = np.argsort(degree[winners], kind="stable").astype(np.int32)
    moved = _fit(
        scaled,
        ring,
        pad_rows(is_movable, num_vertices, False),
        Samples(samples, winners, pad_rows(weights, num_samples), order),  # pyright: ignore[reportArgumentType]
        np.int32(iterations),
        chunk=compute_chunk(num_samples),
    )
    step = np.asarray(moved - scaled)[: len(vertices)]
    return vertices + step.astype(np.float64) * scale


def mean_edge_length(vertices: Vertices, faces: Faces) -> float:
    """Return the mean length of the faces' sides."""
    corners = vertices[faces]
    return float(compute_lengths(corners - np.roll(corners, 1, axis=1)).mean())


def make_ring(faces: Faces, num_vertices: int) -> Int[np.ndarray, "V D 2"]:
    """Return the faces around every vertex: the other two corners of each in order, -1 where none."""
    owner = faces.ravel()
    others = np.stack([faces[:, [1, 2]], faces[:, [2, 0]], faces[:, [0, 1]]], axis=1).reshape(-1, 2)
    order = np.argsort(owner, kind="stable")
    count = np.bincount(owner, minlength=num_vertices)
    widest = int(count.max(initial=1))
    depth = _MIN_DEPTH * 2 ** max(0, (-(-widest // _MIN_DEPTH) - 1).bit_length())
    slot = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    ring = np.full((num_vertices, depth, 2), -1, dtype=np.int32)
    ring[owner[order], slot] = others[order]
    return ring


@partial(jax.jit, static_argnames="chunk")
def _fit(
    vertices: Positions,
    ring: Int[jax.Array, "V D 2"],
    is_movable: Bool[jax.Array, " V"],
    samples: Samples,
    iterations: Int[jax.Array, ""],
    *,
    chunk: int,
) -> Positions:
    """Repeat the step; all lengths in mean edges."""
    return jax.lax.fori_loop(
        0, iterations, lambda _, at: fit_once(at, ring, samples, _CONFIG, chunk, is_movable), vertices
    )
