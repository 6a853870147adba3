"""The sections about the pipeline: 3-D scene, points (Fig. 3), surfaces (Table I, Figs. 4-6), arenas."""

import numpy as np

import symbrion_gym as sg
from evolution._src.experiments.paper.arenas import load_arena, load_surface
from evolution._src.experiments.paper.cloud import find_removed
from evolution._src.experiments.paper.page import tables
from evolution._src.experiments.paper.page.context import PaperContext
from evolution._src.report.figures import draw_cloud, draw_pieces, draw_section, draw_surface
from evolution._src.report.scene import Scene

MARGIN = 0.35
"""Raw readings are shown up to this distance around the arena [m]."""


def add_scene(context: PaperContext) -> None:
    """Add the interactive scene: points, surface, pieces, true surface, and the path of the champion."""
    arena = load_arena(context.folder, "gsrm")
    positions = context.load_positions("champion")
    scene = Scene()
    scene.add_points("points", context.points, is_shown=False)
    scene.add_surface("surface (GSRM)", arena.surface, "#b9cbe0")
    scene.add_pieces("contact pieces", arena.pieces, is_shown=False)
    scene.add_surface("true surface", context.truth, "#e6dcc8", is_shown=False)
    scene.add_path("champion's path", positions)
    context.page.add_section(
        "From points to arena, in 3-D",
        "Drag to turn, pinch or scroll to zoom; the switches show and hide layers.",
    )
    caption = (
        f"The pre-processed points ({len(context.points):,}, not all of them drawn), the surface that the GSRM learned "
        f"from them, its {len(arena.pieces)} convex pieces for contact, the true surface, and the champion at nine "
        "times on its way through the true pit."
    )
    context.page.add_scene(scene, context.sign(caption))


def add_cloud(context: PaperContext) -> None:
    """Add Fig. 3, and the table of the pre-processing steps."""
    removed, raw = find_removed(context.log), context.log.points()
    bounds = np.asarray(context.truth.bounds) + np.array([[-MARGIN] * 3, [MARGIN] * 3])
    context.page.add_section(
        "Fig. 3: the points",
        "The robot drives around the arena. Each scan is leveled, mixed pixels are removed, ranges are smoothed, and "
        "the points are cropped to the arena. A mixed pixel is a false reading at an edge, where the spot of the laser "
        "lies on two surfaces. Near one of the two it cannot be distinguished from a correct reading, so all readings "
        "next to a jump in range are removed, correct ones included; enough remain.",
    )
    caption = (
        "Fig. 3a. Raw readings around the arena, colored by height. Red: readings removed as mixed pixels."
    )
    mixed = context.records["cloud"]["figures"]["mixed"]
    if mixed:
        caption += (
            f" {mixed['mixed_removed']:,} of {mixed['mixed']:,} true mixed pixels are removed, and "
            f"{mixed['others_removed']:,} of {mixed['others']:,} correct readings."
        )
    figure = draw_cloud(raw, limit=60_000, marked=removed, bounds=bounds)
    context.add_figure("fig3a_raw", figure, caption)
    context.add_figure(
        "fig3b_cloud",
        draw_cloud(context.points, limit=60_000, bounds=bounds),
        "Fig. 3b. The points after pre-processing, thinned to 15 mm, seen from the same camera: "
        f"{len(context.points):,} points.",
    )
    context.add_figure(
        "fig3c_section",
        draw_section({"truth": context.truth}, points=context.points, marked=removed),
        "Fig. 3c. A slice of 6 cm along the course: pre-processed points (gray), readings removed as mixed pixels "
        "(red, at their raw places), and the true surface (blue).",
    )
    context.add_table(tables.tabulate_cloud(context.records["cloud"]))


def add_networks(context: PaperContext) -> None:
    """Add Table I and Figs. 4, 5 and 6, all seen from the same camera."""
    context.page.add_section(
        "Table I and Figs. 4, 5, 6: the surfaces",
        "Two self-organizing networks learn the points: the growing self-reconstruction map (GSRM), which can take any "
        "shape, and the growing grid (GG), which is one sheet. The hand-made model is what a person would draw after "
        "measuring the course with a ruler.",
    )
    context.add_table(tables.tabulate_networks(context.records["networks"]))
    texts = {"gsrm": "Fig. 4. The growing self-reconstruction map", "gg": "Fig. 5. The growing grid"}
    bounds = np.asarray(context.truth.bounds)
    for number, (method, text) in enumerate(texts.items(), start=4):
        pictures = {}
        for row in context.records["networks"]["figures"]:
            if row["method"] == method:
                label = f"{row['triangles']:,} triangles"
                label = f"{row['size']:,} units, {label}" if method == "gsrm" else label
                mesh = context.load_network(row["network"])
                pictures[label] = (f"fig{number}_{row['network']}", draw_surface(mesh, bounds=bounds))
        context.add_gallery(
            pictures, f"{text} at {'; '.join(pictures)}. Figs. 4 to 6 are seen from the same camera."
        )
    simple = sg.load_arena("simple").surface
    gsrm = load_surface(context.folder, "gsrm", context.config).mesh
    pictures = {
        f"hand-made, {len(simple.faces)} triangles": ("fig6_simple", draw_surface(simple, bounds=bounds)),
        f"GSRM, {len(gsrm.faces):,} triangles": ("fig6_gsrm", draw_surface(gsrm, bounds=bounds)),
    }
    context.add_gallery(
        pictures, "Fig. 6. The hand-made model, and the GSRM of the arena in which the robots evolve."
    )


def add_arenas(context: PaperContext) -> None:
    """Show the contact pieces, and the table of all arenas."""
    context.page.add_section(
        "Arenas",
        "A mesh collides in MuJoCo as its convex hull, which would fill the pit. So the surface is decomposed into "
        "convex pieces for contact; rays and images use the exact surface.",
    )
    arenas = {name: load_arena(context.folder, name) for name in ("gsrm", "gg")}
    pictures = {
        f"{tables.name_model(name)}: {len(arena.pieces)} pieces": (
            f"pieces_{name}",
            draw_pieces(arena.pieces),
        )
        for name, arena in arenas.items()
    }
    context.add_gallery(pictures, "The convex pieces for contact, each in its own color.")
    gsrm = arenas["gsrm"]
    context.add_figure(
        "section",
        draw_section({"truth": context.truth, "GSRM": gsrm.surface, "pieces": gsrm.pieces}, context.points),
        "Vertical section through the pit along the course: true surface, reconstructed surface, convex pieces, and "
        "nearby readings.",
    )
    context.add_table(tables.tabulate_arenas(context.records["arenas"]))
