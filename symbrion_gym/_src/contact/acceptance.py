"""The one rule by which a candidate takes the place of the best contact geometry so far."""

from __future__ import annotations

from symbrion_gym._src.contact.kinds import Contact

ACCEPTANCE_P95 = 3.0  # 95th percentile of the distance that is good enough, in accuracies
UNCOVERED = 0.008  # Share of the surface without contact within 5 cm that is good enough
_REACH = 0.05
"""... where the 95th percentile that is good enough is below this [m]: on a square kilometer known to a meter,
5 cm say nothing."""
_MARGIN = 0.1
"""A candidate as good as the best has distances larger by no more than this, in accuracies: what sampling and
the seams of boxes add."""
_SHARE_MARGIN = 5e-4  # Likewise for the share without contact
_MORE_PIECES = 1.5  # A candidate as good as the best has no more than this many times the pieces
_MORE_FEW = 3  # ... or this many more: coacd cuts a slab in two where that gives better solids.
_MANY_PIECES = 64  # A candidate that is good enough replaces a better one of more pieces than these
_FEWER = 0.5  # ... if it has no more than this share of them: fewer pieces make faster contacts.


_TOO_MANY = 1e9  # Too many pieces are worse than any distance: their number is a limit, the accuracy a wish


def compute_miss(contact: Contact, accuracy: float, max_pieces: int) -> float:
    """Return how far contact geometry misses what is wanted: the worst of its figures over the wanted one; 1 or less
    where nothing is missed.
    """
    if contact.height_field is None and not contact.pieces:
        return float("inf")
    if len(contact.pieces) > max_pieces:
        return _TOO_MANY * len(contact.pieces) / max_pieces
    quality = contact.quality
    figures = [quality.mean / accuracy, quality.p95 / (ACCEPTANCE_P95 * accuracy)]
    if ACCEPTANCE_P95 * accuracy < _REACH:
        figures.append(quality.uncovered / UNCOVERED)
    return max(figures)


def find_fault(
    best: Contact | None,
    candidate: Contact,
    accuracy: float,
    max_pieces: int,
) -> str:
    """Return why a candidate does not replace the best so far; nothing where it does.

    While the best misses what is wanted, a candidate that misses it by less replaces it. Then it must be as good, or
    good enough with far fewer pieces.
    """
    if best is None:
        return ""
    misses = [compute_miss(contact, accuracy, max_pieces) for contact in (best, candidate)]
    if misses[0] > 1.0:
        return (
            ""
            if misses[1] < misses[0]
            else f"misses what is wanted {misses[1]:.3g}-fold against {misses[0]:.3g}"
        )
    if misses[1] > 1.0:
        return f"misses what is wanted {misses[1]:.3g}-fold"
    count, most = len(best.pieces), len(candidate.pieces)
    if count > _MANY_PIECES and most <= _FEWER * count:
        return ""
    if most > max(int(_MORE_PIECES * count), count + _MORE_FEW):
        return f"{most} pieces for {count}"
    return _find_worse_figure(best, candidate, accuracy)


def _find_worse_figure(best: Contact, candidate: Contact, accuracy: float) -> str:
    """Return which figure of a candidate is worse than that of the best."""
    margins = {
        "mean": _MARGIN * accuracy,
        "p95": 2 * _MARGIN * accuracy,
        "protrusion_p95": 2 * _MARGIN * accuracy,
        "uncovered": _SHARE_MARGIN,
    }
    for name, margin in margins.items():
        got, kept = getattr(candidate.quality, name) or 0.0, getattr(best.quality, name) or 0.0
        if got > kept + margin:
            return f"{name} {got:.3g} against {kept:.3g}"
    return ""
