"""Distances, shares and counts as text for people: in fitting units, without powers of ten."""

from collections.abc import Sequence


def format_distance(distance: float) -> str:
    """Return a distance [m] as text in millimeters, or in meters from 1 m on, with three digits.

    What is below 0.005 mm is "0.00 mm": no scanner and no simulator knows of less.
    """
    if abs(distance) >= 1.0:
        return f"{_round(distance)} m"
    millimeters = 1000.0 * distance
    return f"{_round(millimeters)} mm" if abs(millimeters) >= 0.005 else "0.00 mm"


def format_extents(low: Sequence[float], high: Sequence[float]) -> str:
    """Return from where to where something extends along each axis [m] as text: "x -0.5 to 3.2 m, y 0 to 1 m"."""
    return ", ".join(
        f"{axis} {_round_place(begin)} to {_round_place(end)} m"
        for axis, begin, end in zip("xyz", low, high, strict=False)
    )


def format_energy(joules: float) -> str:
    """Return an energy [J] as text with three digits; one that is not 0 but below 0.01 J says so."""
    return "below 0.01 J" if 0.0 < joules < 0.01 else f"{_round(joules)} J"


def format_share(share: float) -> str:
    """Return a share as text in percent, with three digits; one that is not 0 but below 0.01 % says so."""
    percent = 100.0 * share
    return "below 0.01 %" if 0.0 < percent < 0.01 else f"{_round(percent)} %"


def format_count(count: int, noun: str, plural: str = "") -> str:
    """Return a number of things as text: "1 module", "2 modules", and "2 bodies" where the plural is given."""
    return f"{count} {noun}" if count == 1 else f"{count} {plural or noun + 's'}"


def _round_place(value: float) -> str:
    """Return a coordinate in centimeters, without a negative zero."""
    return f"{round(value, 2) + 0.0:.12g}"


def _round(value: float) -> str:
    """Return a number with three digits; whole numbers keep all."""
    return f"{value:.0f}" if 100 <= abs(value) < 1e15 else f"{value:.3g}"
