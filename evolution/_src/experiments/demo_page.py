"""The page of the demo: what was scanned, built and evolved, and whether the champion crosses the true arena."""

from pathlib import Path
from typing import TYPE_CHECKING

import symbrion_gym as sg
from evolution._src.experiments.demo import MODULES, paint_truth
from evolution._src.report.arena_view import draw_arena
from evolution._src.report.body_page import describe_machine, describe_selection
from evolution._src.report.error_map import draw_error_map
from evolution._src.report.figures import (
    draw_cloud,
    draw_learning_curve,
    draw_pieces,
    draw_section,
    draw_surface,
    draw_tracks,
    to_png,
)
from evolution._src.report.page import Page
from evolution._src.report.video import encode_video

if TYPE_CHECKING:
    from evolution._src.experiments.demo import DemoResult

NAMES = {"gsrm": "Growing self-reconstruction map", "gg": "Growing grid"}
MILLIMETERS = 1000.0


def write_demo_page(result: "DemoResult", path: Path) -> None:
    """Write the page of a demo as one self-contained HTML file."""
    page = Page(
        "From a laser scan to a snake that crosses the pit",
        summary="A virtual robot scans the arena with two laser scanners, self-organizing networks turn the scan "
        "into surfaces, the surfaces become MuJoCo arenas, and CMA-ES evolves a snake of docked Scouts in one of them. "
        "Whether the snake really crosses is judged in the true arena, which evolution never saw.",
        footer=f"symbrion demo --seed {result.config.seed} · {describe_machine()}",
    )
    for name, crosses in result.crosses.items():
        place = "true arena" if name == "truth" else "reconstructed arena"
        outcome = result.outcomes[name]
        page.add_verdict(
            f"The champion {'crosses' if crosses else 'does not cross'} the pit in the {place}: "
            f"{outcome.successes} of {outcome.trials} randomized trials from the floor succeed "
            "(every module across, upright and at ground height).",
            good=crosses,
        )
    add_films(page, result)
    add_scan(page, result)
    add_surfaces(page, result)
    add_arenas(page, result)
    add_evolution(page, result)
    page.add_section("Time per step")
    rows = [[name, f"{seconds:.1f}"] for name, seconds in result.seconds.items()]
    total = ["total", f"{sum(result.seconds.values()):.1f}"]
    page.add_table(["step", "wall time [s]"], [*rows, total], "Wall time of each step.")
    page.write(path)


def add_films(page: Page, result: "DemoResult") -> None:
    """Show the champion in the true arena and an insufficient robot, as video and side view."""
    page.add_section("The robot in the true arena")
    captions = {
        "truth": "The champion in the true arena, from the floor, at five times real time.",
        "insufficient": "An insufficiently evolved robot of the same length, from the first generation.",
    }
    for name, caption in captions.items():
        film = result.films[name]
        if film.frames:
            page.add_video(encode_video(film.frames, film.fps), caption)
        surface = sg.load_arena("truth").surface
        moments = "Side view of the body at seven times, from violet (early) to yellow (late)."
        page.add_figure(draw_tracks(film.positions, surface), moments)
    if not result.films["truth"].frames:
        page.add_text(
            "There is no video: this machine has no OpenGL, neither off screen nor through a display. "
            "The side views above show the same trials."
        )


def add_scan(page: Page, result: "DemoResult") -> None:
    """Show the point cloud before and after pre-processing."""
    (scans, beams), raw, cloud = result.log.ranges.shape, result.log.points(), result.cloud
    page.add_section(
        "Scan",
        f"{scans:,} vertical scans of {beams} beams; {len(raw):,} readings, of which {len(cloud.points):,} remain "
        "after leveling, smoothing, removal of mixed pixels and thinning.",
    )
    page.add_figure(draw_cloud(raw), "Raw readings, colored by height.")
    page.add_figure(
        draw_cloud(cloud.points, colors=cloud.colors),
        "The readings after pre-processing, thinned to 15 mm, in the colors that the robot's camera saw.",
    )


def add_surfaces(page: Page, result: "DemoResult") -> None:
    """Show the surfaces of both networks and their distances from the true surface."""
    truth = sg.load_arena("truth").surface
    truth_colors = paint_truth().find_colors
    page.add_section("Surfaces", "Two self-organizing networks learn the points.")
    rows = []
    for method, surface in result.surfaces.items():
        quality = surface.quality(truth)
        topology, there, back = quality.topology, quality.truth_to_mesh, quality.mesh_to_truth
        assert there is not None
        assert back is not None
        seconds, colors = result.seconds[f"network {method}"], surface.color_error(truth_colors).rmse
        distances = (f"{MILLIMETERS * each:.2f}" for each in (there.mean, there.p95, back.mean))
        counts = (
            topology.boundary_loops,
            topology.non_manifold_edges,
            quality.self_intersections,
            quality.folds,
        )
        size = f"{len(surface.mesh.faces):,}"
        rows.append([NAMES[method], size, f"{seconds:.1f}", *distances, *counts, f"{colors:.3f}"])
        page.add_figure(
            draw_surface(surface.mesh), f"{NAMES[method]}, {len(surface.mesh.faces):,} triangles."
        )
    page.add_table(
        ["network", "triangles", "learning time [s]", "true surface to mesh, mean [mm]",
         "true surface to mesh, 95th percentile [mm]", "mesh to true surface, mean [mm]",
         "boundary loops", "non-manifold edges", "pairs of intersecting triangles", "folds", "error of colors (of 1)"],
        rows,
        "Distances between the mesh and the true surface. The time includes compilation, which a machine does once. "
        "One boundary loop is the outer rim. Folds: edges at which the surface turns by more than 120 degrees. "
        "Error of colors: root mean square of the vertices' colors, away from the edges of the true ones.",
    )  # fmt: skip


def add_arenas(page: Page, result: "DemoResult") -> None:
    """Show the convex pieces, and a section through the pit."""
    page.add_section(
        "Arenas",
        "A mesh collides in MuJoCo as its convex hull, which would fill the pit. So the surface is decomposed into "
        "convex pieces for contact; rays and images use the exact surface.",
    )
    rows = []
    page.add_figure(
        to_png(draw_arena(result.arenas["gsrm"], ("surface",)), is_reduced=False),
        "The exact surface with the colors of the readings, as MuJoCo shows it; the true arena is a checker.",
    )
    for method, arena in result.arenas.items():
        page.add_figure(draw_pieces(arena.pieces), f"{NAMES[method]}: {len(arena.pieces)} convex pieces.")
        page.add_figure(
            to_png(draw_error_map(arena), is_reduced=False),
            f"{NAMES[method]}: where the contact geometry lies in front of the surface (red) or behind it (blue).",
        )
        distances = (f"{MILLIMETERS * each:.2f}" for each in (arena.quality.mean, arena.quality.p95))
        seconds = result.seconds[f"arena {method}"]
        rows.append([NAMES[method], len(arena.pieces), f"{seconds:.1f}", *distances])
    page.add_table(
        ["arena from", "convex pieces", "building time [s]", "pieces to surface, mean [mm]",
         "pieces to surface, 95th percentile [mm]"],
        rows,
        "Distances of the contact geometry from the reconstructed surface.",
    )  # fmt: skip
    section = {"truth": sg.load_arena("truth").surface, "GSRM": result.surfaces["gsrm"].mesh}
    page.add_figure(
        draw_section(section | {"pieces": result.arenas["gsrm"].pieces}, result.cloud.points),
        "Vertical section through the pit along the course: true surface, reconstructed surface, convex pieces, and "
        "nearby readings.",
    )


def add_evolution(page: Page, result: "DemoResult") -> None:
    """Show the learning curve and the genotype of the champion."""
    history, champion = result.run.history, result.run.champion
    assert champion is not None
    page.add_section(
        "Evolution",
        f"CMA-ES with {MODULES} modules in the GSRM arena: {int(history[-1]['evaluations'])} genotypes "
        f"in {len(history)} generations and {result.seconds['evolution']:.0f} s. "
        f"{describe_selection(champion.successes, champion.trials)}",
    )
    page.add_figure(
        draw_learning_curve(history["evaluations"], history["best"], history["median"]),
        "Fitness: progress of the whole body in meters, plus 1 for a success, minus effort.",
    )
    page.add_table(
        ["gene", "value"],
        [[name, f"{value:.3f}"] for name, value in zip(champion.names, champion.genotype, strict=True)],
        f"Genotype of the champion; controller: {champion.controller}.",
    )
