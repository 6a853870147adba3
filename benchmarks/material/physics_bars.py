"""What the rows of the benchmark of physics come to: the worst of each law, for the table of targets."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

Rows = dict[str, dict[str, Any]]

BARS: dict[str, tuple[str, str, Callable[[str], bool]]] = {
    "slope, spheres": (
        "slope",
        "off",
        lambda name: _has(name, "spheres", "heading 0") and not _is_lone(name),
    ),
    "slope, wheels": (
        "slope",
        "off",
        lambda name: _has(name, "wheels") and not _is_lone(name) and not _is_steady(name),
    ),
    "slope, cylinders": (
        "slope",
        "off",
        lambda name: _has(name, "cylinders") and not _is_lone(name) and not _is_steady(name),
    ),
    "slope, steady wheels": ("slope", "off", lambda name: _is_steady(name) and not _is_lone(name)),
    "slope, lone module, steady wheels": ("slope", "off", lambda name: _is_steady(name) and _is_lone(name)),
    "slope, diagonal, pyramidal": ("slope", "off", lambda name: _has(name, "pyramidal", "heading 45")),
    "slope, diagonal, elliptic": ("slope", "off", lambda name: _has(name, "elliptic", "heading 45")),
    "slope, lone module": ("slope", "off", lambda name: _has(name, "spheres") and _is_lone(name)),
    "gap": ("gap", "off_share", lambda name: True),
    "gap, explained rows apart": (
        "gap",
        "off_share",
        lambda name: (
            not _has(name, "torque 3.5") and (not _has(name, "friction 0.3,") or _has(name, "servo"))
        ),
    ),
    "gap, friction 0.3": (
        "gap",
        "off_share",
        lambda name: _has(name, "friction 0.3,") and not _has(name, "servo"),
    ),
    "gap, 8 modules, 4.5 N m": ("gap", "off_share", lambda name: _has(name, ", 8 modules", "torque 4.5")),
    "gap, spheres, 2 to 8 N m": (
        "gap",
        "off_share",
        lambda name: (
            _has(name, "spheres", "friction 0.7") and not any(f"torque {t} " in name for t in (0.5, 1.0, 1.5))
        ),
    ),
    "step, friction 0.5 to 0.9": (
        "step",
        "off_share",
        lambda name: (
            not _has(name, "friction 0.3") and not _has(name, "cylinders") and not _has(name, "capsules")
        ),
    ),
    "step, friction 0.3": (
        "step",
        "off_share",
        lambda name: (
            _has(name, "friction 0.3") and not _has(name, "cylinders") and not _has(name, "capsules")
        ),
    ),
    "step, cylinders": ("step", "off_share", lambda name: _has(name, "cylinders", "pyramidal")),
    "step, capsules": ("step", "off_share", lambda name: _has(name, "capsules")),
    "step, capsules, friction 0.5 to 0.9, pyramidal": (
        "step",
        "off_share",
        lambda name: _has(name, "capsules", "pyramidal") and not _has(name, "friction 0.3"),
    ),
    "turning, lone module": ("turning", "off_share", lambda name: _has(name, "spheres", ", 1 modules")),
    "turning, 2 to 4 modules, pyramidal": (
        "turning",
        "off_share",
        lambda name: _has(name, "spheres", "pyramidal", "0.05 m") and not _is_lone(name),
    ),
    "turning, 2 to 4 modules, elliptic, 5 ms": (
        "turning",
        "off_share",
        lambda name: _has(name, "spheres", "elliptic", "5 ms", "0.05 m") and not _is_lone(name),
    ),
    "turning, 2 to 4 modules, elliptic, 1 ms or 0.01 m/s": (
        "turning",
        "off_share",
        lambda name: _has(name, "spheres", "elliptic") and (_has(name, " 1 ms") or _has(name, "0.01 m")),
    ),
    "turning, elliptic, wheels and cylinders": (
        "turning",
        "off_share",
        lambda name: _has(name, "elliptic") and not _has(name, "spheres") and not _is_steady(name),
    ),
    "turning, steady wheels": (
        "turning",
        "off_share",
        lambda name: _has(name, "wheels") and _is_steady(name),
    ),
    "turning, steady cylinders": (
        "turning",
        "off_share",
        lambda name: _has(name, "cylinders") and _is_steady(name),
    ),
    "energy": ("energy", "residual", lambda name: True),
    "creep, pyramidal": ("rest", "speed", lambda name: _has(name, "still", "pyramidal")),
    "creep, elliptic": ("rest", "speed", lambda name: _has(name, "still", "elliptic")),
    "creep on flat ground": ("rest", "speed", lambda name: _has(name, "still", "slope 0")),
    "twitching, pyramidal": ("rest", "per cycle", lambda name: _has(name, "twitching", "pyramidal", "5 ms")),
    "twitching, elliptic": ("rest", "per cycle", lambda name: _has(name, "twitching", "elliptic", "5 ms")),
    "depth between modules": ("touching", "between_modules", lambda name: True),
    "depth between modules, closing": (
        "touching",
        "worst_between_modules",
        lambda name: not _has(name, "contact"),
    ),
    "depth between modules, closing, firm": (
        "touching",
        "worst_between_modules",
        lambda name: _has(name, "contact"),
    ),
    "published drives, friction 0.7": ("published", "misses", lambda name: _has(name, "friction 0.7")),
    "published drives, friction 150": ("published", "misses", lambda name: _has(name, "friction 150")),
}
"""Name -> law, figure of its rows, and which rows; the largest counts."""


def find_bars(results: dict[str, Rows]) -> dict[str, float]:
    """Return the worst figure of each bar whose rows were measured."""
    worst = {}
    for bar, (law, figure, picks) in BARS.items():
        found = [row[figure] for name, row in results.get(law, {}).items() if figure in row and picks(name)]
        if found:
            worst[bar] = float(max(found))
    return worst


def _has(name: str, *words: str) -> bool:
    return all(word in name for word in words)


def _is_steady(name: str) -> bool:
    return "armature" in name


def _is_lone(name: str) -> bool:
    return ", 1 modules" in name
