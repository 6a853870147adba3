"""The page of the paper's experiments: every measurement next to the figure that the paper reports."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
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
from evolution._src.report.body_page import describe_selection
from evolution._src.report.figures import (
    CHART_DPI,
    CHART_WIDTH,
    INK_COLOR,
    PALETTE,
    draw_cloud,
    draw_learning_curve,
    draw_pieces,
    draw_section,
    draw_surface,
    draw_tracks,
    style_axes,
    to_png,
    to_svg,
)
from evolution._src.report.page import Page
from evolution._src.report.scene import Scene
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.bounded_read import UnreadableFileError, read_npz

# Figures of the paper (SYMBRION, 2011).
PAPER_NETWORKS = {"gsrm_2200": (4175, 20.0), "gg_13860": (13860, 270.0), "simple": (39, None)}
"""Table I: model -> triangles and computing time [s]; None for the hand-made model."""
PAPER_PHYSICS = ("147-152", "825-846")
"""Table II: physics step and collision detection [µs], the same for GG, GSRM and the hand-made model."""
PAPER_SCANS = {"gg": (13860, 362_000, 66), "gsrm": (4175, 119_000, 22), "simple": (39, 5450, 1)}
"""Table III: model -> triangles, time of one laser scan [µs], and relative to the hand-made model."""

MAX_PHYSICS_RATIO, MAX_LASER_RATIO = 1.3, 1.5
"""Largest ratios of the growing grid to the hand-made model that count as a success; set before measuring."""
SUCCESS_THRESHOLD = 0.9
"""Share of the trials in the true arena from which a champion counts as a success: 18 of 20."""
AROUND = 0.35  # Raw readings are shown up to this distance around the arena [m]
ABSENT = "-"
MODELS = {"gsrm": "GSRM", "gg": "GG", "simple": "hand-made"}
METHODS = {
    "tree": ("MuJoCo (bounding-volume tree)", "o-", PALETTE[0]),
    "embree": ("Embree (bounding-volume tree)", "s-", PALETTE[2]),
    "brute force": ("brute force (every triangle)", "^-", PALETTE[1]),
}
"""Method of ray casting -> name, marker and color."""
ROBOTS = {
    "insufficient": "Fig. 7a. An insufficiently evolved robot, from the first generation",
    "short": "Fig. 7b. The controller of the champion in a body that is too short",
    "champion": "Fig. 7c. The sufficiently evolved champion",
}
DIFFERENCES = (
    "The arena is ours. That of the paper is known from pictures only; the sizes (pit of 0.45 m) and friction (0.7) "
    "were found by trial, such that a body without control fails and an evolved one can cross.",
    "The survey is simulated: a virtual robot with two SICK LMS 200, whose noise, mixed pixels, shaking and "
    "localization errors follow measurements of real ones. No public copy of the paper's scans exists.",
    "The physics engine is MuJoCo instead of ODE. MuJoCo collides a mesh as its convex hull, so contact is with convex "
    'pieces of the surface, not with its triangles; rays meet the exact triangles. Only the arena "GSRM, one prism per '
    'triangle" of Table II has contact with every triangle.',
    "Table II: a step is 5 ms of simulated time. Our time of a step includes its collision detection. In the paper "
    "collision detection takes longer than the physics step, so the paper reports the two separately.",
    "Table II: 3,500 steps are 17.5 s, in which the body moves 1.75 m at most. So a run is timed from the moment the "
    "head is above the pit, and continues without timing until the body is across.",
    "Table III: we placed the scanner along the course. The arena contains no robot, which would take the same time in "
    "every model and so bring the ratio closer to 1. Processor time is measured. Brute force is written in NumPy, not "
    "in the paper's simulator.",
    "Tracks are spheres whose surface moves, not wheels on joints. Hinge torque (4.5 N m), hinge speed (0.8 rad/s) and "
    "track speed (0.1 m/s) are estimates, not measurements of the Scout robot.",
    "The networks learn in batches, with a final fit to the samples, not signal by signal. The original rules are "
    'available as mode="paper", and are slow.',
    "The computers differ: the paper's times are of 2011. Ratios can be compared, absolute times cannot.",
)


class PaperPage:
    """The results of the experiments, and the page about them.

    Attributes:
        folder: of the experiments; figures are also written to its subfolder `figures`.
        results: experiment -> what `run_experiments` returns.
        page: the sections are added to it.
    """

    def __init__(self, folder: Path, is_quick: bool, seed: int, results: Mapping[str, Any]) -> None:
        self.folder, self.results = folder, results
        self.command = f"symbrion paper{' --quick' if is_quick else ''} --seed {seed}"
        self.page = Page(
            "Bringing reality into evolution: the experiments repeated",
            summary="The experiments of the SYMBRION paper of 2011 on this machine, each next to the figures of the "
            "paper. Laser scans are turned into surfaces, the surfaces into arenas; a snake of docked robots evolves "
            "in one of them and is judged in the true arena, which evolution never saw.",
            footer=f"{self.command} · {results['cloud']['machine']} · tables, figures and videos are also files in the "
            "folder of this page: results.json, figures, films",
        )
        self._truth = sg.load_arena("truth").surface
        self._points: Float[np.ndarray, "N 3"] = rc.load_points(folder / CLOUD)

    def write(self, path: Path) -> None:
        """Write the page as one self-contained HTML file."""
        self._add_verdicts()
        self.page.add_contents()
        self._add_scene()
        self._add_cloud()
        self._add_networks()
        self._add_arenas()
        self._add_physics()
        self._add_laser()
        self._add_robots()
        self.page.add_section("What differs from the paper")
        self.page.add_list(DIFFERENCES)
        self._add_times()
        self.page.write(path)

    def _figures(self, name: str) -> Any:
        return self.results[name]["figures"]

    def _add_figure(self, name: str, figure: Figure, caption: str) -> None:
        self.page.add_figure(self._save(name, figure), f"{caption} {self.command}.")

    def _add_gallery(self, pictures: Mapping[str, tuple[str, Figure]], caption: str) -> None:
        shown = {label: self._save(name, figure) for label, (name, figure) in pictures.items()}
        self.page.add_gallery(shown, f"{caption} {self.command}.")

    def _add_table(
        self, name: str, columns: Sequence[str], rows: Sequence[Sequence[object]], caption: str
    ) -> None:
        result = self.results[name]
        self.page.add_table(columns, rows, f"{caption} Measured on {result['machine']}; {result['date']}.")

    def _save(self, name: str, figure: Figure) -> bytes:
        """Save a figure as PNG and SVG; return the PNG."""
        (self.folder / "figures").mkdir(exist_ok=True)
        png = to_png(figure)
        for ending, content in (("png", png), ("svg", to_svg(figure))):
            with write_atomically(self.folder / "figures" / f"{name}.{ending}") as beside:
                beside.write_bytes(content)
        return png

    def _load_positions(self, film: str) -> Float[np.ndarray, "ticks modules 3"]:
        path = self.folder / "films" / f"{film}.npz"
        try:
            return read_npz(path, ("positions",))["positions"]
        except UnreadableFileError as error:
            raise RunError(f"{path}: {error}; remove {self.folder} and repeat `symbrion paper`") from error

    def _add_verdicts(self) -> None:
        judged = self._figures("evolution")["judged"]["truth"]
        self.page.add_verdict(
            f"The champion crosses the true pit in {judged['successes']} of {judged['trials']} randomized trials; it "
            "evolved on a surface that was reconstructed from the scans only.",
            good=judged["successes"] >= SUCCESS_THRESHOLD * judged["trials"],
        )
        for what, ratio, limit, paper in (
            ("physics step", self._figures("physics")["ratios"]["gg"]["physics_us"], MAX_PHYSICS_RATIO, 1),
            (
                "laser scan",
                self._figures("laser")["ratios"]["tree"]["gg"],
                MAX_LASER_RATIO,
                PAPER_SCANS["gg"][2],
            ),
        ):
            self.page.add_verdict(
                f"With the finest growing grid a {what} takes {format_ratio(ratio)} times as long as with the "
                f"hand-made model (ratio and 95 % interval; in the paper about {paper}; our target: at most {limit}).",
                good=ratio["ratio"] <= limit,
            )

    def _add_scene(self) -> None:
        arena = load_arena(self.folder, "gsrm")
        scene = Scene()
        scene.add_points("points", self._points, is_shown=False)
        scene.add_surface("surface (GSRM)", arena.surface, "#b9cbe0")
        scene.add_pieces("contact pieces", arena.pieces, is_shown=False)
        scene.add_surface("true surface", self._truth, "#e6dcc8", is_shown=False)
        scene.add_path("champion's path", self._load_positions("champion"))
        self.page.add_section(
            "From points to arena, in 3-D",
            "Drag to turn, pinch or scroll to zoom; the switches show and hide layers.",
        )
        self.page.add_scene(
            scene,
            f"The preprocessed points ({len(self._points):,}, not all of them drawn), the surface that the GSRM "
            f"learned from them, its {len(arena.pieces)} convex pieces for contact, the true surface, and the champion "
            "at nine times on its way through the true pit.",
        )

    def _add_cloud(self) -> None:
        figures, log = self._figures("cloud"), rc.load_scan_log(self.folder / LOG)
        removed, mixed = find_removed(log), figures["mixed"]
        bounds = np.asarray(self._truth.bounds) + np.array([[-AROUND] * 3, [AROUND] * 3])
        self.page.add_section(
            "Fig. 3: the points",
            "The robot drives around the arena. Each scan is leveled, mixed pixels are removed, ranges are smoothed, "
            "and the points are cropped to the arena. A mixed pixel is a false reading at an edge, where the spot of "
            "the laser lies on two surfaces. Near one of the two it cannot be distinguished from a correct reading, so "
            "all readings next to a jump in range are removed, correct ones included; enough remain.",
        )
        self._add_figure(
            "fig3a_raw",
            draw_cloud(log.points(), limit=60_000, marked=removed, bounds=bounds),
            "Fig. 3a. Raw readings around the arena, colored by height. Red: readings removed as mixed pixels. "
            f"{mixed['mixed_removed']:,} of {mixed['mixed']:,} true mixed pixels are removed, and "
            f"{mixed['others_removed']:,} of {mixed['others']:,} correct readings.",
        )
        self._add_figure(
            "fig3b_cloud",
            draw_cloud(self._points, limit=60_000, bounds=bounds),
            "Fig. 3b. The points after preprocessing, thinned to 15 mm, seen from the same camera: "
            f"{len(self._points):,} points.",
        )
        self._add_figure(
            "fig3c_section",
            draw_section({"truth": self._truth}, points=self._points, marked=removed),
            "Fig. 3c. A slice of 6 cm along the course: preprocessed points (gray), readings removed as mixed pixels "
            "(red, at their raw places), and the true surface (blue).",
        )
        self._add_table(
            "cloud",
            ["after step", "readings", "distance, mean [mm]", "distance, 95th percentile [mm]"],
            [
                [step["step"], f"{step['readings']:,}", format_mm(step["mean"], 1), format_mm(step["p95"], 1)]
                for step in figures["steps"]
            ],
            f"One survey: {figures['scans']:,} scans of {figures['beams']} beams. Distance of the readings within the "
            "bounding box of the arena from the true surface, after each step of preprocessing.",
        )

    def _add_networks(self) -> None:
        networks, rows = self._figures("networks"), []
        for row in networks:
            triangles, seconds = PAPER_NETWORKS.get(row["network"], (None, None))
            rows.append(
                [
                    name_network(row["network"]),
                    f"{row['triangles']:,}",
                    format_number(triangles, ",d"),
                    format_number(row["cold_seconds"], ".1f"),
                    format_number(row["warm_seconds"], ".2f"),
                    format_number(seconds, ".0f"),
                    *(
                        format_mm(row[name])
                        for name in ("truth_to_mesh", "truth_to_mesh_p95", "mesh_to_truth")
                    ),
                    row["boundary_loops"],
                ]
            )
        self.page.add_section(
            "Table I and Figs. 4, 5, 6: the surfaces",
            "Two self-organizing networks learn the points: the growing self-reconstruction map (GSRM), which can take "
            "any shape, and the growing grid (GG), which is one sheet. The hand-made model is what a person would draw "
            "after measuring the course with a ruler.",
        )
        self._add_table(
            "networks",
            ["network", "triangles", "triangles in the paper", "time of the first call [s]",
             "time of later calls [s]", "time in the paper [s]", "true surface to mesh, mean [mm]",
             "true surface to mesh, 95th percentile [mm]", "mesh to true surface, mean [mm]", "boundary loops"],
            rows,
            "Table I. All networks learn the same points. First call: in a process without compiled programs. Later "
            "calls: median of the next three. One boundary loop is the outer rim. The hand-made model is measured "
            "without its vertical sides, which no scan sees.",
        )  # fmt: skip
        bounds = np.asarray(self._truth.bounds)
        texts = {"gsrm": "Fig. 4. The growing self-reconstruction map", "gg": "Fig. 5. The growing grid"}
        for number, (method, text) in enumerate(texts.items(), start=4):
            pictures = {}
            for row in networks:
                if row["method"] == method:
                    mesh = load_network(self.folder, row["network"]).mesh
                    name = f"fig{number}_{row['network']}"
                    pictures[f"{row['triangles']:,} triangles"] = (name, draw_surface(mesh, bounds=bounds))
            self._add_gallery(pictures, f"{text} at {'; '.join(pictures)}, from one camera.")
        meshes = {
            "hand-made": sg.load_arena("simple").surface,
            "GSRM": load_network(self.folder, ARENA_NETWORKS["gsrm"]).mesh,
        }
        self._add_gallery(
            {
                f"{name}, {len(mesh.faces):,} triangles": (
                    f"fig6_{name.lower()}",
                    draw_surface(mesh, bounds=bounds),
                )
                for name, mesh in meshes.items()
            },
            "Fig. 6. The hand-made model, and the GSRM of the arena in which the robots evolve.",
        )

    def _add_arenas(self) -> None:
        self.page.add_section(
            "Arenas",
            "A mesh collides in MuJoCo as its convex hull, which would fill the pit. So the surface is decomposed into "
            "convex pieces for contact; rays and images use the exact surface.",
        )
        arenas = {name: load_arena(self.folder, name) for name in ("gsrm", "gg")}
        self._add_gallery(
            {
                f"{MODELS[name]}: {len(arena.pieces)} pieces": (f"pieces_{name}", draw_pieces(arena.pieces))
                for name, arena in arenas.items()
            },
            "The convex pieces for contact, each in its own color.",
        )
        gsrm = arenas["gsrm"]
        self._add_figure(
            "section",
            draw_section({"truth": self._truth, "GSRM": gsrm.surface, "pieces": gsrm.pieces}, self._points),
            "Vertical section through the pit along the course: true surface, reconstructed surface, convex pieces, "
            "and nearby readings.",
        )
        self._add_table(
            "arenas",
            ["arena", "surface and contact geometry", "triangles of the surface (for rays)", "contact pieces",
             "building time [s]", "contact to true surface, mean [mm]",
             "contact to true surface, 95th percentile [mm]"],
            [
                [row["arena"], row["text"], f"{row['triangles']:,}", row["pieces"] or ABSENT,
                 f"{row['seconds']:.1f}", format_mm(row["mean"]), format_mm(row["p95"])]
                for row in self._figures("arenas")
            ],
            "Each arena is built once. Distances of the contact geometry from the true surface.",
        )  # fmt: skip

    def _add_physics(self) -> None:
        figures = self._figures("physics")
        ratios = {name: format_ratio(pair["physics_us"]) for name, pair in figures["ratios"].items()}
        self.page.add_section(
            "Table II: the physics",
            "The paper found that the number of triangles does not matter for the physics. Here every mesh is first "
            "decomposed into a few convex pieces. Relative to the hand-made model, a physics step then takes "
            f"{ratios['gg']} times as long with the growing grid (mean and 95 % bootstrap interval) and "
            f"{ratios['gsrm']} times with the GSRM. If every triangle is kept for contact, as a prism, the number does "
            f"matter: {ratios['prisms']} times.",
        )
        self._add_figure(
            "table2_costs",
            draw_costs(figures["rows"]),
            "Time of a physics step in each arena, and of the collision detection within it: mean and standard "
            "deviation over the runs.",
        )
        rows = []
        for row in figures["rows"]:
            paper = PAPER_PHYSICS if row["arena"] in PAPER_SCANS else (ABSENT, ABSENT)
            costs = (format_cost(row[cost]) for cost in ("physics_us", "collision_us"))
            rows.append(
                [
                    row["text"],
                    f"{row['contacts']:.1f}",
                    *(text for pair in zip(costs, paper, strict=True) for text in pair),
                    ratios.get(row["arena"], "1"),
                    f"{row['crossed']} of {figures['runs']}",
                ]
            )
        self._add_table(
            "physics",
            ["arena", "contacts per step", "physics step [µs]", "physics step in the paper [µs]",
             "collision detection within it [µs]", "collision detection in the paper [µs]",
             "physics step, relative to the hand-made model's pieces (95 % interval)", "runs that crossed"],
            rows,
            f"Table II. Mean ± standard deviation over {figures['runs']} runs of 3,500 steps each, by MuJoCo's own "
            "timers, from the moment the head is above the pit; the arenas alternate. Control intervals (20 ms "
            f"simulated) in which other work had the processor are left out: {100 * figures['interrupted']:.1f} %.",
        )  # fmt: skip

    def _add_laser(self) -> None:
        figures = self._figures("laser")
        ratios = {method: format_ratio(pair["gg"]) for method, pair in figures["ratios"].items()}
        powers = figures["powers"]
        self.page.add_section(
            "Table III: one laser scan",
            "The paper found that large meshes are not suited for the simulation of sensors: scanning the growing grid "
            "took 66 times as long as scanning the hand-made model. If every triangle is tested with every beam, the "
            f"time grows with the number of triangles: {ratios['brute force']} times here (power law with exponent "
            f"{powers['brute force']:.2f}). A tree of bounding volumes over the same triangles removes this cost: "
            f"{ratios['tree']} times (exponent {powers['tree']:.2f}), as a beam then meets only a few boxes and "
            "triangles.",
        )
        self._add_figure(
            "table3_growth",
            draw_scan_growth(figures["rows"]),
            "Median time of one scan over the number of triangles; both axes are logarithmic.",
        )
        rows = []
        for row in figures["rows"]:
            _, paper_us, paper_ratio = PAPER_SCANS[row["model"]]
            ratio = figures["ratios"][row["method"]].get(row["model"])
            rows.append(
                [
                    MODELS[row["model"]],
                    METHODS[row["method"]][0],
                    f"{row['triangles']:,}",
                    format_cost(row["scan_us"], 0),
                    f"{paper_us:,}",
                    format_ratio(ratio) if ratio else "1",
                    paper_ratio,
                    row["scans"],
                ]
            )
        self._add_table(
            "laser",
            ["model", "method", "triangles", "one scan [µs]", "one scan in the paper [µs]",
             "relative to the hand-made model (95 % interval)", "the same in the paper", "scans"],
            rows,
            f"Table III. One scan of {figures['beams']} beams of the exact surface from positions along the course, "
            f"0.3 m above the ground, looking ahead and 20 degrees down; {100 * figures['hits']:.0f} % of the beams "
            "hit the arena. Mean ± standard deviation of processor time; the methods alternate every 20 scans.",
        )  # fmt: skip

    def _add_robots(self) -> None:
        figures = self._figures("evolution")
        champion = figures["champion"]
        self.page.add_section(
            "Fig. 7: the robots",
            f"CMA-ES with {champion['modules']} modules in the GSRM arena: {figures['genotypes']} genotypes in "
            f"{figures['generations']} generations. "
            f"{describe_selection(champion['successes'], champion['trials'])}",
        )
        for name, text in ROBOTS.items():
            self._add_film(name, text, self._figures("films")[name])
        curves = (np.array(figures[key]) for key in ("evaluations", "best", "median"))
        self._add_figure(
            "learning_curve",
            draw_learning_curve(*curves),
            "Fitness over the number of genotypes: progress of the whole body [m], plus 1 for a success, minus effort.",
        )
        self._add_table(
            "evolution",
            ["gene", *champion["names"]],
            [["value", *(f"{gene:.3f}" for gene in champion["genotype"])]],
            f"Genotype of the champion, controller {champion['controller']}; one run.",
        )

    def _add_film(self, name: str, text: str, film: Mapping[str, Any]) -> None:
        folder = self.folder / "films"
        end = (
            f"crosses in {film['seconds']:.0f} s"
            if film["success"]
            else f"does not cross; the trial ends after {film['seconds']:.0f} s"
        )
        caption = f"{text} ({film['modules']} modules) in the true arena, from the floor. It {end}."
        if film["moments"]:
            pictures = {
                f"after {moment:.0f} s": (folder / f"{name}_{index + 1}.png").read_bytes()
                for index, moment in enumerate(film["moments"])
            }
            self.page.add_gallery(pictures, caption)
            self.page.add_video((folder / f"{name}.mp4").read_bytes(), f"{text}; at five times real time.")
        else:
            self.page.add_text(f"{caption} There is no video: this machine has no OpenGL.")
        self._add_figure(
            f"fig7_{name}",
            draw_tracks(self._load_positions(name), self._truth),
            "Side view of the same trial: the body at seven times, from violet (early) to yellow (late).",
        )

    def _add_times(self) -> None:
        columns = ("seconds", "cpu_seconds")
        rows = [[name, *(f"{result[each]:.1f}" for each in columns)] for name, result in self.results.items()]
        sums = (sum(result[each] for result in self.results.values()) for each in columns)
        self.page.add_section("Time of the experiments")
        self._add_table(
            "cloud",
            ["experiment", "wall time [s]", "processor time [s]"],
            [*rows, ["total", *(f"{total:.0f}" for total in sums)]],
            "One run of each experiment; the making of this page is not included.",
        )


def format_mm(meters: float | None, digits: int = 2) -> str:
    """Return a distance in millimeters."""
    return ABSENT if meters is None else f"{1000 * meters:.{digits}f}"


def format_number(value: float | None, form: str) -> str:
    """Return a number, or a dash where there is none."""
    return ABSENT if value is None else format(value, form)


def format_cost(cost: Mapping[str, float], digits: int = 1) -> str:
    """Return mean ± standard deviation."""
    return f"{cost['mean']:,.{digits}f} ± {cost['deviation']:,.{digits}f}"


def format_ratio(ratio: Mapping[str, float]) -> str:
    """Return a ratio and its 95 % interval."""
    return f"{ratio['ratio']:.2f} ({ratio['low']:.2f} to {ratio['high']:.2f})"


def name_network(name: str) -> str:
    """Return the name of a network in a table: "gsrm_2200" -> "GSRM 2,200 units"."""
    method, _, size = name.partition("_")
    return MODELS[method] + (f" {int(size):,} {'units' if method == 'gsrm' else 'triangles'}" if size else "")


def draw_costs(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw the time of a physics step in each arena and of its collision detection, with standard deviations."""
    figure = Figure(figsize=(CHART_WIDTH, 0.34 * len(rows) + 0.9), dpi=CHART_DPI, layout="constrained")
    axes, places = figure.add_subplot(), range(len(rows))
    for cost, label, height, color in (
        ("physics_us", "whole step", 0.8, "#c9d6e4"),
        ("collision_us", "collision detection within it", 0.45, PALETTE[0]),
    ):
        means, deviations = ([row[cost][name] for row in rows] for name in ("mean", "deviation"))
        axes.barh(
            places, means, height, color=color, label=label, xerr=deviations, ecolor=INK_COLOR, capsize=2
        )
    axes.set_yticks(places, [row["text"] for row in rows])
    axes.invert_yaxis()
    axes.set(xlabel="time of a physics step [µs]", xlim=(0, None))
    axes.legend(frameon=False)
    style_axes(axes)
    return figure


def draw_scan_growth(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw the time of a laser scan over the number of triangles, for each method and for the paper."""
    figure = Figure(figsize=(CHART_WIDTH, 3.4), dpi=CHART_DPI, layout="constrained")
    axes = figure.add_subplot()
    for method, (label, style, color) in METHODS.items():
        shown = sorted(
            (row["triangles"], row["scan_us"]["median"]) for row in rows if row["method"] == method
        )
        if shown:
            axes.plot(*zip(*shown, strict=True), style, color=color, label=label, ms=5)
    paper = sorted(each[:2] for each in PAPER_SCANS.values())
    axes.plot(*zip(*paper, strict=True), "D--", color="#5b6675", label="the paper (2011)", ms=5)
    axes.set(xscale="log", yscale="log", xlabel="triangles", ylabel="time of one scan of 361 beams [µs]")
    axes.legend(frameon=False)
    style_axes(axes)
    return figure
