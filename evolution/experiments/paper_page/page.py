"""The page of the paper's experiments, each beside the paper's own numbers."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from evolution.experiments.paper.config import PaperConfig
from evolution.experiments.paper_page import tables
from evolution.experiments.paper_page.context import PaperContext
from evolution.experiments.paper_page.pipeline import add_arenas, add_cloud, add_networks, add_scene
from evolution.experiments.paper_page.results import (
    add_laser,
    add_models,
    add_physics,
    add_robots,
    add_widened,
)
from evolution.report.page import Page

BAR_PHYSICS, BAR_LASER = 1.3, 1.5
DEVIATIONS = (
    "The arena is made up. The paper's is known from its pictures alone; its sizes (pit of 0.45 m) and friction (0.7) "
    "were chosen by trial so that a body without control fails and an evolved one can cross.",
    "The survey is simulated: a virtual robot with two SICK LMS 200, whose noise, mixed pixels, shaking and "
    "localisation errors follow measurements of real ones. No public copy of the paper's scans exists.",
    "MuJoCo stands for ODE. A mesh collides in it as its convex hull, so contact is with convex pieces of the "
    "surface, not with its triangles; rays see the exact triangles. The row prisms of Table II touches triangles.",
    "Table II: a step is 5 ms of simulated time. Ours includes its collision detection; the paper's takes "
    "longer than its physics step, so the two stand beside each other there.",
    "Table II: 3,500 steps are 17.5 s, in which the body comes 1.75 m far at most. So a run is timed from the moment "
    "the head is above the pit, and goes on untimed until the body is across.",
    "Table II: simple is the hand-made mesh, turned into convex pieces as the other meshes are. The same shape as five "
    "exact boxes is the row boxes.",
    "Table III: where the scanner stands is our choice, along the course. The arena is scanned alone, without a robot, "
    "so that nothing dilutes the ratio; what counts is processor time. Brute force is written in NumPy, not in the "
    "paper's simulator.",
    "Tracks are spheres whose surface moves, not wheels on joints.",
    "Hinge torque (4.5 N m), hinge speed (0.8 rad/s) and track speed (0.1 m/s) are estimates, not measurements of the "
    "Scout robot.",
    "The networks learn in batches, with a final fit to the samples, not signal by signal; the literal rules are there "
    'as mode="paper", and slow.',
    "The hand-made model has 38 triangles, the paper's about 39.",
    "The computers differ: the paper's times are of 2011. Ratios compare, times do not.",
)


def write_paper_page(
    folder: Path, config: PaperConfig, records: Mapping[str, Mapping[str, Any]], path: Path
) -> None:
    """Write the page from what the experiments kept; self-contained, nothing is fetched.

    Args:
        folder: of the experiments; the figures appear there as files too.
        config: what was measured.
        records: experiment -> record.
        path: the HTML file.
    """
    page = Page(
        "Bringing reality into evolution: the experiments, measured again",
        summary="The experiments of the SYMBRION paper of 2011 on this machine, each beside the paper's own numbers: a "
        "laser scan becomes surfaces, the surfaces become arenas, a snake of docked robots evolves there, and the true "
        "arena, which evolution never saw, judges it.",
    )
    context = PaperContext(folder, config, records, page)
    page.footer = (
        f"{context.command} · {records['cloud']['machine']} · tables, figures and films are also files in this page's "
        "folder: results.json, figures, films"
    )
    _add_verdicts(context)
    page.add_contents()
    add_scene(context)
    add_cloud(context)
    add_networks(context)
    add_arenas(context)
    add_physics(context)
    add_laser(context)
    add_robots(context)
    add_models(context)
    add_widened(context)
    page.add_section("What differs from the paper")
    page.add_list(DEVIATIONS)
    _add_times(context)
    page.write(path)


def _add_verdicts(context: PaperContext) -> None:
    records = context.records
    judged = records["evolution"]["figures"]["judged"]["truth"]
    held, trials = judged["successes"], judged["trials"]
    context.page.add_verdict(
        f"The champion crosses the true pit in {held} of {trials} randomised trials; the surface it evolved on came "
        "from the scan alone.",
        good=held >= 0.9 * trials,
    )
    claims = (
        ("physics step", records["physics"]["figures"]["ratios"]["gg"]["physics_us"], BAR_PHYSICS, "1"),
        ("laser scan", records["laser"]["figures"]["ratios"]["tree"]["gg"], BAR_LASER, "66"),
    )
    for what, ratio, bar, paper in claims:
        context.page.add_verdict(
            f"With the finest growing grid a {what} takes {tables.format_ratio(ratio)} times as long as with the "
            f"hand-made model (the paper: about {paper}; our bar: {bar}).",
            good=ratio["ratio"] <= bar,
        )


def _add_times(context: PaperContext) -> None:
    columns = ("seconds", "cpu_seconds")
    rows = [
        [name, *(f"{record[column]:.1f}" for column in columns)] for name, record in context.records.items()
    ]
    sums = [sum(record[column] for record in context.records.values()) for column in columns]
    context.page.add_section("Where the time went")
    context.page.add_table(
        ["experiment", "wall time [s]", "processor time [s]"],
        [*rows, ["together", *(f"{total:.0f}" for total in sums)]],
        tables.sign("1 run each; without the drawing of this page.", context.records["cloud"]),
    )
