"""From actions to targets of the hinges' servos and speeds of the tracks."""

from __future__ import annotations

from collections.abc import Iterable
from math import isfinite
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from symbrion_gym._src.environment.world import World
from symbrion_gym._src.errors import OptionError


class Commands:
    """What the actions of N simulations command; every row is computed alike whatever N is.

    Args:
        world: world of the simulations.
        num: number of simulations.

    Attributes:
        target: `[N, h]` commanded angles of the servos [rad]: hinges, then rotations of arms if there are any.
        action: `[N, A]` the last action, after clipping.
        num_tracks: number of track speeds in an action.
        num_actions: length of an action.
    """

    def __init__(self, world: World, num: int) -> None:
        config, hinges, scout = world.config, world.num_hinges, world.organism.scout
        modules = world.num_modules
        self.num_tracks = {"constant": 0, "body": 1, "modules": modules, "skid": 2 * modules}[
            config.track_control
        ]
        self.num_actions = hinges + self.num_tracks
        self.target = np.zeros((num, hinges))
        self.action = np.zeros((num, self.num_actions))
        self._num_hinges, self._is_skid = hinges, config.track_control == "skid"
        self._speed = np.zeros((num, 1))
        self._highest_action = np.ones((num, self.num_actions))
        self._lowest_action = -self._highest_action
        self._range = np.tile(world.servo_range, (num, 1))
        self._largest_turn = np.full((num, hinges), scout.hinge_speed * config.dt)
        self._smallest_turn = -self._largest_turn
        self._turn = np.zeros((num, hinges))

    def begin(self, row: int, hinges: Float[np.ndarray, " h"], track_speed: float) -> None:
        """Start an episode in one simulation: the hinges are held as they are and the tracks run forward."""
        self.target[row] = hinges
        self.action[row, : self._num_hinges] = np.clip(self.target[row] / self._range[row], -1.0, 1.0)
        self.action[row, self._num_hinges :] = 1.0
        self._speed[row] = track_speed

    def take(
        self, actions: Float[np.ndarray, "N A"], active: Bool[np.ndarray, " N"] | None = None
    ) -> tuple[Float[np.ndarray, "N h"], Float[np.ndarray, "N tracks"]]:
        """Take actions: move the servos' targets at their speed.

        Values are clipped to ±1.
        """
        used = self.action
        if not isfinite(np.vdot(actions, actions)):
            self._refuse_infinite(actions, active)
        if active is not None:
            actions = np.where(active[:, None], actions, used)
        np.maximum(actions, self._lowest_action, out=used)
        np.minimum(used, self._highest_action, out=used)
        target, turn = self.target, self._turn
        np.multiply(used[:, : self._num_hinges] if self.num_tracks else used, self._range, turn)
        np.subtract(turn, target, turn)
        np.maximum(turn, self._smallest_turn, out=turn)
        np.minimum(turn, self._largest_turn, out=turn)
        if active is None:
            np.add(target, turn, target)
        else:
            np.add(target, turn, out=target, where=active[:, None])
        return target, self.compute_track_speed()

    def _refuse_infinite(
        self, actions: Float[np.ndarray, "N A"], active: Bool[np.ndarray, " N"] | None
    ) -> None:
        """Refuse what is no number in the simulations that are stepped."""
        wrong = ~np.isfinite(actions)
        if active is not None:
            wrong &= active[:, None]
        if wrong.any():
            row, column = (int(each) for each in np.argwhere(wrong)[0])
            where = f" of simulation {row}" if len(actions) > 1 else ""
            hinges = self._num_hinges
            what = f"hinge {column}" if column < hinges else f"track speed {column - hinges}"
            raise OptionError(
                f"action[{column}]{where} ({what}) is {actions[row, column]}; a number from -1 to 1 is needed"
            )

    def compute_track_speed(self) -> np.ndarray:
        """Return commanded track speeds [m/s], `[N, 1, n or 2n]`."""
        return self._speed * self.action[:, -self.num_tracks :] if self.num_tracks else self._speed

    def compute_head_speed(self) -> Float[np.ndarray, " N"]:
        """Return the commanded speed of the head's tracks [m/s], the mean of its sides."""
        speed = self.compute_track_speed()
        return speed[:, :2].mean(axis=1) if self._is_skid else speed[:, 0]


_PACKAGE = __name__.partition(".")[0]


def link_views(source: object, memo: dict[int, Any]) -> None:
    """Let a deep copy keep views what they are: arrays that share memory in the source share it in the copy as well."""
    seen: set[int] = set()
    waiting: list[Any] = [source]
    while waiting:
        value = waiting.pop()
        if id(value) in seen or id(value) in memo:
            continue
        seen.add(id(value))
        if isinstance(value, np.ndarray):
            _copy_array(value, memo)
        else:
            waiting.extend(_list_parts(value))


def _list_parts(value: object) -> Iterable[Any]:
    if isinstance(value, dict):
        return value.values()
    if isinstance(value, list | tuple | set):
        return value
    is_ours = type(value).__module__.partition(".")[0] == _PACKAGE
    return vars(value).values() if is_ours and hasattr(value, "__dict__") else ()


def _copy_array(array: np.ndarray, memo: dict[int, Any]) -> None:
    root = array
    while isinstance(root.base, np.ndarray):
        root = root.base
    if id(array) in memo or array.dtype.hasobject or not root.flags.owndata or not root.flags.c_contiguous:
        return
    whole = memo.setdefault(id(root), root.copy())
    memo.setdefault(id(memo), []).extend(
        [root, array]
    )  # as deepcopy does: ids stay taken while the memo lives
    if array is not root:
        offset = array.__array_interface__["data"][0] - root.__array_interface__["data"][0]
        memo[id(array)] = np.ndarray(array.shape, array.dtype, whole, offset, array.strides)
