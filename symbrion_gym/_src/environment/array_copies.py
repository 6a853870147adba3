"""Copies of objects whose arrays are views of each other, which `copy.deepcopy` alone would part."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

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
