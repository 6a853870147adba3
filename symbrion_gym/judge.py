"""The strict test of success, and everything else that ends an episode.

Success means that EVERY module lies beyond the finish, at ground height and upright, for 0.3 s, that none
ever rolled over on the way, and that the body was not faster than its tracks. A test of the tail alone is
cheated at once by somersaults and by folding the body through itself.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symbrion_gym.world import Physics, World

HOLD_TIME = 0.3
"""How long the body must have arrived [s]."""
UPRIGHT = 0.5
"""Smallest z component of the up axis of an upright module."""
ROLLED_OVER = -0.3
"""Below this z component of its up axis a module has rolled over."""
GROUND_BAND = (0.02, 0.11)
"""Height of a module's centre above the ground that counts as standing on it [m]."""
SPEED_SLACK = 0.05
"""What a body may be ahead of its tracks' path, for falling forwards [m]."""
STUCK_PROGRESS = 0.02
"""Progress that counts as moving on [m]."""
LARGEST_SPEED = 50.0
"""A coordinate faster than this [m/s or rad/s] means that the simulation has diverged."""
_FLOOR_BAND = 0.01


class Verdict(NamedTuple):
    """What is found at one tick, each `[N]`.

    Attributes:
        success: arrived and stayed.
        rolled_over: a module lies on its back.
        fell: a module left the arena.
        touched_pit: a module touched the floor of the pit (with `abyss` only).
        diverged: the numbers are no longer physics.
        is_arrived: every module beyond the finish, at ground height and upright, now.
    """

    success: np.ndarray
    rolled_over: np.ndarray
    fell: np.ndarray
    touched_pit: np.ndarray
    diverged: np.ndarray
    is_arrived: np.ndarray


class Judge:
    """Judges N simulations; stateless but for constants."""

    def __init__(self, world: World) -> None:
        self._arena, self._route = world.arena, world.route
        self._direction = np.array(world.route.direction)
        self._abyss = world.config.abyss and world.route.pit is not None
        self._half = world.organism.scout.size[2] / 2
        self._hold_ticks = max(1, int(np.ceil(HOLD_TIME / world.config.dt - 1e-9)))
        self._is_level = world.route.heading == 0.0 and world.route.lateral == 0.0

    def find_distance(self, position: np.ndarray) -> np.ndarray:
        """Return how far along the route each module is, `[N, n]` [m]."""
        if self._is_level:
            return position[:, :, 0]
        c, s = self._direction
        return c * position[:, :, 0] + s * position[:, :, 1]

    def find_diverged(self, physics: Physics) -> np.ndarray:
        """Return whether the numbers of each simulation are no longer physics, `[N]`."""
        fastest = np.maximum.reduce(np.abs(physics.qvel), axis=1)
        farthest = np.maximum.reduce(np.abs(physics.qpos), axis=1)
        return ~((fastest < LARGEST_SPEED) & (farthest < 1e3))

    def judge(
        self,
        physics: Physics,
        distance: np.ndarray,
        held: np.ndarray,
        allowed: np.ndarray,
        diverged: np.ndarray,
    ) -> Verdict:
        """Judge the present tick.

        Args:
            physics: the simulations.
            distance: `[N, n]` from `find_distance`.
            held: `[N]` ticks for which the body has arrived; updated in place.
            allowed: `[N]` how far a body may have come by now [m], in the mean over its modules.
            diverged: `[N]` from `find_diverged`.
        """
        route, position, up = self._route, physics.position, physics.rotation[:, :, 8]
        rolled_over = np.minimum.reduce(up, axis=1) < ROLLED_OVER
        if self._is_level:
            across = np.abs(position[:, :, 1])
        else:
            c, s = self._direction
            across = np.abs(c * position[:, :, 1] - s * position[:, :, 0] - route.lateral)
        fell = np.maximum.reduce(across, axis=1) > route.half_width
        fell |= np.minimum.reduce(position[:, :, 2], axis=1) < route.lowest
        is_arrived = np.minimum.reduce(distance, axis=1) > route.finish
        if is_arrived.any():
            is_arrived &= self._is_standing(position, up)
            is_arrived &= np.add.reduce(distance, axis=1) / distance.shape[1] <= allowed
        held += 1
        held *= is_arrived
        success = (held >= self._hold_ticks) & ~(rolled_over | fell | diverged)
        touched = self._find_touched(physics, distance) if self._abyss else np.zeros_like(success)
        return Verdict(
            success & ~touched, rolled_over & ~diverged, fell & ~diverged, touched, diverged, is_arrived
        )

    def _is_standing(self, position: np.ndarray, up: np.ndarray) -> np.ndarray:
        with np.errstate(invalid="ignore"):
            above = position[:, :, 2] - self._arena.height(position[:, :, 0], position[:, :, 1])
            is_low = (above > GROUND_BAND[0]) & (above < GROUND_BAND[1])
            return (is_low & (up > UPRIGHT)).all(axis=1)

    def _find_touched(self, physics: Physics, distance: np.ndarray) -> np.ndarray:
        near, far, floor = self._route.pit or (0.0, 0.0, 0.0)
        reach = self._half * np.add.reduce(np.abs(physics.rotation[:, :, 6:9:2]), axis=2)
        is_over = (distance > near) & (distance < far)
        is_down = physics.position[:, :, 2] - reach < floor + _FLOOR_BAND
        return (is_over & is_down).any(axis=1)
