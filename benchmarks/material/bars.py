"""Bars of an arena made of a scan: what each figure is to be, and whether it is."""

from __future__ import annotations

from typing import Any, NamedTuple


class Bar(NamedTuple):
    """One bar.

    Attributes:
        name: column of the table.
        limit: what is allowed.
        is_least: whether the figure is to be this at least, rather than at most.
        scale: from the figure's unit to that of the table.
        digits: digits after the point in the table.
    """

    name: str
    limit: float
    is_least: bool = False
    scale: float = 1.0
    digits: int = 2

    def is_met(self, value: float | None) -> bool | None:
        """Return whether a figure meets the bar; None where there is no figure."""
        if value is None:
            return None
        return value >= self.limit if self.is_least else value <= self.limit


BARS = {
    "contact_over_accuracy": Bar("mean/accuracy", 1.3),
    "p95_over_accuracy": Bar("p95/accuracy", 4.0),
    "uncovered": Bar("uncovered %", 0.01, scale=100.0),
    "beams_over_surface": Bar("beams c/s", 0.97, is_least=True, digits=3),
    "free_space": Bar("free solid %", 0.01, scale=100.0),
    "step_over_boxes": Bar("step/boxes", 2.5),
    "cpu_s_per_100k": Bar("CPU s/100k", 60.0, digits=0),
    "memory_gb": Bar("memory GB", 2.0),
    "surface_over_poisson": Bar("surf/Poisson", 1.0),
    "route": Bar("route", 1.0, is_least=True, digits=0),
    "arrived": Bar("arrived of 16", 14.0, is_least=True, digits=0),
    "left_ground": Bar("off ground", 0.0, digits=0),
    "same_bits": Bar("same bits", 1.0, is_least=True, digits=0),
}
"""Figure of a scene -> its bar."""
_SMALL = 100_000
"""The time is that of a cloud of this many points; smaller clouds get no less."""


def find_figures(row: dict[str, Any]) -> dict[str, Any]:
    """Return the figures that have a bar; None where they were not measured."""
    made, ours = row.get("made", {}), row.get("contact", {}).get("ours", {})
    accuracy, poisson = made.get("accuracy"), row.get("poisson", {}).get("points_mean")
    surface, drive = row.get("surface", {}).get("points_mean"), row.get("drive")
    return {
        "contact_over_accuracy": _divide(ours.get("contact_mean"), accuracy),
        "p95_over_accuracy": _divide(ours.get("contact_p95"), accuracy),
        "uncovered": ours.get("uncovered"),
        "beams_over_surface": _divide(ours.get("beams"), row.get("surface", {}).get("beams")),
        "free_space": ours.get("free_space"),
        "step_over_boxes": ours.get("step_over_boxes"),
        "cpu_s_per_100k": _divide(made.get("cpu_s"), max(1.0, row.get("points", 0) / _SMALL)),
        "memory_gb": made.get("memory_gb"),
        "surface_over_poisson": _divide(surface, poisson),
        "route": drive and float(drive["route"] and not drive.get("unseen_ends")),
        "arrived": drive and drive.get("arrived"),
        "left_ground": drive and drive.get("left_ground"),
        "same_bits": row.get("same_bits"),
    }


def summarise(rows: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Return for each bar the worst figure of all scenes, how many meet it, and of how many."""
    found: dict[str, Any] = {
        "scenes": {"of": len(rows), "met": sum("failed" not in row for row in rows.values())}
    }
    for key, bar in BARS.items():
        figures = [figure for row in rows.values() if (figure := find_figures(row)[key]) is not None]
        if figures:
            worst = min(figures) if bar.is_least else max(figures)
            found[key] = {"worst": worst, "met": sum(map(bool, map(bar.is_met, figures))), "of": len(figures)}
    return found


def format_bars(rows: dict[str, dict[str, Any]]) -> list[str]:
    """Return the lines of a table: a scene a line, a bar a column; `!` marks a miss, `-` what was not measured."""
    head = f"{'scene':16s}{'points':>8s}" + "".join(f"{bar.name:>14s}" for bar in BARS.values())
    limits = "".join(
        f"{('>= ' if bar.is_least else '<= ') + format(bar.scale * bar.limit, 'g'):>14s}"
        for bar in BARS.values()
    )
    lines = [head, f"{'':24s}{limits}"]
    met: dict[str, list[bool]] = {key: [] for key in BARS}
    for name, row in rows.items():
        figures, cells = find_figures(row), []
        for key, bar in BARS.items():
            is_met = bar.is_met(figures[key])
            if is_met is not None:
                met[key].append(is_met)
            cells.append(_format_cell(bar, figures[key], is_met))
        lines.append(f"{name:16s}{row.get('points', 0):8d}" + "".join(f"{cell:>14s}" for cell in cells))
        if "failed" in row:
            lines.append(f"{'':16s}no arena: {row['failed']}")
        if "failed" in row.get("drive", {}):
            lines.append(f"{'':16s}no route: {row['drive']['failed']}")
    totals = "".join(f"{f'{sum(list_)} of {len(list_)}':>14s}" for list_ in met.values())
    return [*lines, f"{'met':24s}{totals}"]


def format_peers(rows: dict[str, dict[str, Any]]) -> list[str]:
    """Return the lines of a table: for each scene ours and the peers."""
    columns = (
        ("pieces", "pieces", 1.0, "d"),
        ("contact_mean", "mean mm", 1e3, ".1f"),
        ("contact_p95", "p95 mm", 1e3, ".1f"),
        ("contact_max", "max mm", 1e3, ".0f"),
        ("uncovered", ">5cm %", 100.0, ".1f"),
        ("contact_truth_mean", "truth mm", 1e3, ".1f"),
        ("beams", "beams %", 100.0, ".1f"),
        ("free_space", "solid %", 100.0, ".2f"),
        ("step_us", "step us", 1.0, ".0f"),
        ("seconds", "s", 1.0, ".1f"),
    )
    lines = [f"{'scene':16s}{'contact':14s}" + "".join(f"{title:>10s}" for _, title, *_ in columns)]
    for name, row in rows.items():
        if "failed" in row:
            lines.append(f"{name:16s}no arena: {row['failed']}")
            continue
        surface, poisson = row.get("surface", {}), row.get("poisson", {})
        said = [
            f"{title} {1e3 * part['points_mean']:.1f} / {1e3 * part['points_p95']:.1f} mm"
            for title, part in (("surface", surface), ("Poisson", poisson))
            if "points_mean" in part
        ]
        beams = f", beams {100 * surface['beams']:.1f} %" if "beams" in surface else ""
        lines.append(f"{name:16s}all points (mean / p95): {', '.join(said)}{beams}")
        for kind, part in row.get("contact", {}).items():
            cells = [_format(part.get(key), scale, style) for key, _, scale, style in columns]
            lines.append(f"{'':16s}{kind:14s}" + "".join(f"{cell:>10s}" for cell in cells))
            if "failed" in part:
                lines[-1] += f"  {part['failed']}"
    return lines


def _format_cell(bar: Bar, value: float | None, is_met: bool | None) -> str:
    if value is None:
        return "-"
    return f"{bar.scale * value:.{bar.digits}f}{'' if is_met else ' !'}"


def _format(value: float | None, scale: float, style: str) -> str:
    if value is None:
        return "-"
    return format(value if style == "d" else scale * value, style)


def _divide(value: float | None, by: float | None) -> float | None:
    return value / by if value is not None and by else None
