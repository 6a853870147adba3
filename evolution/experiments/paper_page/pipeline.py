"""The sections of the road: 3-D scene, cloud (Fig. 3), surfaces (Table I, Figs. 4-6), arenas."""

import numpy as np

import symbrion_gym as sg
from evolution.experiments.paper.arenas import load_arena, load_surface
from evolution.experiments.paper.cloud import find_removed
from evolution.experiments.paper_page import tables
from evolution.experiments.paper_page.context import PaperContext
from evolution.report.figures import draw_cloud, draw_pieces, draw_section, draw_surface
from evolution.report.scene import Scene

MARGIN = 0.35
"""How far around the arena the raw readings are shown [m]."""


def add_scene(context: PaperContext) -> None:
    """Add the interactive scene: cloud, surface, pieces, truth, and the champion's path."""
    arena = load_arena(context.folder, "gsrm")
    positions = context.load_positions("champion")
    scene = Scene()
    scene.add_points("cloud", context.points, is_shown=False)
    scene.add_surface("surface (GSRM)", arena.surface, "#b9cbe0")
    scene.add_pieces("contact pieces", arena.pieces, is_shown=False)
    scene.add_surface("true surface", context.truth, "#e6dcc8", is_shown=False)
    scene.add_path("champion's path", positions)
    context.page.add_section(
        "The road in 3-D", "Drag to turn, pinch or scroll to zoom; the switches show and hide."
    )
    caption = (
        f"The cloud ({len(context.points):,} points, thinned here), the surface that the GSRM made of it, the "
        f"{len(arena.pieces)} convex pieces that robots touch, the true surface, and the champion at nine moments on "
        "its way through the true pit."
    )
    context.page.add_scene(scene, context.sign(caption))


def add_cloud(context: PaperContext) -> None:
    """Add Fig. 3, and the figures for each step of the pre-processing."""
    removed, raw = find_removed(context.log), context.log.points()
    bounds = np.asarray(context.truth.bounds) + np.array([[-MARGIN] * 3, [MARGIN] * 3])
    context.page.add_section(
        "Fig. 3: the cloud",
        "The robot drives around the arena; each scan is levelled, freed of readings that mix two surfaces, smoothed, "
        "and cut to the arena. A mixed reading that lies near one of its two surfaces cannot be told from a good one, "
        "so all readings beside a jump are in doubt and go: many good ones with the bad, and enough remain.",
    )
    caption = (
        "Fig. 3a. Raw readings around the arena, coloured by height; red: readings removed as mixed pixels."
    )
    mixed = context.records["cloud"]["figures"]["mixed"]
    if mixed:
        caption += (
            f" Of {mixed['mixed']:,} beams that really mixed two surfaces {mixed['mixed_removed']:,} are found; "
            f"{mixed['others_removed']:,} of {mixed['others']:,} others go with them."
        )
    figure = draw_cloud(raw, limit=60_000, marked=removed, bounds=bounds)
    context.add_figure("fig3a_raw", figure, caption)
    context.add_figure(
        "fig3b_cloud",
        draw_cloud(context.points, limit=60_000, bounds=bounds),
        "Fig. 3b. The same after the pre-processing, seen by the same camera, thinned to 15 mm: "
        f"{len(context.points):,} points.",
    )
    context.add_figure(
        "fig3c_section",
        draw_section({"truth": context.truth}, points=context.points, marked=removed),
        "Fig. 3c. A slice of 6 cm along the course: the pre-processed cloud (grey), what was removed as mixed (red, as "
        "it was read), and the true surface (blue).",
    )
    context.add_table(tables.tabulate_cloud(context.records["cloud"]))


def add_networks(context: PaperContext) -> None:
    """Add Table I and Figs. 4, 5 and 6, all seen by the same camera."""
    context.page.add_section(
        "Table I and Figs. 4, 5, 6: the surfaces",
        "Two self-organising networks learn the cloud: the growing self-reconstruction map (GSRM), which takes any "
        "shape, and the growing grid (GG), one sheet. The hand-made model is what a person draws who measures the "
        "course with a ruler.",
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
        context.add_gallery(pictures, f"{text} at {'; '.join(pictures)}. Figs. 4 to 6: the same camera.")
    simple = sg.load_arena("simple").surface
    known = load_surface(context.folder, "gsrm", context.config).mesh
    pictures = {
        f"hand-made, {len(simple.faces)} triangles": ("fig6_simple", draw_surface(simple, bounds=bounds)),
        f"GSRM, {len(known.faces):,} triangles": ("fig6_gsrm", draw_surface(known, bounds=bounds)),
    }
    context.add_gallery(
        pictures, "Fig. 6. The hand-made model, beside the GSRM of the arena that robots evolve in."
    )


def add_arenas(context: PaperContext) -> None:
    """Show the contact pieces, and what the arenas of the tables are made of."""
    context.page.add_section(
        "Arenas",
        "A mesh collides in MuJoCo as its convex hull, which would fill the pit. So the surface is cut into convex "
        "pieces for contact, and kept exactly for rays and pictures.",
    )
    arenas = {name: load_arena(context.folder, name) for name in ("gsrm", "gg")}
    pictures = {
        f"{tables.name_model(name)}: {len(arena.pieces)} pieces": (
            f"pieces_{name}",
            draw_pieces(arena.pieces),
        )
        for name, arena in arenas.items()
    }
    context.add_gallery(pictures, "The convex pieces that robots touch, each in a colour of its own.")
    gsrm = arenas["gsrm"]
    context.add_figure(
        "section",
        draw_section({"truth": context.truth, "GSRM": gsrm.surface, "pieces": gsrm.pieces}, context.points),
        "Cut through the pit along the course: true surface, reconstruction, convex pieces, and readings nearby.",
    )
    context.add_table(tables.tabulate_arenas(context.records["arenas"]))
