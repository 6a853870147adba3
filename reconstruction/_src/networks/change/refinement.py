"""Refine a trained network with new readings: the sequence that both networks share.

The changes are detected (`detection`, `free_space`), the network selects which of its vertices learn again, old points
that are no longer valid are dropped, the samples are gathered, and the network learns from them. So the cost is
that of the change, and what did not change stays equal to the bit.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.geometry.boxes import find_near_box
from reconstruction._src.networks.change.detection import (
    Change,
    ChangeConfig,
    detect_changes,
    find_superseded,
)


@dataclass(frozen=True)
class Selection:
    """Which vertices of a network learn again.

    Attributes:
        is_active: vertices that change: they move, multiply or are removed.
        is_searched: readings that disagree and are nearest to one of these are samples, however far they are.
        is_near: samples nearest to one of these take part.
        is_refuted: old points nearest to one of these are no longer valid.
        is_doubtful: old points nearest to one of these are no longer valid where no new reading next to them agrees.
        margin: points in the box around the active vertices, widened by this, are samples [m].
        stride: every n-th of the new readings suffices.
    """

    is_active: Bool[np.ndarray, " V"]
    is_searched: Bool[np.ndarray, " V"]
    is_near: Bool[np.ndarray, " V"]
    is_refuted: Bool[np.ndarray, " V"]
    is_doubtful: Bool[np.ndarray, " V"]
    margin: float
    stride: int = 1


@dataclass(frozen=True)
class Samples:
    """What the active vertices learn from.

    Attributes:
        points: positions [m], the old ones first.
        winners: the vertex nearest to each.
        old: indices of the old points among these.
        stale: indices of the old points near the change that are no longer valid.
        num_known: how many old points there are in all.
    """

    points: Float[np.ndarray, "S 3"]
    winners: Int[np.ndarray, " S"]
    old: Int[np.ndarray, " O"]
    stale: Int[np.ndarray, " D"]
    num_known: int


class Surface(NamedTuple):
    """The surface of a trained network.

    Attributes:
        vertices: positions [m].
        faces: vertex indices.
        spacing: usual distance between neighboring vertices [m].
    """

    vertices: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    spacing: float


class NetworkConfig(Protocol):
    """The configuration of any network, as the shared sequence sees it."""

    @property
    def change(self) -> ChangeConfig:
        """When new readings contradict the network."""
        ...


State = TypeVar("State")
Config = TypeVar("Config", bound=NetworkConfig)
SelectionType = TypeVar("SelectionType", bound=Selection)


@dataclass(frozen=True)
class NetworkLearner(ABC, Generic[State, Config, SelectionType]):
    """A trained network that can learn from new readings; each network implements the three abstract methods.

    Attributes:
        state: the network.
        config: as it was grown with.
    """

    state: State
    config: Config

    @cached_property
    def surface(self) -> Surface:
        """The surface of the network, measured once."""
        return self.measure()

    @abstractmethod
    def measure(self) -> Surface:
        """Return the surface of the network."""

    @abstractmethod
    def select(self, change: Change, readings: Float[np.ndarray, "C 3"]) -> SelectionType | None:
        """Return which vertices learn again; None where nothing has changed.

        Args:
            change: what the new readings show.
            readings: those of them that were compared [m].
        """

    @abstractmethod
    def learn(
        self, change: Change, selection: SelectionType, samples: Samples, rng: np.random.Generator
    ) -> tuple[State, Bool[np.ndarray, " O"]]:
        """Learn from the samples.

        Args:
            change: what the new readings show.
            selection: result of `select`.
            samples: samples of the active vertices.
            rng: generator of all random numbers.

        Returns:
            The network, and which of the samples' old points its surface has left: they are no longer valid.
        """


def refine(
    learner: NetworkLearner[State, Config, SelectionType],
    old_points: Float[np.ndarray, "N 3"],
    new_points: Float[np.ndarray, "M 3"],
    seed: int = 0,
    progress: Progress = silent,
    origins: Float[np.ndarray, "M 3"] | None = None,
) -> tuple[State, Float[np.ndarray, "K 3"]]:
    """Train a network on new readings: what they contradict moves, grows or is removed.

    Args:
        learner: the network.
        old_points: what it has learned from [m].
        new_points: what was read since [m].
        seed: seed of all random numbers.
        progress: receives how far the work is.
        origins: where the new readings were made from [m]; what their rays go through is gone.

    Returns:
        The new network, and the points that it now knows: the old ones that are still valid, and the new ones.
    """
    state, is_valid = learn_changes(learner, old_points, new_points, seed, progress, origins)
    return state, np.concatenate([old_points.take(np.flatnonzero(is_valid), axis=0), new_points])


def learn_changes(
    learner: NetworkLearner[State, Config, SelectionType],
    old_points: Float[np.ndarray, "N 3"],
    new_points: Float[np.ndarray, "M 3"],
    seed: int = 0,
    progress: Progress = silent,
    origins: Float[np.ndarray, "M 3"] | None = None,
    free_rays: Float[np.ndarray, "K 2 3"] | None = None,
) -> tuple[State, Bool[np.ndarray, " N"]]:
    """Do what `refine` does; return the new network, and which of the old points are still valid.

    Args:
        learner: the network.
        old_points: what it has learned from [m].
        new_points: what was read since [m].
        seed: seed of all random numbers.
        progress: receives how far the work is.
        origins: where the new readings were made from [m]; what their rays go through is gone.
        free_rays: begin and end of rays that met nothing [m]; what they go through is gone.
    """
    progress("refine", 0.0)
    (vertices, faces, spacing), limits = learner.surface, learner.config.change
    change = detect_changes(vertices, faces, old_points, new_points, spacing, limits, origins, free_rays)
    readings = new_points[change.compared]
    selection = learner.select(change, readings)
    if selection is None:
        progress("refine", 1.0)
        return learner.state, np.ones(len(old_points), dtype=bool)
    samples = _gather_samples(
        vertices, old_points, new_points, readings, change, selection, limits.agreement_distance
    )
    state, has_left = learner.learn(change, selection, samples, np.random.default_rng(seed))
    is_valid = np.ones(len(old_points), dtype=bool)
    is_valid[samples.stale] = is_valid[samples.old[has_left]] = False
    progress("refine", 1.0)
    return state, is_valid


def _gather_samples(
    vertices: Float[np.ndarray, "V 3"],
    old_points: Float[np.ndarray, "N 3"],
    new_points: Float[np.ndarray, "M 3"],
    readings: Float[np.ndarray, "C 3"],
    change: Change,
    selection: Selection,
    agreement_distance: float,
) -> Samples:
    """Return the points near the selected vertices: the new ones, and the old ones that are still valid."""
    active = vertices[selection.is_active]
    against = readings[change.disagrees & selection.is_searched[change.winners]]
    old = find_near_box(old_points, active, selection.margin)
    new = find_near_box(new_points, np.concatenate([active, against]), selection.margin)[:: selection.stride]
    points = np.concatenate([old_points[old], new_points[new]])
    winners = np.asarray(cKDTree(vertices).query(points)[1])
    old_winners = winners[: len(old)]
    is_stale = selection.is_refuted[old_winners]
    doubtful = np.flatnonzero(selection.is_doubtful[old_winners] & ~is_stale)
    is_stale[doubtful] = find_superseded(points[doubtful], readings, change, agreement_distance)
    takes_part = selection.is_near[winners]
    takes_part[: len(old)] &= ~is_stale
    old_part = takes_part[: len(old)]
    return Samples(points[takes_part], winners[takes_part], old[old_part], old[is_stale], len(old_points))
