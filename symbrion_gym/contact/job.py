"""What every step of making contact geometry needs: the options, the time left, the metric of the surface error."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import trimesh

from reconstruction.progress import Progress
from symbrion_gym.contact.budget import TimeBudget
from symbrion_gym.contact.contact import Contact
from symbrion_gym.contact.options import ContactOptions, ContactTuning
from symbrion_gym.contact.surface_error import SurfaceErrorMetric


@dataclass(frozen=True)
class ContactJob:
    """One surface that contact geometry is made of.

    Attributes:
        options: what is wanted.
        metric: surface error of pieces.
        budget: time.
        progress: called with what is being done and the share done.
    """

    options: ContactOptions
    metric: SurfaceErrorMetric
    budget: TimeBudget
    progress: Progress

    @property
    def tuning(self) -> ContactTuning:
        """What tunes each step."""
        return self.options.tuning

    def measure(self, pieces: list[trimesh.Trimesh], notes: dict[str, Any]) -> Contact:
        """Return pieces with their surface error."""
        return Contact(pieces, self.metric.measure(pieces, self.budget.elapsed), None, notes)

    def stop(self, contact: Contact) -> Contact:
        """Return contact geometry with the time that it has taken up to now."""
        return replace(contact, quality=replace(contact.quality, seconds=self.budget.elapsed))

    def ends_at(self, share: float) -> Callable[[], bool]:
        """Return a function that tells whether this share of the time is used up."""
        return lambda: self.budget.is_exceeded(share)

    def is_enough(self, contact: Contact, accuracy: float) -> bool:
        """Return whether contact geometry has some pieces, few enough, and this accuracy [m]."""
        return 0 < len(contact.pieces) <= self.options.max_pieces and contact.quality.mean <= accuracy
