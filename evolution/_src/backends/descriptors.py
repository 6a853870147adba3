"""What outcomes keep of every trial: recorders of the environment, by name, by value or as a function of the state."""

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from evolution._src.errors import RunError
from evolution._src.references import check_versions, find_versions
from symbrion_gym._src.errors import TaskError
from symbrion_gym._src.tasks.recorders import (
    Descriptor,
    Extremes,
    FinalPose,
    GroundContacts,
    Recorder,
    Trajectory,
)
from symbrion_gym._src.tasks.storage import describe, restore

RECORDERS: Mapping[str, Recorder] = {
    "pose": FinalPose(),
    "extremes": Extremes(),
    "contacts": GroundContacts(),
    "trajectory": Trajectory(),
}
"""Recorders by name."""
Records: TypeAlias = dict[str, np.ndarray]
"""What is kept of a trial: name -> numbers."""


@dataclass(frozen=True)
class StoredDescriptors:
    """What a file says of descriptors; nothing of them is imported yet.

    Attributes:
        text: JSON text.
    """

    text: str

    def restore(self, what: str, allow: Collection[str] = ()) -> tuple[Recorder, ...]:
        """Return the recorders; of the user's code only modules in `allow` are imported."""
        content = json.loads(self.text)
        versions = (
            content.pop() if content and isinstance(content[-1], dict) and "versions" in content[-1] else {}
        )
        try:
            check_versions(versions.get("versions", {}), what, allow)
            return check_descriptors(restore(content, allow))
        except (TaskError, AttributeError) as error:
            raise RunError(f"{what}: {error}") from error


def check_descriptors(descriptors: Any) -> Any:
    """Return recorders; what a file says of them stays as it is."""
    if isinstance(descriptors, StoredDescriptors):
        return descriptors
    if isinstance(descriptors, str) or not isinstance(descriptors, Sequence):
        descriptors = (descriptors,)
    return tuple(_find_recorder(each) for each in descriptors)


def _find_recorder(given: "str | Recorder | Callable[..., Any]") -> Recorder:
    if isinstance(given, str):
        if given not in RECORDERS:
            raise RunError(f"descriptors has {given!r}; there are: {', '.join(RECORDERS)}")
        return RECORDERS[given]
    if isinstance(given, Recorder) and not isinstance(given, type):
        return given
    if callable(given):
        return Descriptor(getattr(given, "__name__", type(given).__name__), given)
    raise RunError(f"descriptors has {given!r}; a name, a recorder or a function of the state is needed")


def descriptors_to_json(descriptors: Any) -> Any:
    """Return JSON content that restores recorders."""
    if isinstance(descriptors, StoredDescriptors):
        return json.loads(descriptors.text)
    try:
        content = describe(descriptors)
    except TaskError as error:
        raise RunError(f"descriptors: {error}") from error
    versions = find_versions(content, "descriptors")
    return [*content, {"versions": versions}] if versions else content


def as_records(kept: Mapping[str, Any]) -> Records:
    """Return what recorders kept as numbers that a file holds."""
    return {name: np.asarray(value, dtype=np.float64) for name, value in kept.items()}
