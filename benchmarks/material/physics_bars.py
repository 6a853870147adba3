"""What the rows of the benchmark of physics come to: the worst of each law, for the table of targets."""

from __future__ import annotations

from typing import Any, NamedTuple

Rows = dict[str, dict[str, Any]]


class Bar(NamedTuple):
    """A line of the table: the largest of a figure counts."""

    law: str  # whose rows
    figure: str  # of a row
    target: float  # in its unit
    unit: str
    scale: float = 1.0  # from the row's figure to the unit
    having: tuple[str, ...] = ()  # words in the names of its rows
    lacking: tuple[str, ...] = ()  # words that are in none


_SLOW, _FINE = ", 0.01 m/s", " 1 ms"
BARS = {
    "slope, straight up": Bar("slope", "off", 1.0, "°", having=("heading 0",), lacking=("1 modules",)),
    "slope, along the diagonal": Bar("slope", "off", 1.0, "°", having=("heading 45",)),
    "slope, a lone module tips over": Bar("slope", "off", 1.0, "°", having=("1 modules",)),
    "gap": Bar("gap", "off_share", 5.0, "%", 100, lacking=("friction 0.3,", "torque 3.5")),
    "gap, friction 0.3": Bar("gap", "off_share", 5.0, "%", 100, ("friction 0.3,",)),
    "gap, torque beside a jump": Bar("gap", "off_share", 5.0, "%", 100, ("torque 3.5",)),
    "step, friction 0.5-0.9": Bar("step", "off_share", 10.0, "%", 100, lacking=("friction 0.3", _FINE)),
    "step, friction 0.3": Bar("step", "off_share", 10.0, "%", 100, ("friction 0.3",)),
    "turning, lone module": Bar("turning", "off_share", 10.0, "%", 100, ("1 modules",)),
    "turning, 2-4 modules": Bar("turning", "off_share", 10.0, "%", 100, lacking=("1 modules", _SLOW, _FINE)),
    "turning, 2-4 modules, steps of 1 ms": Bar("turning", "off_share", 10.0, "%", 100, (_FINE,)),
    "turning, 3 modules at 0.01 m/s": Bar("turning", "off_share", 10.0, "%", 100, ("3 modules", _SLOW)),
    "energy": Bar("energy", "residual", 2.0, "%", 100),
    "rest, flat ground": Bar("rest", "speed", 0.1, "mm/s", 1000, ("still", "slope 0")),
    "rest, slopes of 10° and 20°": Bar("rest", "speed", 0.1, "mm/s", 1000, ("still",), ("slope 0",)),
    "rest, hinges twitching": Bar("rest", "per cycle", 0.1, "mm in a cycle", 1000, ("twitching",)),
    "touching, at rest": Bar("touching", "between_modules", 1.0, "mm", 1000),
    "touching, at worst while closing": Bar("touching", "worst_between_modules", 1.0, "mm", 1000),
    "sinking, friction 0.001-5": Bar("sinking", "deepest", 10.0, "mm", 1000),
    "published drives, friction 0.7": Bar("published", "misses", 0.0, "of 15 missed", 1, ("friction 0.7",)),
    "published drives, friction 150": Bar("published", "misses", 0.0, "of 15 missed", 1, ("friction 150",)),
}


def find_bars(results: dict[str, Rows]) -> dict[str, float]:
    """Return the worst figure of each bar whose rows were measured, in its unit; misses of drives are summed up."""
    worst = {}
    for name, bar in BARS.items():
        found = [
            float(row[bar.figure])
            for words, row in results.get(bar.law, {}).items()
            if bar.figure in row
            and all(word in words for word in bar.having)
            and not any(word in words for word in bar.lacking)
        ]
        if found:
            worst[name] = bar.scale * (sum(found) if bar.figure == "misses" else max(found))
    return worst


def format_table(worst: dict[str, float]) -> str:
    """Return the table of targets as Markdown."""
    lines = ["| law | target | result |", "|---|---|---|"]
    for name, value in worst.items():
        bar = BARS[name]
        result = (
            f"{value:.2g} {bar.unit}: met" if value <= bar.target else f"**{value:.2g} {bar.unit}: missed**"
        )
        lines.append(f"| {name} | {bar.target:g} {bar.unit} | {result} |")
    return "\n".join(lines)
