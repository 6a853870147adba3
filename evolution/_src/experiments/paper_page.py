"""The page of the paper's experiments: its figures, and what `paper.html.j2` needs to show every measurement."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import reconstruction as rc
import symbrion_gym as sg
from evolution._src.errors import RunError
from evolution._src.experiments.paper import (
    ARENA_NETWORKS,
    CLOUD,
    LOG,
    find_removed,
    load_arena,
    load_network,
)
from evolution._src.report.figures import (
    draw_cloud,
    draw_learning_curve,
    draw_pieces,
    draw_section,
    draw_surface,
    draw_tracks,
    to_png,
)
from evolution._src.report.page import inline_picture, inline_video, make_templates, write_page
from evolution._src.report.scene import Scene
from reconstruction._src.base.atomic_write import write_file
from reconstruction._src.base.bounded_read import UnreadableFileError, read_npz

SUMMARY = """The experiments of the SYMBRION paper of 2011 on this machine, each next to the figures of the paper. Laser
scans are turned into surfaces, the surfaces into arenas; a snake of docked robots evolves in one of them and is judged
in the true arena, which evolution never saw."""
PAPER_SCANS = {"gg": (13860, 362_000, 66), "gsrm": (4175, 119_000, 22), "simple": (39, 5450, 1)}
"""Table III of the paper: model -> triangles, time of one laser scan [µs], and relative to the hand-made model."""
AROUND = 0.35  # Raw readings are shown up to this distance around the arena [m]
MODELS = {"gsrm": "GSRM", "gg": "GG", "simple": "hand-made"}
METHODS = {"tree": "MuJoCo (bounding-volume tree)", "brute force": "brute force (every triangle)"}
"""Methods of ray casting by their names in the results."""


def write_paper_page(folder: Path, is_quick: bool, seed: int, results: Mapping[str, Any]) -> None:
    """Write `report.html`, and its figures as files, into the folder of the experiments."""
    figures = {name: result["figures"] for name, result in results.items()}
    command = f"symbrion paper{' --quick' if is_quick else ''} --seed {seed}"
    truth, points = sg.load_arena("truth").surface, rc.load_points(folder / CLOUD)
    arenas = {name: load_arena(folder, name) for name in ("gsrm", "gg")}
    drawn = _draw_figures(folder, figures, arenas, points)
    for name, figure in drawn.items():
        write_file(folder / "figures" / f"{name}.png", to_png(figure))

    scene, films = Scene(), folder / "films"
    scene.add_points("points", points, is_shown=False)
    scene.add_surface("surface (GSRM)", arenas["gsrm"].surface, "#b9cbe0")
    scene.add_pieces("contact pieces", arenas["gsrm"].pieces, is_shown=False)
    scene.add_surface("true surface", truth, "#e6dcc8", is_shown=False)
    scene.add_path("champion's path", _load_positions(folder, "champion"))

    def read_picture(name: str) -> dict[str, Any]:
        return inline_picture((folder / "figures" / f"{name}.png").read_bytes())

    def read_moments(name: str) -> list[dict[str, Any]]:
        return [
            inline_picture((films / f"{name}_{index + 1}.png").read_bytes())
            | {"label": f"after {moment:.0f} s"}
            for index, moment in enumerate(figures["films"][name]["moments"])
        ]

    networks = {row["network"]: row for row in figures["networks"]}
    labels = {name: f"{row['triangles']:,} triangles" for name, row in networks.items()}
    champion = figures["evolution"]["champion"]
    templates = make_templates(Path(__file__).parent)
    templates.filters |= {
        "mm": lambda meters, digits=2: "-" if meters is None else f"{1000 * meters:.{digits}f}",
        "cost": lambda cost, digits=1: f"{cost['mean']:,.{digits}f} ± {cost['deviation']:,.{digits}f}",
        "ratio": lambda ratio: f"{ratio['ratio']:.2f} ({ratio['low']:.2f} to {ratio['high']:.2f})",
        "network": name_network,
    }
    context = {
        "title": "Bringing reality into evolution: the experiments repeated",
        "summary": SUMMARY,
        "footer": f"{command} · {results['cloud']['machine']} · tables, figures and videos are also files in the "
        "folder of this page: results.json, figures, films",
        "command": command,
        "results": results,
        "figures": figures,
        "scene": scene,
        "num_points": len(points),
        "num_pieces": {name: len(arena.pieces) for name, arena in arenas.items()},
        "names": {
            "fig4": {f"fig4_{name}": label for name, label in labels.items() if name.startswith("gsrm")},
            "fig5": {f"fig5_{name}": label for name, label in labels.items() if name.startswith("gg")},
            "fig6": {
                "fig6_hand-made": f"hand-made, {labels['simple']}",
                "fig6_gsrm": f"GSRM, {labels[ARENA_NETWORKS['gsrm']]}",
            },
            "pieces": {
                f"pieces_{name}": f"{MODELS[name]}: {len(arena.pieces)} pieces"
                for name, arena in arenas.items()
            },
        },
        "picture": read_picture,
        "pictures": lambda names: [read_picture(name) | {"label": label} for name, label in names.items()],
        "moments": read_moments,
        "video": lambda name: inline_video((films / f"{name}.mp4").read_bytes()),
        "methods": METHODS,
        "paper_scans": PAPER_SCANS,
        "selection": _describe_selection(champion["successes"], champion["trials"]),
    }
    write_page(folder / "report.html", templates.get_template("paper.html.j2"), context, has_scene=True)


def _draw_figures(
    folder: Path, figures: Mapping[str, Any], arenas: Mapping[str, sg.Arena], points: np.ndarray
) -> dict[str, Figure]:
    truth, log = sg.load_arena("truth").surface, rc.load_scan_log(folder / LOG)
    removed, bounds = find_removed(log), np.asarray(truth.bounds)
    wide = bounds + np.array([[-AROUND] * 3, [AROUND] * 3])
    history = (np.array(figures["evolution"][key]) for key in ("evaluations", "best", "median"))
    drawn = {
        "fig3a_raw": draw_cloud(log.points(), limit=60_000, marked=removed, bounds=wide),
        "fig3b_cloud": draw_cloud(points, limit=60_000, bounds=wide),
        "fig3c_section": draw_section({"truth": truth}, points=points, marked=removed),
        "fig6_hand-made": draw_surface(sg.load_arena("simple").surface, bounds=bounds),
        "section": draw_section(
            {"truth": truth, "GSRM": arenas["gsrm"].surface, "pieces": arenas["gsrm"].pieces}, points
        ),
        "learning_curve": draw_learning_curve(*history),
    }
    for name in (row["network"] for row in figures["networks"] if row["network"] != "simple"):
        number = 4 if name.startswith("gsrm") else 5
        drawn[f"fig{number}_{name}"] = draw_surface(load_network(folder, name).mesh, bounds=bounds)
    drawn["fig6_gsrm"] = drawn[f"fig4_{ARENA_NETWORKS['gsrm']}"]
    drawn |= {f"pieces_{name}": draw_pieces(arena.pieces) for name, arena in arenas.items()}
    return drawn | {
        f"fig7_{name}": draw_tracks(_load_positions(folder, name), truth) for name in figures["films"]
    }


def _load_positions(folder: Path, film: str) -> np.ndarray:
    path = folder / "films" / f"{film}.npz"
    try:
        return read_npz(path, ("positions",))["positions"]
    except UnreadableFileError as error:
        raise RunError(f"{path}: {error}; remove {folder} and repeat `symbrion paper`") from error


def name_network(name: str) -> str:
    """Return the name of a network in a table: "gsrm_2200" -> "GSRM 2,200 units"."""
    method, _, size = name.partition("_")
    return MODELS[method] + (f" {int(size):,} {'units' if method == 'gsrm' else 'triangles'}" if size else "")


def _describe_selection(successes: int, trials: int) -> str:
    """Return a sentence on how a champion was selected, from its fresh trials in the arena of its run."""
    if not trials:
        return "No genotype crossed in all of its trials; the champion is the fittest one."
    return (
        f"The champion was selected by fresh randomized trials there; it crossed in {successes} of {trials}."
    )
