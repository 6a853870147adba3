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
COLORS = {"spheres": "#1f5f8b", "wheels": "#c2762b", "cylinders": "#5b8c3a", "capsules": "#8a4f9e"}
MARKERS = {"spheres": "o", "wheels": "s", "cylinders": "^", "capsules": "D"}
THEORY = "#444444"
MODULE_COLORS = {4: "#c2762b", 6: "#5b8c3a", 8: "#1f5f8b"}
STEADY = ", armature 0.004 kg m²"
CREEP_BAR, DEPTH_BAR = 0.1, 1.0
"""Bars [mm/s] and [mm]."""
LEAST_CREEP = 1e-4
"""Lowest creep drawn [mm/s]."""


def draw_slopes(rows: dict[str, Any]) -> None:
    """Draw the steepest slope by friction, and on headings along and across the axes of the world."""
    figure, axes = plt.subplots(1, 2, figsize=(9.5, 4.0), width_ratios=[3, 2], layout="constrained")
    curve = np.linspace(0.2, 1.0, 100)
    axes[0].plot(curve, np.degrees(np.arctan(curve)), color=THEORY, label="theory: atan(friction)")
    for shift, tracks in zip((-0.012, 0.0, 0.012), ("spheres", "wheels", "cylinders"), strict=True):
        for contact, fill in (("pyramidal", COLORS[tracks]), ("elliptic", "none")):
            names = [f"{contact}, {tracks}, 8 modules, friction {mu}, 5 ms, heading 0°" for mu in FRICTIONS]
            found = [rows[name]["simulated"] for name in names]
            axes[0].plot(
                np.array(FRICTIONS) + shift, found, MARKERS[tracks], mfc=fill, mec=COLORS[tracks], ms=6,
                label=f"{tracks}, {contact}",
            )  # fmt: skip
    for tracks in ("wheels", "cylinders"):
        names = [
            f"pyramidal, {tracks}, 8 modules, friction {mu}, 5 ms{STEADY}, heading 0°" for mu in FRICTIONS
        ]
        found = [rows[name]["simulated"] for name in names]
        axes[0].plot(FRICTIONS, found, "x", color=COLORS[tracks], ms=7, label=f"{tracks}, heavier motors")
    axes[0].set(xlabel="friction", ylabel="steepest slope climbed [°]", title="8 modules, straight up")
    axes[0].legend(fontsize=8)
    marks = {"pyramidal": "o", "elliptic": "D"}
    for contact, mark in marks.items():
        found = [
            rows[f"{contact}, spheres, 8 modules, friction 0.7, 5 ms, heading {heading}°"]["simulated"]
            for heading in (0, 45)
        ]
        axes[1].plot(
            (0, 45),
            found,
            mark,
            ms=8,
            color=COLORS["spheres" if contact == "pyramidal" else "cylinders"],
            label=contact,
        )
    heading = np.radians(np.linspace(0, 45, 50))
    pyramid = np.degrees(np.arctan(0.7 / (np.cos(heading) + np.sin(heading))))
    axes[1].axhline(np.degrees(np.arctan(0.7)), color=THEORY, label="theory: atan(0.7)")
    axes[1].plot(np.degrees(heading), pyramid, color=THEORY, ls=":", label="friction pyramid")
    axes[1].set(
        xlabel="heading against the world's axes [°]",
        xlim=(-4, 49),
        ylim=(22, 38),
        title="friction 0.7, spheres",
    )
    axes[1].legend(fontsize=8, loc="lower left")
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
            if row["modules"] == modules and name.startswith("pyramidal, spheres") and "friction 0.7, 5 ms" in name
            and "radius" not in name
            and "speed" not in name
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
    figure, axis = plt.subplots(figsize=(7.5, 4.2), layout="constrained")
    curve = np.linspace(0.2, 0.9, 36)
    for tracks, style, words in (("spheres", "-", "radius 20 mm"), ("cylinders", "--", "radius 11 mm")):
        limits = [
            1000 * find_step_limit(World(tracks=tracks, friction=float(mu)).organism.scout) for mu in curve
        ]
        axis.plot(curve, limits, style, color=THEORY, label=f"theory, wheels of {words}")
    for shift, tracks in zip((-0.008, 0.008, 0.0, 0.0), COLORS, strict=True):
        found = [
            1000 * rows[f"pyramidal, {tracks}, 1 modules, friction {mu}, 5 ms"]["simulated"]
            for mu in FRICTIONS
        ]
        label = "cylinders' place and radius, as capsules" if tracks == "capsules" else tracks
        axis.plot(
            np.array(FRICTIONS) + shift, found, MARKERS[tracks], color=COLORS[tracks], ms=6, label=label
        )
    axis.set(xlabel="friction", ylabel="highest step climbed [mm]", ylim=(0, 10.5))
    axis.legend(fontsize=8, loc="upper left")
    _save(figure, "physics-step.png")


def draw_turns(rows: dict[str, Any]) -> None:
    """Draw the rate of turning by the number of modules, with belts against each other."""
    figure, axes = plt.subplots(1, 2, figsize=(9.5, 4.0), sharey=True, layout="constrained")
    modules = (1, 2, 3, 4)
    for axis, contact in zip(axes, ("pyramidal", "elliptic"), strict=True):
        for tracks, style in (("spheres", "-"), ("cylinders", "--")):
            picked = [
                rows[f"{contact}, {tracks}, {n} modules, friction 0.7, 5 ms, 0.05 m/s"] for n in modules
            ]
            axis.plot(
                modules,
                [row["theory"] for row in picked],
                style,
                color=THEORY,
                label=f"theory, {'radius 20 mm' if tracks == 'spheres' else 'radius 11 mm'}",
            )
            if tracks == "spheres":
                axis.plot(
                    modules,
                    [row["corners"] for row in picked],
                    ":",
                    color=THEORY,
                    label="four corners bear all",
                )
                axis.plot(
                    modules, [row["even"] for row in picked], "-.", color=THEORY, lw=0.8, label="equal loads"
                )
        for tracks in ("spheres", "wheels", "cylinders"):
            picked = [
                rows[f"{contact}, {tracks}, {n} modules, friction 0.7, 5 ms, 0.05 m/s"] for n in modules
            ]
            axis.plot(
                modules,
                [row["simulated"] for row in picked],
                MARKERS[tracks],
                color=COLORS[tracks],
                label=tracks,
            )
        for tracks in ("wheels", "cylinders") if contact == "elliptic" else ():
            picked = [
                rows[f"{contact}, {tracks}, {n} modules, friction 0.7, 5 ms{STEADY}, 0.05 m/s"]
                for n in modules
            ]
            axis.plot(
                modules,
                [row["simulated"] for row in picked],
                MARKERS[tracks],
                mfc="none",
                mec=COLORS[tracks],
                ms=9,
                label=f"{tracks}, heavier motors",
            )
            axis.legend(fontsize=8)
        axis.set(xlabel="modules", title=f"{contact} contacts", yscale="log", xticks=modules)
    axes[0].set_ylabel("rate of turning [rad/s]")
    axes[0].legend(fontsize=8)
    _save(figure, "physics-turning.png")


def draw_energies(rows: dict[str, Any]) -> None:
    """Draw what each robot was given and where it went."""
    figure, axis = plt.subplots(figsize=(9.0, 4.0), layout="constrained")
    kinds = {
        "hinges": "#1f5f8b",
        "tracks": "#7fb0d0",
        "stored": "#5b8c3a",
        "sliding": "#c2762b",
        "impact": "#b0413e",
        "damping": "#8a4f9e",
    }
    for place, row in enumerate(rows.values()):
        for shift, group in ((-0.2, ("hinges", "tracks")), (0.2, ("stored", "sliding", "impact", "damping"))):
            below = 0.0
            for kind in group:
                axis.bar(
                    place + shift,
                    row[kind],
                    0.36,
                    bottom=below,
                    color=kinds[kind],
                    label=kind if place == 0 else None,
                )
                below += row[kind]
        top = row["hinges"] + row["tracks"]
        axis.text(place, top + 0.15, f"{100 * row['residual']:.2f} %", ha="center", fontsize=8)
    words = [name.split(", ") for name in rows]
    axis.set_xticks(range(len(rows)), [f"{each[1]}\n{each[0]}\n{each[4]}" for each in words], fontsize=8)
    axis.set(
        ylabel="energy [J]",
        ylim=(0, 10),
        title="left: work of the motors; right: where it went; above: what is missing",
    )
    axis.legend(fontsize=8, ncols=6, loc="upper center")
    _save(figure, "physics-energy.png")


def draw_rests(rows: dict[str, Any], touches: dict[str, Any]) -> None:
    """Draw creep at rest, and how deep modules press into each other."""
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.8), layout="constrained")
    slopes, frequencies = (0, 10, 20), (0.1, 0.5, 1.0)
    for shift, (contact, color) in zip(
        (-0.2, 0.2), (("pyramidal", "#1f5f8b"), ("elliptic", "#5b8c3a")), strict=True
    ):
        name = f"{contact}, spheres, 8 modules, friction 0.7, 5 ms"
        creep = [max(1000 * rows[f"still, {name}, slope {slope}°"]["speed"], LEAST_CREEP) for slope in slopes]
        axes[0].bar(np.arange(3) + shift, creep, 0.38, color=color, label=contact, bottom=0)
        cycle = [1000 * rows[f"twitching, {name}, 0.3 rad, {f} Hz"]["per cycle"] for f in frequencies]
        axes[1].bar(np.arange(3) + shift, cycle, 0.38, color=color)
        picked = [touches[f"{contact}, spheres, {n} modules, friction 0.7, 5 ms"] for n in (5, 6, 8)]
        axes[2].bar(
            np.arange(3) + shift, [1000 * each["between_modules"] for each in picked], 0.38, color=color
        )
        worst = [1000 * each["worst_between_modules"] for each in picked]
        axes[2].plot(
            np.arange(3) + shift,
            worst,
            "_",
            color="k",
            ms=14,
            label="worst while closing" if shift < 0 else None,
        )
        firm = [
            touches[f"{contact}, spheres, {n} modules, friction 0.7, 2 ms, contact 0.004 s"]
            for n in (5, 6, 8)
        ]
        axes[2].plot(
            np.arange(3) + shift,
            [1000 * each["worst_between_modules"] for each in firm],
            "x" if shift < 0 else "+",
            color="k",
            ms=7,
            label=f"worst, firm, {contact}",
        )
    axes[0].axhline(CREEP_BAR, color=THEORY, ls="--", label="bar")
    axes[0].set(
        yscale="log",
        ylim=(LEAST_CREEP / 2, 2),
        ylabel="creep [mm/s]",
        xlabel="slope [°]",
        title="hinges still, tracks off",
    )
    axes[0].set_xticks(range(3), slopes)
    axes[1].set(ylabel="moved in a cycle [mm]", xlabel="frequency [Hz]", title="hinges twitching by 0.3 rad")
    axes[1].set_xticks(range(3), frequencies)
    axes[2].axhline(DEPTH_BAR, color=THEORY, ls="--")
    axes[2].set(
        yscale="log", ylabel="depth [mm]", xlabel="modules, curled up", title="modules pressed together"
    )
    axes[2].set_xticks(range(3), (5, 6, 8))
    axes[0].legend(fontsize=8, loc="upper left")
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
    draw_energies(rows["energy"])
    draw_rests(rows["rest"], rows["touching"])


if __name__ == "__main__":
    main()
