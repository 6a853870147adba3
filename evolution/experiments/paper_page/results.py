"""The sections of the results: physics (Table II), laser (Table III), robots (Fig. 7), and beyond the paper."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from evolution.experiments.paper.benchmark import find_benchmark
from evolution.experiments.paper_page import tables
from evolution.experiments.paper_page.context import PaperContext
from evolution.experiments.paper_page.figures import draw_costs, draw_scan_growth
from evolution.report.figures import draw_learning_curve, draw_section, draw_tracks

ROBOTS = {
    "insufficient": "Fig. 7a. An insufficiently evolved robot, from the first generation",
    "short": "Fig. 7b. The champion's law in a body that is too short",
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
        "The paper found that triangles do not matter for the physics. Here every mesh becomes a few convex pieces "
        f"first, and the growing grid's step takes {steps['gg']} times the hand-made model's (mean and 95 % bootstrap "
        f"interval; its collision detection {collision} times), the GSRM's {steps['gsrm']} times. Where triangles are "
        f"kept for contact, one prism each, they do matter: {steps['prisms']} times. As exact boxes the hand-made "
        f"model itself takes {steps['boxes']} times.",
    )
    context.add_figure(
        "table2_costs",
        draw_costs(record["figures"]["rows"]),
        "A physics step in each arena, and the collision detection in it: means, with the deviations over the runs.",
    )
    context.add_table(tables.tabulate_physics(record))


def add_laser(context: PaperContext) -> None:
    """Add Table III."""
    record = context.records["laser"]
    ratios = {method: pair["gg"] for method, pair in record["figures"]["ratios"].items()}
    powers = record["figures"]["powers"]
    context.page.add_section(
        "Table III: one laser scan",
        "The paper found that large meshes do not suit the simulation of sensors: its scan of the growing grid took 66 "
        "times as long as that of the hand-made model. A scan that tries every triangle grows with them: "
        f"{tables.format_ratio(ratios['brute force'])} times here, with the power {powers['brute force']:.2f} of their "
        "number. What removes the cost is a tree of bounding volumes over the same triangles: "
        f"{tables.format_ratio(ratios['tree'])} times, power {powers['tree']:.2f}; a beam then meets a few boxes and a "
        "handful of triangles, however many there are. Contact shapes need not be scanned, and are not where the "
        "surface is.",
    )
    context.add_figure(
        "table3_growth",
        draw_scan_growth(record["figures"]["rows"]),
        "The median time of one scan over the number of triangles; both axes logarithmic.",
    )
    context.add_table(tables.tabulate_laser(record))


def add_robots(context: PaperContext) -> None:
    """Add Fig. 7, the learning curve and the champion's genes."""
    record = context.records["evolution"]
    figures, films = record["figures"], context.records["films"]["figures"]
    champion = figures["champion"]
    context.page.add_section(
        "Fig. 7: the robots",
        f"CMA-ES with {champion['modules']} modules in the GSRM arena: {figures['genotypes']} genotypes in "
        f"{figures['generations']} generations. The champion was chosen by fresh randomised trials there: "
        f"{champion['successes']} of {champion['trials']} held.",
    )
    for name, text in ROBOTS.items():
        _add_film(context, name, text, films[name])
    curves = (np.array(figures[key]) for key in ("evaluations", "best", "median"))
    context.add_figure(
        "learning_curve",
        draw_learning_curve(*curves),
        "Fitness over genotypes tried: progress of the whole body [m], plus 1 for a success, less effort.",
    )
    context.page.add_table(
        ["gene", *champion["names"]],
        [["value", *(f"{gene:.3f}" for gene in champion["genotype"])]],
        tables.sign(f"The champion: a {champion['controller']} law; 1 run.", record),
    )


def _add_film(context: PaperContext, name: str, text: str, film: Mapping[str, Any]) -> None:
    folder, moments = context.folder / "films", film["moments"]
    end = (
        f"crosses in {film['seconds']:.0f} s"
        if film["success"]
        else f"does not cross, and is given up after {film['seconds']:.0f} s"
    )
    told = f"{text} ({film['modules']} modules) in the true arena, from the floor. It {end}."
    if moments:
        pictures = {
            f"after {moment:.0f} s": (folder / f"{name}_{index + 1}.png").read_bytes()
            for index, moment in enumerate(moments)
        }
        context.page.add_gallery(pictures, context.sign(told))
        film_file = (folder / f"{name}.mp4").read_bytes()
        context.page.add_video(film_file, context.sign(f"{text}; five times faster than real."))
    else:
        told += " There is no video: this machine has no OpenGL."
    positions = context.load_positions(name)
    moments_text = (
        "Side view of the same trial: the body at seven moments, from violet (early) to yellow (late)."
    )
    context.add_figure(
        f"fig7_{name}",
        draw_tracks(positions, context.truth),
        moments_text if moments else f"{told} {moments_text}",
    )


def add_models(context: PaperContext) -> None:
    """Add truth success by training model and resolution, and coarse to fine."""
    page = context.page
    page.add_section(
        "Beyond the paper: does the model matter for the truth?",
        "Champions evolved in different models, all judged in the true arena.",
    )
    if "resolutions" in context.records:
        context.add_table(tables.tabulate_resolutions(context.records["resolutions"]))
    else:
        page.add_text(
            "Not measured here: one evolution for every resolution on this machine, which the full run does."
        )
    benchmark = find_benchmark()
    context.add_table(tables.tabulate_models(benchmark))
    context.add_table(tables.tabulate_stages(benchmark))


def add_widened(context: PaperContext) -> None:
    """Add the refined surface, and the champions before and after."""
    record = context.records["widened"]
    old, new = record["figures"]["pit"]
    context.page.add_section(
        "Beyond the paper: the pit is widened",
        f"The robot first knows the arena with a pit of {100 * old:.0f} cm. Then both walls move, "
        f"{100 * (new - old):.0f} cm apart, and all else stays; the robot scans again, and the same network goes on "
        "learning, instead of a new one from the beginning. In either surface a champion evolves; each is tried in "
        "both true arenas.",
    )
    meshes = {
        "widened truth": context.truth,
        "GSRM before": context.load_network("narrow"),
        "GSRM refined": context.load_network("refined"),
    }
    context.add_figure(
        "widened_section",
        draw_section(meshes, context.points),
        "Cut through the pit along the course: the widened truth, the network before and after it has learnt from the "
        "second scan, and the readings of that scan.",
    )
    context.add_table(tables.tabulate_widened(record))
    context.add_table(tables.tabulate_widened_champions(record))
