"""Lone robots put on the ground of an arena."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.robot.scout_constants import ScoutConfig

LIFT = 0.002
"""Gap between the tracks and the ground at the start [m]: without one, contacts would begin with a push."""
STEEPEST = np.deg2rad(35.0)
"""Robots are placed on no steeper ground [rad]: a track of friction 0.7 slips there."""
_SAMPLES = 5
"""Heights are read at this many places along each side of a footprint."""


def lay_robots(
    arena: Arena, poses: Float[np.ndarray, "N 3"], scout: ScoutConfig
) -> tuple[Float[np.ndarray, "N 3"], Float[np.ndarray, "N 3 3"]]:
    """Return positions [m] and rotations of robots that stand on the ground.

    A robot stands on the plane that fits the ground below it best, lifted so that it clears all of it.
    """
    poses = np.asarray(poses, dtype=np.float64)
    if poses.ndim != 2 or poses.shape[1] != 3 or not np.isfinite(poses).all():
        raise ArenaError(f"poses of shape {poses.shape}; rows of finite x, y and heading are needed")
    side = np.linspace(-0.5, 0.5, _SAMPLES)
    local = np.stack(np.meshgrid(side * scout.size[0], side * scout.size[1], indexing="ij"), axis=-1)
    local = local.reshape(-1, 2)
    cosine, sine = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    turn = np.stack([np.stack([cosine, -sine], -1), np.stack([sine, cosine], -1)], axis=-2)
    spots = np.einsum("nij,sj->nsi", turn, local)
    world = spots + poses[:, None, :2]
    heights = np.asarray(arena.height(*world.reshape(-1, 2).T), dtype=np.float64).reshape(world.shape[:2])
    for robot in np.flatnonzero(~np.isfinite(heights).all(axis=1)):
        x, y = poses[robot, :2]
        raise ArenaError(f"robot {robot} at ({x:.2f}, {y:.2f}) lies off the surface of arena {arena.name!r}")
    _check_apart(poses, scout)
    slope = np.stack([_fit_plane(one, high) for one, high in zip(spots, heights, strict=True)])
    normal = np.column_stack([-slope, np.ones(len(slope))])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    _check_steepness(poses, normal, arena)
    ahead = np.column_stack([cosine, sine, np.zeros(len(poses))])
    ahead -= np.einsum("ni,ni->n", ahead, normal)[:, None] * normal
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    rotation = np.stack([ahead, np.cross(normal, ahead), normal], axis=-1)
    offset = np.einsum("nsi,ni->ns", spots, normal[:, :2]) + heights * normal[:, 2:]
    lift = offset.max(axis=1) + scout.size[2] / 2 + LIFT
    foot = np.column_stack([poses[:, :2], np.zeros(len(poses))])
    return foot + np.column_stack([np.zeros((len(poses), 2)), lift / normal[:, 2]]), rotation


def _fit_plane(spots: Float[np.ndarray, "S 2"], heights: Float[np.ndarray, " S"]) -> Float[np.ndarray, " 2"]:
    return np.linalg.lstsq(np.column_stack([spots, np.ones(len(spots))]), heights, rcond=None)[0][:2]


def _check_apart(poses: Float[np.ndarray, "N 3"], scout: ScoutConfig) -> None:
    """Refuse robots that overlap: rectangles from the back of the chassis to the tip of the level arm."""
    ahead = np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=1)
    middles = poses[:, :2] + (scout.arm_reach - scout.size[0] / 2) / 2 * ahead
    half = np.array([scout.arm_reach + scout.size[0] / 2, scout.size[1]]) / 2
    apart = np.linalg.norm(middles[:, None] - middles[None], axis=-1)
    for first, second in np.argwhere(np.triu(apart < 2 * np.hypot(*half), k=1)):
        axes = [np.array([[x, y], [-y, x]]) for x, y in ahead[[first, second]]]
        if not _is_separated(middles[second] - middles[first], axes, half):
            raise ArenaError(
                f"robots {first} and {second} at {apart[first, second]:.3f} m overlap; place them farther apart"
            )


def _is_separated(
    between: Float[np.ndarray, " 2"], axes: list[Float[np.ndarray, "2 2"]], half: Float[np.ndarray, " 2"]
) -> bool:
    """Return whether a side of one of two equal rectangles separates them."""
    for own in axes:
        reach = sum(np.abs(own @ other.T) @ half for other in axes)
        if (np.abs(own @ between) >= reach).any():
            return True
    return False


def _check_steepness(poses: Float[np.ndarray, "N 3"], normal: Float[np.ndarray, "N 3"], arena: Arena) -> None:
    steep = np.arccos(np.clip(normal[:, 2], -1.0, 1.0))
    for robot in np.flatnonzero(steep > STEEPEST):
        raise ArenaError(
            f"the ground of {arena.name!r} below robot {robot} is {np.rad2deg(steep[robot]):.0f} degrees steep; "
            f"{np.rad2deg(STEEPEST):.0f} are possible"
        )
