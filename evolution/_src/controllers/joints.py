"""How the hinges of an organism lie in its tree of modules, as arrays that control laws index with."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float, Int

from evolution._src.controllers.namespaces import find_namespace

if TYPE_CHECKING:
    from symbrion_gym._src.robot.organism import Organism


_ROUNDING = 1e-9
"""Cosines, and distances in units of a module, that differ by less from a whole number are that number."""


@dataclass(frozen=True, eq=False)
class Joints:
    """Hinges in a tree of modules. Hinge i belongs to the module `own[i]`, and joins it to `ahead[i]` in front of it.

    A positive angle lifts what is ahead. "Inclination" is that of a module along the direction in which the hinge's
    own module looks: the pitch of a module that looks the same way, the roll of one that is docked sideways.

    Attributes:
        num_modules: number of modules.
        num_twists: number of servos that rotate arms: as many as hinges, or none. Only `oscillators`
            moves them.
        own: module that each hinge belongs to.
        ahead: module docked to its front.
        ahead_column: column of the inclination of `ahead` in pitches, followed by rolls where `has_rolls`.
        ahead_sign: factor on it.
        has_rolls: whether a roll is needed.
        ahead_part: modules on the side of `ahead`, which the hinge separates from the rest.
        own_part: modules on the side of `own`.
        is_head: whether the hinge joins module 0, the head, to another.
        is_tail: whether it joins a module at an end of the tree, other than the head, to another.
        depth: number of dockings from the head to the farther of its modules.
        along: cosine of the angle between its own module and the head, in the straight body.
        share: share of the bend between two modules that the hinge takes: a half where both fronts are docked.
        side: 1 where its own module lies to the left of the head's middle line, -1 to the right, 0 on it.
        dock: side of `ahead` that its own module is docked to.
        parents: module that each module is docked to on its way to the head, -1 for the head.
        order: modules other than the head, each after its parent.
        steps: how far behind its parent each module lies along the head's direction, in units of a module's length.
    """

    num_modules: int
    num_twists: int
    own: Int[np.ndarray, " h"]
    ahead: Int[np.ndarray, " h"]
    ahead_column: Int[np.ndarray, " h"]
    ahead_sign: Float[np.ndarray, " h"]
    has_rolls: bool
    ahead_part: Bool[np.ndarray, "h n"]
    own_part: Bool[np.ndarray, "h n"]
    is_head: Bool[np.ndarray, " h"]
    is_tail: Bool[np.ndarray, " h"]
    depth: Int[np.ndarray, " h"]
    along: Float[np.ndarray, " h"]
    share: Float[np.ndarray, " h"]
    side: Float[np.ndarray, " h"]
    dock: tuple[str, ...]
    parents: tuple[int, ...]
    order: tuple[int, ...]
    steps: Float[np.ndarray, " n"]

    def find_inclination_ahead(
        self, pitch: Float[Any, "P n"], roll: Float[Any, "P n"] | None
    ) -> Float[Any, "P h"]:
        """Return the inclination of the module ahead of each hinge [rad]."""
        both = pitch if roll is None else find_namespace(pitch).concatenate((pitch, roll), axis=1)
        return both[:, self.ahead_column] * self.ahead_sign


def find_joints(organism: Organism) -> Joints:
    """Return how the hinges of an organism lie in its tree."""
    parents, order = organism.parents, organism.order[1:]
    poses, pitch = organism.find_poses(), organism.scout.pitch
    fronts = {
        module: (other, other_side)
        for docking in organism.dockings
        for (module, side), (other, other_side) in (docking.ends, docking.ends[::-1])
        if side == "front"
    }
    own = np.array(organism.hinges, dtype=np.int64)
    ahead = np.array([fronts[module][0] for module in organism.hinges], dtype=np.int64)
    turns = [poses[i].heading - poses[j].heading for i, j in zip(own, ahead, strict=True)]
    is_sideways = np.array([abs(_snap(cos(turn))) < 0.5 for turn in turns], dtype=bool)
    signs = [
        _snap(sin(turn)) if side else _snap(cos(turn)) for turn, side in zip(turns, is_sideways, strict=True)
    ]
    ahead_part = np.array([_find_part(organism, j, i) for i, j in zip(own, ahead, strict=True)], dtype=bool)
    ahead_part = ahead_part.reshape(len(own), organism.num_modules)
    num_dockings = np.bincount(
        [module for docking in organism.dockings for module, _ in docking.ends],
        minlength=organism.num_modules,
    )
    is_end = (num_dockings == 1) & (np.arange(organism.num_modules) > 0)
    depths = np.zeros(organism.num_modules, dtype=np.int64)
    for module in order:
        depths[module] = depths[parents[module]] + 1
    is_shared = [fronts.get(int(j), (-1, ""))[0] == i for i, j in zip(own, ahead, strict=True)]
    return Joints(
        num_modules=organism.num_modules,
        num_twists=len(organism.servos) - len(own),
        own=own,
        ahead=ahead,
        ahead_column=ahead + organism.num_modules * is_sideways,
        ahead_sign=np.array(signs, dtype=float),
        has_rolls=bool(is_sideways.any()),
        ahead_part=ahead_part,
        own_part=~ahead_part,
        is_head=(own == 0) | (ahead == 0),
        is_tail=is_end[own] | is_end[ahead],
        depth=np.maximum(depths[own], depths[ahead]),
        along=np.array([_snap(cos(poses[i].heading)) for i in own], dtype=float),
        share=np.where(is_shared, 0.5, 1.0),
        side=np.array([np.sign(_snap(poses[i].y / pitch)) for i in own], dtype=float),
        dock=tuple(fronts[module][1] for module in organism.hinges),
        parents=parents,
        order=order,
        steps=np.array(
            [0.0 if j < 0 else _snap((poses[j].x - poses[i].x) / pitch) for i, j in enumerate(parents)]
        ),
    )


def _find_part(organism: Organism, module: int, without: int) -> list[bool]:
    """Return which modules hang together with a module if it is undocked from another."""
    part = [index == module for index in range(organism.num_modules)]
    waiting = [module]
    for one in waiting:
        for docking in organism.dockings:
            for (first, _), (second, _) in (docking.ends, docking.ends[::-1]):
                if first == one and not part[second] and (first, second) != (module, without):
                    part[second] = True
                    waiting.append(second)
    return part


def _snap(value: float) -> float:
    """Return a number, as a whole one where only rounding is between them: snakes then step by whole modules."""
    return float(round(value)) if abs(value - round(value)) < _ROUNDING else float(value)
