"""Draw the plots of the page on physics, from `benchmarks/results/physics.json`: `python docs/physics_pictures.py`.

Curves are computed here from the theory of `benchmarks/material`, points are the stored rows of the simulation.
"""

import json
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from benchmarks.material.physics_theory import find_beam_gap_limit, find_gap_limits
from benchmarks.material.physics_wheels import find_step_limit
from benchmarks.material.physics_worlds import World
from reconstruction._src.base.atomic_write import write_atomically

FOLDER = Path(__file__).parent / "images"
RESULTS = Path(__file__).parents[1] / "benchmarks" / "results" / "physics.json"
FRICTIONS = (0.3, 0.5, 0.7, 0.9)
COLOR = "#1f5f8b"
THEORY = "#444444"
MODULE_COLORS = {4: "#c2762b", 6: "#5b8c3a", 8: "#1f5f8b"}
CREEP_BAR, DEPTH_BAR = 0.1, 1.0
"""Bars [mm/s] and [mm]."""


def draw_slopes(rows: dict[str, Any]) -> None:
    """Draw the steepest slope by friction, straight up and along the diagonal of the world's axes."""
    figure, axis = plt.subplots(figsize=(7.0, 4.0), layout="constrained")
    curve = np.linspace(0.2, 1.0, 100)
    axis.plot(curve, np.degrees(np.arctan(curve)), color=THEORY, label="theory: atan(friction)")
    names = [f"8 modules, friction {mu}, 5 ms, heading 0°" for mu in FRICTIONS]
    axis.plot(FRICTIONS, [rows[name]["simulated"] for name in names], "o", color=COLOR, label="straight up")
    diagonal = rows["8 modules, friction 0.7, 5 ms, heading 45°"]["simulated"]
    axis.plot(0.7, diagonal, "D", mfc="none", mec="#c2762b", ms=10, label="along the diagonal")
    axis.set(xlabel="friction", ylabel="steepest slope climbed [°]", title="8 modules")
    axis.legend(fontsize=8)
    _save(figure, "physics-slope.png")


def draw_gaps(rows: dict[str, Any]) -> None:
    """Draw the widest gap that a stiff snake crosses by the torque of its hinges."""
    figure, axis = plt.subplots(figsize=(8.5, 4.6), layout="constrained")
    torques = np.arange(0.4, 8.41, 0.1)
    for modules, color in MODULE_COLORS.items():
        limits = find_gap_limits(World(modules=modules).organism, [float(torque) for torque in torques])
        label = f"theory, {modules} modules"
        axis.plot(torques, [100 * limit for limit in limits], color=color, label=label)
        picked = [
            row for name, row in rows.items()
            if row["modules"] == modules and "friction 0.7, 5 ms" in name
            and not any(word in name for word in ("radius", "speed"))
        ]  # fmt: skip
        axis.plot(
            [row["torque"] for row in picked],
            [100 * row["simulated"] for row in picked],
            "o",
            color=color,
            label=f"simulated, {modules} modules",
        )
    beam = [
        100 * find_beam_gap_limit(World(modules=8, scout={"hinge_torque": float(t)}).organism)
        for t in torques
    ]
    axis.plot(torques, beam, color=THEORY, ls=":", label="even beam, 8 modules")
    axis.axvspan(4.0, 5.0, color="#e8d9b8", alpha=0.6, lw=0, label="estimated torque of a Scout")
    axis.set(
        xlabel="torque of a hinge [N m]", ylabel="widest gap crossed [cm]", xlim=(0.3, 8.5), ylim=(0, 52)
    )
    axis.legend(fontsize=8, ncols=2, loc="lower right")
    _save(figure, "physics-gap.png")


def draw_steps(rows: dict[str, Any]) -> None:
    """Draw the highest step that a lone module climbs by friction."""
    figure, axis = plt.subplots(figsize=(7.0, 4.0), layout="constrained")
    curve = np.linspace(0.2, 0.9, 36)
    limits = [1000 * find_step_limit(World(friction=float(mu)).organism.scout) for mu in curve]
    axis.plot(curve, limits, color=THEORY, label="theory")
    found = [1000 * rows[f"1 modules, friction {mu}, 5 ms"]["simulated"] for mu in FRICTIONS]
    axis.plot(FRICTIONS, found, "o", color=COLOR, label="simulated")
    axis.set(xlabel="friction", ylabel="highest step climbed [mm]", ylim=(0, 11))
    axis.legend(fontsize=8, loc="upper left")
    _save(figure, "physics-step.png")


def draw_turns(rows: dict[str, Any]) -> None:
    """Draw the rate of turning by the number of modules, with belts against each other."""
    figure, axis = plt.subplots(figsize=(7.0, 4.0), layout="constrained")
    modules = (1, 2, 3, 4)
    picked = [rows[f"{n} modules, friction 0.7, 5 ms, 0.05 m/s"] for n in modules]
    for figure_name, style, label in (
        ("theory", "-", "theory"), ("corners", ":", "four corners bear all"), ("even", "-.", "equal loads"),
    ):  # fmt: skip
        axis.plot(modules, [row[figure_name] for row in picked], style, color=THEORY, lw=1, label=label)
    axis.plot(modules, [row["simulated"] for row in picked], "o", color=COLOR, label="simulated, 5 ms")
    fine = [rows[f"{n} modules, friction 0.7, 1 ms, 0.05 m/s"]["simulated"] for n in modules[1:]]
    axis.plot(modules[1:], fine, "x", color="#c2762b", label="simulated, 1 ms")
    axis.set(xlabel="modules", ylabel="rate of turning [rad/s]", yscale="log", xticks=modules)
    axis.legend(fontsize=8)
    _save(figure, "physics-turning.png")


def draw_rests(rows: dict[str, Any], touches: dict[str, Any]) -> None:
    """Draw creep at rest, and how deep modules press into each other."""
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.6), layout="constrained")
    name, places = "8 modules, friction 0.7, 5 ms", range(3)
    creep = [1000 * rows[f"still, {name}, slope {slope}°"]["speed"] for slope in (0, 10, 20)]
    axes[0].bar(places, creep, color=COLOR)
    axes[0].axhline(CREEP_BAR, color=THEORY, ls="--", label="target")
    axes[0].set(ylabel="creep [mm/s]", xlabel="slope [°]", title="hinges still, tracks off")
    axes[0].set_xticks(places, (0, 10, 20))
    cycle = [1000 * rows[f"twitching, {name}, 0.3 rad, {f} Hz"]["per cycle"] for f in (0.1, 0.5, 1.0)]
    axes[1].bar(places, cycle, color=COLOR)
    axes[1].set(ylabel="moved in a cycle [mm]", xlabel="frequency [Hz]", title="hinges twitching by 0.3 rad")
    axes[1].set_xticks(places, (0.1, 0.5, 1.0))
    picked = [touches[f"{n} modules, friction 0.7, 5 ms"] for n in (5, 6, 8)]
    axes[2].bar(places, [1000 * each["between_modules"] for each in picked], color=COLOR, label="at rest")
    worst = [1000 * each["worst_between_modules"] for each in picked]
    axes[2].plot(places, worst, "_", color="k", ms=14, label="worst while closing")
    axes[2].axhline(DEPTH_BAR, color=THEORY, ls="--", label="target")
    axes[2].set(ylabel="depth [mm]", xlabel="modules, curled up", title="modules pressed together")
    axes[2].set_xticks(places, (5, 6, 8))
    axes[0].legend(fontsize=8)
    axes[2].set_ylim(0, 1.35 * max(worst))
    axes[2].legend(fontsize=8, loc="upper left")
    _save(figure, "physics-rest.png")


def _save(figure: Figure, name: str) -> None:
    with write_atomically(FOLDER / name) as temporary:
        figure.savefig(temporary, dpi=110, format="png")
    plt.close(figure)


def main() -> None:
    """Draw all of them."""
    rows = json.loads(RESULTS.read_text())["results"]
    draw_slopes(rows["slope"])
    draw_gaps(rows["gap"])
    draw_steps(rows["step"])
    draw_turns(rows["turning"])
    draw_rests(rows["rest"], rows["touching"])


if __name__ == "__main__":
    main()
