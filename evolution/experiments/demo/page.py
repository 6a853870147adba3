"""The page of the demo: what was scanned, built and evolved, and whether it holds in the true arena."""

from pathlib import Path
from typing import TYPE_CHECKING

import symbrion_gym as sg
from evolution.report.figures import (
    draw_cloud,
    draw_learning_curve,
    draw_pieces,
    draw_section,
    draw_surface,
    draw_tracks,
)
from evolution.report.page import Page
from evolution.report.provenance import describe_machine
from evolution.report.video import encode_video

if TYPE_CHECKING:
    from evolution.experiments.demo.demo import Road

NAMES = {"gsrm": "Growing self-reconstruction map", "gg": "Growing grid"}
MILLIMETRES = 1000.0


def write_demo_page(road: "Road", path: Path) -> None:
    """Write the page of a walked road; self-contained, nothing is fetched.

    Args:
        road: what was made.
        path: the HTML file.
    """
    page = Page(
        "From a laser scan to a snake that crosses the pit",
        summary="A virtual robot scans the arena with two laser scanners, self-organising networks turn the scan "
        "into surfaces, the surfaces become MuJoCo arenas, and CMA-ES evolves there a snake of docked Scouts. "
        "Whether it really crosses is judged in the true arena, which evolution never saw.",
        footer=f"symbrion demo --seed {road.config.seed} · {describe_machine()}",
    )
    for name, crosses in road.crosses.items():
        place = "true arena" if name == "truth" else "reconstructed arena"
        held = road.judgements[name]
        page.add_verdict(
            f"The champion {'crosses' if crosses else 'does not cross'} the pit in the {place}: "
            f"{held.successes} of {held.trials} randomised trials from the floor, "
            "every module across, upright and at ground height.",
            good=crosses,
        )
    add_films(page, road)
    add_scan(page, road)
    add_surfaces(page, road)
    add_arenas(page, road)
    add_evolution(page, road)
    _add_times(page, road)
    page.write(path)


def add_films(page: Page, road: "Road") -> None:
    """Show the champion in the true arena and an insufficient robot, as video and side view."""
    page.add_section("The robot in the true arena")
    captions = {
        "truth": "The champion in the true arena, from the floor, five times faster than real.",
        "insufficient": "An insufficiently evolved robot of the same length, from the first generation.",
    }
    for name, caption in captions.items():
        film = road.films[name]
        if film.frames:
            page.add_video(encode_video(film.frames, film.fps), caption)
        surface = sg.load_arena("truth").surface
        moments = "Side view of the body at seven moments, from violet (early) to yellow (late)."
        page.add_figure(draw_tracks(film.positions, surface), moments)
    if not road.films["truth"].frames:
        page.add_text(
            "There is no video: this machine has no OpenGL, neither through EGL nor through a display. "
            "The side views above show the same trials."
        )


def add_scan(page: Page, road: "Road") -> None:
    """Show the cloud before and after the pre-processing."""
    scans, beams = road.log.ranges.shape
    page.add_section(
        "Scan",
        f"{scans:,} vertical scans of {beams} beams; {len(road.raw_points):,} readings, of which "
        f"{len(road.points):,} remain after levelling, smoothing, the removal of mixed pixels and even thinning.",
    )
    page.add_figure(draw_cloud(road.raw_points), "Raw readings, coloured by height.")
    page.add_figure(draw_cloud(road.points), "The same after the pre-processing, thinned to 15 mm.")


def add_surfaces(page: Page, road: "Road") -> None:
    """Show the two networks' surfaces and their distances from the truth."""
    truth = sg.load_arena("truth").surface
    page.add_section("Surfaces", "Two self-organising networks learn the cloud.")
    rows = []
    for method, surface in road.surfaces.items():
        quality = surface.quality(truth)
        assert quality.truth_to_mesh is not None
        assert quality.mesh_to_truth is not None
        rows.append(
            [
                NAMES[method],
                f"{len(surface.mesh.faces):,}",
                f"{road.seconds[f'network {method}']:.1f}",
                f"{quality.truth_to_mesh.mean * MILLIMETRES:.2f}",
                f"{quality.truth_to_mesh.p95 * MILLIMETRES:.2f}",
                f"{quality.mesh_to_truth.mean * MILLIMETRES:.2f}",
                quality.topology.boundary_loops,
                quality.topology.non_manifold_edges,
                quality.self_intersections,
                quality.folds,
            ]
        )
        page.add_figure(
            draw_surface(surface.mesh), f"{NAMES[method]}, {len(surface.mesh.faces):,} triangles."
        )
    page.add_table(
        ["network", "triangles", "time [s]", "truth to mesh, mean [mm]", "p95 [mm]", "mesh to truth [mm]",
         "rims", "non-manifold edges", "intersecting pairs", "folds"],
        rows,
        "Distances from the true surface; the time holds the compilation, once a machine. Intersecting pairs: "
        "triangles that pass through one another; folds: edges where the surface turns by more than 120 degrees.",
    )  # fmt: skip


def add_arenas(page: Page, road: "Road") -> None:
    """Show the convex pieces, and the cut through the pit."""
    page.add_section(
        "Arenas",
        "A mesh collides in MuJoCo as its convex hull, which would fill the pit. So the surface is decomposed into "
        "convex pieces for contact, and kept exactly for rays and pictures.",
    )
    rows = []
    for method, arena in road.arenas.items():
        page.add_figure(draw_pieces(arena.pieces), f"{NAMES[method]}: {len(arena.pieces)} convex pieces.")
        rows.append(
            [
                NAMES[method],
                len(arena.pieces),
                f"{road.seconds[f'arena {method}']:.1f}",
                f"{arena.quality.mean * MILLIMETRES:.2f}",
                f"{arena.quality.p95 * MILLIMETRES:.2f}",
            ]
        )
    page.add_table(
        ["arena", "pieces", "time [s]", "pieces to surface, mean [mm]", "p95 [mm]"],
        rows,
        "How well the contact geometry follows the reconstructed surface.",
    )
    section = {"truth": sg.load_arena("truth").surface, "GSRM": road.surfaces["gsrm"].mesh}
    page.add_figure(
        draw_section(section | {"pieces": road.arenas["gsrm"].pieces}, road.points),
        "Cut through the pit along the course: true surface, reconstruction, convex pieces, and readings nearby.",
    )


def add_evolution(page: Page, road: "Road") -> None:
    """Show the learning curve and the champion's genes."""
    history, champion = road.run.history, road.run.champion
    assert champion is not None
    page.add_section(
        "Evolution",
        f"CMA-ES with {road.config.modules} modules in the GSRM arena: {int(history[-1]['evaluations'])} genotypes "
        f"in {len(history)} generations and {road.seconds['evolution']:.0f} s. The champion was chosen by fresh "
        f"randomised trials: {champion.successes} of {champion.trials} held.",
    )
    page.add_figure(
        draw_learning_curve(history["evaluations"], history["best"], history["median"]),
        "Fitness: progress of the whole body in metres, plus 1 for a success, less effort.",
    )
    page.add_table(
        ["gene", "value"],
        [[name, f"{value:.3f}"] for name, value in zip(champion.names, champion.genotype, strict=True)],
        f"The champion: a {champion.controller} controller.",
    )


def _add_times(page: Page, road: "Road") -> None:
    page.add_section("Where the time went")
    rows = [[name, f"{seconds:.1f}"] for name, seconds in road.seconds.items()]
    page.add_table(
        ["step", "seconds"], [*rows, ["together", f"{sum(road.seconds.values()):.1f}"]], "Wall time."
    )
