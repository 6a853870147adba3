"""Where the ground is more or less slippery than elsewhere: patches seen from above, each with its friction."""

from dataclasses import dataclass, replace

import numpy as np
import trimesh
from jaxtyping import Float, Int

from reconstruction._src.base.range_checks import check_not_negative
from reconstruction._src.geometry.rows import make_hull
from symbrion_gym._src.arenas.checks import check_friction
from symbrion_gym._src.errors import ArenaError

Outline = tuple[tuple[float, float], ...]  # Corners (x, y) of a convex polygon, counter-clockwise [m]
_STRAIGHT = 1e-9  # Corners that turn right by less than this area are on a line [m²]


@dataclass(frozen=True)
class FrictionPatch:
    """A part of the ground with a friction of its own.

    Attributes:
        friction: sliding friction on it.
        outlines: convex polygons seen from above, counter-clockwise, that make it up together [m].
        half_width: half-width of the 95 % interval of the friction; 0 where it is exact.

    Raises:
        ArenaError: the friction is out of range, or an outline is no convex polygon.
    """

    friction: float
    outlines: tuple[Outline, ...]
    half_width: float = 0.0

    def __post_init__(self) -> None:
        check_friction(self.friction, "friction of a patch")
        check_not_negative(self, ("half_width",), ArenaError)
        outlines = tuple(tuple((float(x), float(y)) for x, y in outline) for outline in self.outlines)
        if not outlines:
            raise ArenaError("a friction patch has no outline; one convex polygon is the least")
        for outline in outlines:
            _check_outline(outline)
        object.__setattr__(self, "outlines", outlines)

    @classmethod
    def of_rectangle(
        cls, low: tuple[float, float], high: tuple[float, float], friction: float, half_width: float = 0.0
    ) -> "FrictionPatch":
        """Make a patch of the lowest and the highest x and y of a rectangle [m]."""
        outline = ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]))
        return cls(friction, (outline,), half_width)

    def contains(self, places: Float[np.ndarray, "N D"]) -> np.ndarray:
        """Return which places (x, y, ...) lie in it, seen from above."""
        return np.any([_is_inside(places[:, :2], outline) for outline in self.outlines], axis=0)


@dataclass(frozen=True)
class FrictionMap:
    """The friction of a ground by place. Outside of all patches it is that of the arena.

    Patches are columns: all of the ground below an outline is part of them. Where patches overlap, the first holds.

    Attributes:
        patches: what differs from the arena's own friction.
        half_width: half-width of the 95 % interval of the arena's own friction; 0 where it is exact.

    Raises:
        ArenaError: a half-width is negative.
    """

    patches: tuple[FrictionPatch, ...] = ()
    half_width: float = 0.0

    def __post_init__(self) -> None:
        check_not_negative(self, ("half_width",), ArenaError)
        object.__setattr__(self, "patches", tuple(self.patches))

    def find_patches(self, places: Float[np.ndarray, "N D"]) -> Int[np.ndarray, " N"]:
        """Return the number of the patch of every place (x, y, ...); -1 outside of all."""
        found = np.full(len(places), -1)
        for number in reversed(range(len(self.patches))):
            found[self.patches[number].contains(places)] = number
        return found

    def find_friction(self, places: Float[np.ndarray, "N D"], friction: float) -> Float[np.ndarray, " N"]:
        """Return the sliding friction at every place (x, y, ...), `friction` outside of all patches."""
        return np.array([*(patch.friction for patch in self.patches), friction])[self.find_patches(places)]

    def stretch(self, factor: float, shift: float = 0.0) -> "FrictionMap":
        """Return the map with all lengths along x multiplied, then moved along x [m]."""
        patches = []
        for patch in self.patches:
            outlines = tuple(tuple((factor * x + shift, y) for x, y in outline) for outline in patch.outlines)
            patches.append(replace(patch, outlines=outlines))
        return FrictionMap(tuple(patches), self.half_width)


def _is_inside(places: Float[np.ndarray, "N 2"], outline: Outline) -> np.ndarray:
    corners = np.array(outline)
    edges = np.roll(corners, -1, axis=0) - corners
    away = places[:, None] - corners
    return np.all(edges[:, 0] * away[..., 1] - edges[:, 1] * away[..., 0] >= 0.0, axis=1)


def _check_outline(outline: Outline) -> None:
    corners = np.array(outline)
    if corners.ndim != 2 or corners.shape[0] < 3 or not np.isfinite(corners).all():
        raise ArenaError(f"outline is {outline}; three or more finite corners (x, y) are needed")
    edges = np.roll(corners, -1, axis=0) - corners
    following = np.roll(edges, -1, axis=0)
    turns = edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0]
    angle = np.arctan2(turns, (edges * following).sum(axis=1)).sum()
    if turns.min() < -_STRAIGHT or turns.max() <= _STRAIGHT or not np.isclose(angle, 2 * np.pi):
        raise ArenaError(
            f"outline is {outline}; a convex polygon, counter-clockwise, is needed: split others, or reverse them"
        )


SLIVER = 1e-3
"""What reaches less than this across an outline is not cut off [m]: robots do not feel it, and MuJoCo compiles nothing
much thinner."""


def split_pieces(pieces: list[trimesh.Trimesh], friction_map: FrictionMap) -> list[trimesh.Trimesh]:
    """Return the pieces, those cut that the outline of a patch crosses; the others are the same objects."""
    outlines = [outline for patch in friction_map.patches for outline in patch.outlines]
    return [part for piece in pieces for part in _split_piece(piece, outlines)]


def find_piece_patches(pieces: list[trimesh.Trimesh], friction_map: FrictionMap) -> list[int]:
    """Return the number of the patch that each of the pieces lies in; -1 outside of all."""
    middles = np.array([piece.vertices.mean(axis=0) for piece in pieces]).reshape(-1, 3)
    return friction_map.find_patches(middles).tolist()


def _split_piece(piece: trimesh.Trimesh, outlines: list[Outline]) -> list[trimesh.Trimesh]:
    inside, rest = [], [piece]
    for outline in outlines:
        parts, rest = rest, []
        for part in parts:
            common, others = _cut_out(part, outline)
            inside += common
            rest += others
    return inside + rest


def _cut_out(piece: trimesh.Trimesh, outline: Outline) -> tuple[list[trimesh.Trimesh], list[trimesh.Trimesh]]:
    """Return the part of a piece below an outline, none or one, and the parts outside of it."""
    corners = np.array(outline)
    low, high = piece.bounds[:, :2]
    if (corners.max(axis=0) <= low).any() or (corners.min(axis=0) >= high).any():
        return [], [piece]
    left, outside = piece, []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        normal = np.array([start[1] - end[1], end[0] - start[0], 0.0]) / np.hypot(*(end - start))
        within, beyond = cut_solid(left, normal, float(normal[:2] @ start))
        if within is None:
            return [], [piece]
        outside += [] if beyond is None else [beyond]
        left = within
    return [left], outside


def cut_solid(
    piece: trimesh.Trimesh, normal: Float[np.ndarray, " 3"], offset: float
) -> tuple[trimesh.Trimesh | None, trimesh.Trimesh | None]:
    """Return the parts of a convex solid above and below a plane; None for one that would be a sliver."""
    vertices = np.asarray(piece.vertices, dtype=np.float64)
    height = vertices @ normal - offset
    if height.min() >= -SLIVER:
        return piece, None
    if height.max() <= SLIVER:
        return None, piece
    first, second = piece.edges_unique.T
    crosses = height[first] * height[second] < 0.0
    a, b = first[crosses], second[crosses]
    share = height[a] / (height[a] - height[b])
    section = vertices[a] + share[:, None] * (vertices[b] - vertices[a])
    above, below = (
        make_hull(np.concatenate([vertices[side], section])) for side in (height >= 0.0, height <= 0.0)
    )
    if above is None or below is None:
        return (piece, None) if below is None else (None, piece)
    return above, below
