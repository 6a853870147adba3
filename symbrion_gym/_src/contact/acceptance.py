"""The one rule by which a candidate takes the place of the best contact geometry so far."""

from __future__ import annotations

from dataclasses import dataclass

from symbrion_gym._src.contact.kinds import Contact


@dataclass(frozen=True)
class AcceptanceConfig:
    """When contact geometry is good enough, and when a candidate is as good as the best so far.

    Attributes:
        p95: 95th percentile of the distance that is good enough, in accuracies.
        uncovered: share of the surface without contact within 5 cm that is good enough ...
        reach: ... where the 95th percentile that is good enough is below this [m]: on a square kilometer known to a
            meter, 5 cm say nothing.
        margin: a candidate as good as the best has distances larger by no more than this, in accuracies: what
            sampling and the seams of boxes add.
        share_margin: likewise for the share without contact.
        more_pieces: a candidate as good as the best has no more than this many times the pieces ...
        more_few: ... or this many more: coacd cuts a slab in two where that gives better solids.
        many_pieces: a candidate that is good enough replaces a better one of more pieces than these ...
        fewer: ... if it has no more than this share of them: fewer pieces make faster contacts.
    """

    p95: float = 3.0
    uncovered: float = 0.008
    reach: float = 0.05
    margin: float = 0.1
    share_margin: float = 5e-4
    more_pieces: float = 1.5
    more_few: int = 3
    many_pieces: int = 64
    fewer: float = 0.5


_TOO_MANY = 1e9
"""Too many pieces are worse than any distance: their number is a limit, the accuracy a wish."""
ACCEPTANCE_DEFAULTS = AcceptanceConfig()


def find_miss(
    contact: Contact, accuracy: float, max_pieces: int, config: AcceptanceConfig = ACCEPTANCE_DEFAULTS
) -> float:
    """Return how far contact geometry misses what is wanted: the worst of its figures over the wanted one; 1 or less
    where nothing is missed.
    """
    if contact.height_field is None and not contact.pieces:
        return float("inf")
    if len(contact.pieces) > max_pieces:
        return _TOO_MANY * len(contact.pieces) / max_pieces
    quality = contact.quality
    figures = [quality.mean / accuracy, quality.p95 / (config.p95 * accuracy)]
    if config.p95 * accuracy < config.reach:
        figures.append(quality.uncovered / config.uncovered)
    return max(figures)


def find_fault(
    best: Contact | None,
    candidate: Contact,
    accuracy: float,
    max_pieces: int,
    config: AcceptanceConfig = ACCEPTANCE_DEFAULTS,
) -> str:
    """Return why a candidate does not replace the best so far; nothing where it does.

    While the best misses what is wanted, a candidate that misses it by less replaces it. Then it must be as good, or
    good enough with far fewer pieces.
    """
    if best is None:
        return ""
    misses = [find_miss(contact, accuracy, max_pieces, config) for contact in (best, candidate)]
    if misses[0] > 1.0:
        return (
            ""
            if misses[1] < misses[0]
            else f"misses what is wanted {misses[1]:.3g}-fold against {misses[0]:.3g}"
        )
    if misses[1] > 1.0:
        return f"misses what is wanted {misses[1]:.3g}-fold"
    count, most = len(best.pieces), len(candidate.pieces)
    if count > config.many_pieces and most <= config.fewer * count:
        return ""
    if most > max(int(config.more_pieces * count), count + config.more_few):
        return f"{most} pieces for {count}"
    return _find_worse_figure(best, candidate, accuracy, config)


def _find_worse_figure(best: Contact, candidate: Contact, accuracy: float, config: AcceptanceConfig) -> str:
    """Return which figure of a candidate is worse than that of the best."""
    margins = {
        "mean": config.margin * accuracy,
        "p95": 2 * config.margin * accuracy,
        "protrusion_p95": 2 * config.margin * accuracy,
        "uncovered": config.share_margin,
    }
    for name, margin in margins.items():
        got, kept = getattr(candidate.quality, name) or 0.0, getattr(best.quality, name) or 0.0
        if got > kept + margin:
            return f"{name} {got:.3g} against {kept:.3g}"
    return ""
