"""What the configurations of all runs have in common: an episode, the fitness, where it runs and where it is kept."""

from collections.abc import Collection
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Self

from evolution._src.backends.cluster import BACKENDS, LOCAL_BACKENDS
from evolution._src.backends.scoring import Scoring, find_scoring
from evolution._src.backends.settings import TrialConfig
from evolution._src.errors import RunError
from evolution._src.references import MAX_SEED, MAX_WORKERS
from evolution._src.search.stored_config import (
    check_text_fields,
    compute_digest,
    read_content,
    restore,
    to_json,
)
from reconstruction._src.base.range_checks import check_choice, coerce_integers


@dataclass(frozen=True, kw_only=True)
class RunConfig(TrialConfig):
    """A run that a folder keeps.

    Attributes:
        seed: seed of all random numbers of the run.
        scoring: how an outcome becomes a fitness: the weights of a `Scoring`, a function of (outcome, body), or
            "module:name" of one.
        workers: number of threads, processes or actors.
        backend: "batch" (threads), "processes" or "ray"; the results are equal.
        address: address of an existing Ray cluster; None starts a local one.
        folder: run folder; None keeps the run in memory only.
    """

    RUNTIME: ClassVar[tuple[str, ...]] = ("workers", "backend", "address", "folder")
    """Fields that may change when a run is resumed: they decide its length and where it runs, not its results."""
    POSSIBLE_BACKENDS: ClassVar[tuple[str, ...]] = BACKENDS

    seed: int = 0
    scoring: Any = field(default_factory=Scoring)
    workers: int = 1
    backend: str = "batch"
    address: str | None = None
    folder: str | None = None

    def __post_init__(self) -> None:
        check_text_fields(self)
        super().__post_init__()
        self._set("scoring", find_scoring(self.scoring))
        coerce_integers(self, {"seed": (0, MAX_SEED), "workers": (1, MAX_WORKERS)}, RunError)
        check_choice("backend", self.backend, self.POSSIBLE_BACKENDS, RunError)

    @property
    def must_be_restorable(self) -> bool:
        """Whether a file or other processes must find again what a user wrote."""
        return self.folder is not None or self.backend not in LOCAL_BACKENDS

    def differences(self, other: Self) -> list[str]:
        """Return "field: this, not that" for each difference that decides the results of a run."""
        return [
            f"{each.name}: {getattr(self, each.name)!r}, not {getattr(other, each.name)!r}"
            for each in fields(self)
            if each.name not in self.RUNTIME and getattr(self, each.name) != getattr(other, each.name)
        ]

    def digest(self) -> str:
        """Return a fingerprint of all that decides the results of a run."""
        return compute_digest(self, self.RUNTIME)

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON content.

        Raises:
            RunError: a part is an object of a user that nothing would restore.
        """
        return to_json(self)

    @classmethod
    def from_json(cls, content: object) -> Self:
        """Return the configuration described by `to_json`; this imports nothing.

        Raises:
            RunError: a field is unknown or its value of the wrong kind.
        """
        return cls(**read_content(content, cls, "config"))

    def restore(self, allow: Collection[str] = ()) -> Self:
        """Return the configuration with what a user wrote imported again.

        Raises:
            RunError: something cannot be imported, or has changed since the run began.
        """
        return restore(self, allow)
