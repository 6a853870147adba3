"""The page of the paper's experiments, each beside the paper's own numbers."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from evolution.report.demo_page import add_arenas, add_evolution, add_films, add_scan, add_surfaces
from evolution.report.page import Page
from evolution.report.provenance import describe_machine

if TYPE_CHECKING:
    from evolution.demo import Road
    from evolution.paper import CostRow, NetworkRow, PaperConfig

MILLIMETRES = 1000.0
PAPER_TABLE_1 = {"GSRM 2200": "4,175 triangles, 20 s", "GG 13860 triangles": "13,860 triangles, 270 s"}
PAPER_TABLE_2 = {"gg": "147-152 / 825-846", "gsrm": "147-152 / 825-846", "simple": "147-152 / 825-846"}
PAPER_TABLE_3 = {"gg": "362,000", "gsrm": "119,000", "simple": "5,450"}
DEVIATIONS = (
    "The paper's arena is known from its pictures alone; sizes and friction were chosen so that there is something to "
    "evolve.",
    "MuJoCo stands for ODE: contacts are between convex pieces, not triangles.",
    "Tracks are surface velocity of spheres, not wheels on joints.",
    "Hinge torque, hinge speed and track speed are estimates, not measurements of the Scout robot.",
    "The scan log comes from a virtual robot whose scanner has the errors of the real one; no public copy of the "
    "paper's data exists.",
)


def write_paper_page(
    road: "Road",
    networks: Sequence["NetworkRow"],
    costs: Sequence["CostRow"],
    config: "PaperConfig",
    path: Path,
) -> None:
    """Write the page; self-contained, nothing is fetched.

    Args:
        road: survey, surfaces, arenas and evolution.
        networks: Table I.
        costs: Tables II and III.
        config: how much was measured.
        path: the HTML file.
    """
    page = Page(
        "Bringing reality into evolution: the experiments, measured again",
        summary="The experiments of the SYMBRION paper of 2011 on this machine: scan, surfaces, arenas, the cost of "
        "simulating them, and an evolved robot judged in the true arena.",
        footer=f"symbrion paper --seed {config.seed} · {describe_machine()}",
    )
    add_scan(page, road)
    add_surfaces(page, road)
    _add_networks(page, networks, config)
    add_arenas(page, road)
    _add_costs(page, costs, config)
    add_evolution(page, road)
    add_films(page, road)
    page.add_section("What differs from the paper")
    for text in DEVIATIONS:
        page.add_text(text)
    page.write(path)


def _add_networks(page: Page, rows: Sequence["NetworkRow"], config: "PaperConfig") -> None:
    page.add_section("Table I: computing the surfaces")
    page.add_table(
        ["network", "triangles", "first call [s]", "second call [s]", "truth to mesh, mean [mm]", "p95 [mm]",
         "mesh to truth [mm]", "rims", "the paper (2011)"],
        [
            [
                row.network,
                f"{row.triangles:,}",
                f"{row.first_seconds:.2f}",
                f"{row.seconds:.2f}",
                f"{row.truth_to_mesh * MILLIMETRES:.2f}",
                f"{row.truth_to_mesh_p95 * MILLIMETRES:.2f}",
                f"{row.mesh_to_truth * MILLIMETRES:.2f}",
                row.boundary_loops,
                PAPER_TABLE_1.get(row.network, ""),
            ]
            for row in rows
        ],
        f"One cloud, seed {config.seed}; the first call holds the compilation.",
    )  # fmt: skip


def _add_costs(page: Page, rows: Sequence["CostRow"], config: "PaperConfig") -> None:
    page.add_section(
        "Table II: physics", "MuJoCo's own timers while the champion crosses the pit; the arenas take turns."
    )
    page.add_table(
        ["arena", "contact pieces", "step [µs]", "collision [µs]", "the paper: step / collision [µs]"],
        [
            [row.arena, row.pieces, _format(row.costs["physics"]), _format(row.costs["collision"]),
             PAPER_TABLE_2.get(row.arena, "")]
            for row in rows
        ],
        f"Mean ± deviation over {config.runs} runs of up to {config.steps} steps.",
    )  # fmt: skip
    page.add_section(
        "Table III: one laser scan",
        "361 beams on the exact surface, by mj_multiRay through a bounding-volume tree.",
    )
    page.add_table(
        ["arena", "triangles", "scan [µs]", "the paper [µs]"],
        [
            [row.arena, f"{row.triangles:,}", _format(row.costs["scan"]), PAPER_TABLE_3.get(row.arena, "")]
            for row in rows
        ],
        f"Mean ± deviation over about {config.scans} scans along the crossing.",
    )


def _format(cost: tuple[float, float]) -> str:
    return f"{cost[0]:,.1f} ± {cost[1]:,.1f}"
