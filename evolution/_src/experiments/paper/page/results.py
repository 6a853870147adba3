"""The sections about the results: physics (Table II), laser (Table III), robots (Fig. 7), and beyond the paper."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from evolution._src.experiments.paper.benchmark import load_benchmark
from evolution._src.experiments.paper.page import tables
from evolution._src.experiments.paper.page.context import PaperContext
from evolution._src.experiments.paper.page.figures import draw_costs, draw_scan_growth
from evolution._src.report.figures import draw_learning_curve, draw_section, draw_tracks
from evolution._src.report.provenance import describe_selection

ROBOTS = {
    "insufficient": "Fig. 7a. An insufficiently evolved robot, from the first generation",
    "short": "Fig. 7b. The controller of the champion in a body that is too short",
    "champion": "Fig. 7c. The sufficiently evolved champion",
}


def add_physics(context: PaperContext) -> None:
    """Add Table II."""
    record = context.records["physics"]
    ratios = record["figures"]["ratios"]
    steps = {name: tables.format_ratio(pair["physics_us"]) for name, pair in ratios.items()}
    collision = tables.format_ratio(ratios["gg"]["collision_us"])
    context.page.add_section(
        "Table II: the physics",
        "The paper found that the number of triangles does not matter for the physics. Here every mesh is first "
        "decomposed into a few convex pieces. Relative to the hand-made model, a physics step then takes "
        f"{steps['gg']} times as long with the growing grid (mean and 95 % bootstrap interval; its collision detection "
        f"{collision} times) and {steps['gsrm']} times with the GSRM. If every triangle is kept for contact, as a "
        f"prism, the number does matter: {steps['prisms']} times. The hand-made model as exact boxes takes "
        f"{steps['boxes']} times as long as its convex pieces.",
    )
    context.add_figure(
        "table2_costs",
        draw_costs(record["figures"]["rows"]),
        "Time of a physics step in each arena, and of the collision detection within it: mean and standard deviation "
        "over the runs.",
    )
    context.add_table(tables.tabulate_physics(record))


def add_laser(context: PaperContext) -> None:
    """Add Table III."""
    record = context.records["laser"]
    ratios = {method: pair["gg"] for method, pair in record["figures"]["ratios"].items()}
    powers = record["figures"]["powers"]
    context.page.add_section(
        "Table III: one laser scan",
        "The paper found that large meshes are not suited for the simulation of sensors: scanning the growing grid "
        "took 66 times as long as scanning the hand-made model. If every triangle is tested with every beam, the time "
        f"grows with the number of triangles: {tables.format_ratio(ratios['brute force'])} times here (power law with "
        f"exponent {powers['brute force']:.2f}). A tree of bounding volumes over the same triangles removes this cost: "
        f"{tables.format_ratio(ratios['tree'])} times (exponent {powers['tree']:.2f}), as a beam then meets only a few "
        "boxes and triangles. So there is no need to scan the contact shapes instead, which differ from the surface.",
    )
    context.add_figure(
        "table3_growth",
        draw_scan_growth(record["figures"]["rows"]),
        "Median time of one scan over the number of triangles; both axes are logarithmic.",
    )
    context.add_table(tables.tabulate_laser(record))


def add_robots(context: PaperContext) -> None:
    """Add Fig. 7, the learning curve and the genotype of the champion."""
    record = context.records["evolution"]
    figures, films = record["figures"], context.records["films"]["figures"]
    champion = figures["champion"]
    context.page.add_section(
        "Fig. 7: the robots",
        f"CMA-ES with {champion['modules']} modules in the GSRM arena: {figures['genotypes']} genotypes in "
        f"{figures['generations']} generations. "
        f"{describe_selection(champion['successes'], champion['trials'])}",
    )
    for name, text in ROBOTS.items():
        _add_film(context, name, text, films[name])
    curves = (np.array(figures[key]) for key in ("evaluations", "best", "median"))
    context.add_figure(
        "learning_curve",
        draw_learning_curve(*curves),
        "Fitness over the number of genotypes: progress of the whole body [m], plus 1 for a success, minus effort.",
    )
    context.page.add_table(
        ["gene", *champion["names"]],
        [["value", *(f"{gene:.3f}" for gene in champion["genotype"])]],
        tables.sign(f"Genotype of the champion, controller {champion['controller']}; one run.", record),
    )


def _add_film(context: PaperContext, name: str, text: str, film: Mapping[str, Any]) -> None:
    folder, moments = context.folder / "films", film["moments"]
    end = (
        f"crosses in {film['seconds']:.0f} s"
        if film["success"]
        else f"does not cross; the trial ends after {film['seconds']:.0f} s"
    )
    caption = f"{text} ({film['modules']} modules) in the true arena, from the floor. It {end}."
    if moments:
        pictures = {
            f"after {moment:.0f} s": (folder / f"{name}_{index + 1}.png").read_bytes()
            for index, moment in enumerate(moments)
        }
        context.page.add_gallery(pictures, context.sign(caption))
        film_file = (folder / f"{name}.mp4").read_bytes()
        context.page.add_video(film_file, context.sign(f"{text}; at five times real time."))
    else:
        caption += " There is no video: this machine has no OpenGL."
    positions = context.load_positions(name)
    moments_text = (
        "Side view of the same trial: the body at seven times, from violet (early) to yellow (late)."
    )
    context.add_figure(
        f"fig7_{name}",
        draw_tracks(positions, context.truth),
        moments_text if moments else f"{caption} {moments_text}",
    )


def add_models(context: PaperContext) -> None:
    """Add success in the true arena by training model and resolution, and coarse to fine."""
    page = context.page
    page.add_section(
        "Beyond the paper: does the training model matter for success in the true arena?",
        "Champions that evolved in different models, all judged in the true arena.",
    )
    if "resolutions" in context.records:
        context.add_table(tables.tabulate_resolutions(context.records["resolutions"]))
    else:
        page.add_text(
            "Not measured here: the reduced run (--quick) skips the evolution in the arena of every resolution."
        )
    benchmark = load_benchmark()
    context.add_table(tables.tabulate_models(benchmark))
    context.add_table(tables.tabulate_stages(benchmark))


def add_widened(context: PaperContext) -> None:
    """Add the refined surface, and the champions from before and after the change."""
    record = context.records["widened"]
    old, new = record["figures"]["pit"]
    context.page.add_section(
        "Beyond the paper: the pit is widened",
        f"The robot first surveys an arena with a pit of {100 * old:.0f} cm. Then both walls move, the pit becomes "
        f"{100 * (new - old):.0f} cm wider, and everything else stays. The robot scans again, and the same network "
        "continues to learn, instead of a new one being made. A champion evolves in the surface before and after; each "
        "is judged in both true arenas.",
    )
    meshes = {
        "widened true surface": context.truth,
        "GSRM before": context.load_network("narrow"),
        "GSRM refined": context.load_network("refined"),
    }
    context.add_figure(
        "widened_section",
        draw_section(meshes, context.points),
        "Vertical section through the pit along the course: the widened true surface, the network before and after it "
        "learned from the second survey, and the readings of that survey.",
    )
    context.add_table(tables.tabulate_widened(record))
    context.add_table(tables.tabulate_widened_champions(record))
