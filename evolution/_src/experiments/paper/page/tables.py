"""The tables of the experiments, with the figures of the paper."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from markupsafe import Markup

from evolution._src.experiments.paper.benchmark import COARSE
from evolution._src.experiments.paper.page.numbers import (
    NETWORK_SECONDS,
    PHYSICS,
    PHYSICS_ARENAS,
    SCAN_RATIOS,
    SCANS,
)
from evolution._src.search.validation import Validation

Record = Mapping[str, Any]
Row = Mapping[str, Any]
ABSENT = "-"
NETWORKS = {
    "gsrm": "GSRM", "gg": "GG", "simple": "hand-made", "boxes": "hand-made", "mixed": "GSRM", "hfield": "GSRM",
}  # fmt: skip
"""Network or arena -> the model whose surface it has."""
METHODS = {
    "tree": "exact surface, MuJoCo (bounding-volume tree)",
    "embree": "exact surface, Embree (bounding-volume tree)",
    "brute force": "exact surface, brute force (every triangle)",
    "hulls": "contact: convex pieces",
    "boxes": "contact: exact boxes",
    "mixed": "primitives, and the tree of the other triangles",
    "height field": "contact: height field",
}


class Table(NamedTuple):
    """A table of the page.

    Attributes:
        columns: headings.
        rows: cells.
        caption: the content of the table; ends with machine and date.
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[object]]
    caption: str


def sign(text: str, record: Record) -> str:
    """Return a caption that ends with machine, versions and date of the measurement."""
    return f"{text} Measured on {record['machine']}; {record['date']}."


def format_millimeters(meters: float | None, digits: int = 2) -> str:
    """Return a distance in millimeters."""
    return ABSENT if meters is None else f"{1000 * meters:.{digits}f}"


def format_cost(cost: Mapping[str, float], digits: int = 1) -> str:
    """Return mean ± standard deviation."""
    return f"{cost['mean']:,.{digits}f} ± {cost['deviation']:,.{digits}f}"


def format_ratio(ratio: Mapping[str, float]) -> str:
    """Return a ratio and its 95 % interval."""
    return f"{ratio['ratio']:.2f} ({ratio['low']:.2f} to {ratio['high']:.2f})"


def name_model(name: str) -> str:
    """Return the name of a network or arena in a table: "gsrm_2200" -> "GSRM 2,200"."""
    method, _, size = name.partition("_")
    text = NETWORKS.get(method, method)
    return f"{text} {int(size):,}" if size else text


def name_network(name: str) -> str:
    """Return the name of a network or arena with the unit of its size: "gsrm_2200" -> "GSRM 2,200 units"."""
    method, _, size = name.partition("_")
    return name_model(name) + ({"gsrm": " units", "gg": " triangles"}[method] if size else "")


def tabulate_cloud(record: Record) -> Table:
    """Return the table of the pre-processing steps."""
    figures = record["figures"]
    rows = [
        [step["step"], f"{step['readings']:,}", format_millimeters(step["mean"], 1),
         format_millimeters(step["p95"], 1)]
        for step in figures["steps"]
    ]  # fmt: skip
    text = (
        f"One survey: {figures['scans']:,} scans of {figures['beams']} beams. Distance of the readings within the "
        "bounding box of the arena from the true surface, after each step of pre-processing."
    )
    return Table(
        ["after step", "readings", "distance, mean [mm]", "distance, 95th percentile [mm]"],
        rows,
        sign(text, record),
    )


def tabulate_networks(record: Record) -> Table:
    """Return Table I."""
    rows = []
    for row in record["figures"]:
        triangles, seconds = NETWORK_SECONDS.get(row["network"], (None, None))
        cold, warm = row["cold_seconds"], row["warm_seconds"]
        rows.append([
            name_network(row["network"]),
            f"{row['triangles']:,}",
            f"{triangles:,}" if triangles else ABSENT,
            f"{cold:.1f}" if cold is not None else ABSENT,
            f"{warm:.2f}" if warm is not None else ABSENT,
            f"{seconds:.0f}" if seconds else ABSENT,
            format_millimeters(row["truth_to_mesh"]),
            format_millimeters(row["truth_to_mesh_p95"]),
            format_millimeters(row["mesh_to_truth"]),
            row["boundary_loops"],
        ])  # fmt: skip
    columns = ["network", "triangles", "triangles in the paper", "time of the first call [s]",
               "time of later calls [s]", "time in the paper [s]", "true surface to mesh, mean [mm]",
               "true surface to mesh, 95th percentile [mm]", "mesh to true surface, mean [mm]",
               "boundary loops"]  # fmt: skip
    text = (
        "Table I. All networks learn the same points. First call: in a process without compiled programs. Later calls: "
        "median of the next three. One boundary loop is the outer rim. The hand-made model is measured without its "
        "vertical sides, which no scan sees."
    )
    return Table(columns, rows, sign(text, record))


def tabulate_arenas(record: Record) -> Table:
    """Return the table of the arenas of Tables II and III."""
    rows = [
        [row["arena"], row["text"], f"{row['triangles']:,}", _count_pieces(row),
         f"{row['seconds']:.1f}", format_millimeters(row["mean"]), format_millimeters(row["p95"])]
        for row in record["figures"]
    ]  # fmt: skip
    columns = ["arena", "surface and contact geometry", "triangles of the surface (for rays)",
               "contact pieces", "building time [s]", "contact to true surface, mean [mm]",
               "contact to true surface, 95th percentile [mm]"]  # fmt: skip
    text = "Each arena is built once. Distances of the contact geometry from the true surface."
    return Table(columns, rows, sign(text, record))


def tabulate_physics(record: Record) -> Table:
    """Return Table II."""
    figures = record["figures"]
    runs = figures["runs"]
    rows = []
    for row in figures["rows"]:
        known = row["arena"] in PHYSICS_ARENAS
        ratios = figures["ratios"].get(row["arena"])
        rows.append([
            row["text"], _count_pieces(row), f"{row['contacts']:.1f}",
            format_cost(row["physics_us"]), PHYSICS["physics_us"] if known else ABSENT,
            format_cost(row["collision_us"]), PHYSICS["collision_us"] if known else ABSENT,
            format_ratio(ratios["physics_us"]) if ratios else "1",
            f"{row['crossed']} of {runs}",
        ])  # fmt: skip
    columns = ["arena", "contact pieces", "contacts per step", "physics step [µs]",
               "physics step in the paper [µs]", "collision detection within it [µs]",
               "collision detection in the paper [µs]",
               "physics step, relative to the hand-made model's pieces (95 % interval)",
               "runs that crossed"]  # fmt: skip
    text = (
        f"Table II. Mean ± standard deviation over {runs} runs of {figures['steps']:,} steps each, by MuJoCo's own "
        "timers, from the moment the head is above the pit; the arenas alternate. Control intervals (20 ms simulated) "
        "in which other work had the processor are left out: "
        f"{100 * figures['interrupted']:.1f} %. Our physics step includes collision detection, that of the paper does "
        "not."
    )
    return Table(columns, rows, sign(text, record))


def tabulate_laser(record: Record) -> Table:
    """Return Table III."""
    figures = record["figures"]
    rows = []
    for row in sorted(figures["rows"], key=_order_scans):
        if "_" in row["model"]:  # another size of a network: the figure shows it
            continue
        ratios = figures["ratios"].get(row["method"], {})
        paper = SCANS.get(row["model"]) if row["method"] in ("tree", "brute force") else None
        rows.append([
            name_model(row["model"]), METHODS[row["method"]],
            f"{row['triangles']:,}" if row["triangles"] else ABSENT,
            format_cost(row["scan_us"], 0), f"{paper[1]:,.0f}" if paper else ABSENT,
            _format_ratio_to_hand_made(ratios, row["model"]),
            SCAN_RATIOS[row["model"]] if paper else ABSENT,
            format_millimeters(row["error"], 1), row["scans"],
        ])  # fmt: skip
    columns = ["model", "what is scanned, and how", "triangles", "one scan [µs]", "one scan in the paper [µs]",
               "relative to the hand-made model (95 % interval)", "the same in the paper",
               "range error [mm]", "scans"]  # fmt: skip
    text = (
        f"Table III. One scan of {figures['beams']} beams from positions along the course, 0.3 m above the ground, "
        f"looking ahead and 20 degrees down; {100 * figures['hits']:.0f} % of the beams hit the arena. Mean ± standard "
        "deviation of processor time; the methods alternate every 20 scans. Range error: mean difference from the "
        "ranges on the exact surface. The figure shows the other sizes of the networks, too."
    )
    return Table(columns, rows, sign(text, record))


def _count_pieces(row: Row) -> str:
    return f"{row['pieces']:,}" if row["pieces"] else ABSENT


def _format_ratio_to_hand_made(ratios: Mapping[str, Row], model: str) -> str:
    if not ratios:
        return ABSENT
    return "1" if model == "simple" else format_ratio(ratios[model])


def _order_scans(row: Row) -> tuple[int, int]:
    return list(METHODS).index(row["method"]), -row["triangles"]


def tabulate_resolutions(record: Record) -> Table:
    """Return success in the true arena by the model in which a champion evolved."""
    rows = [
        [name_network(row["model"]), f"{row['triangles']:,}", row["pieces"], row["genotypes"],
         "{} of {}".format(*row["validated"]), "yes" if Validation().is_solved(*row["validated"]) else "no",
         f"{row['successes']} of {row['trials']}"]
        for row in record["figures"]
    ]  # fmt: skip
    columns = ["evolved in", "triangles", "contact pieces", "genotypes", "fresh trials crossed there",
               "confirmed by them", "trials crossed in the true arena"]  # fmt: skip
    text = (
        "One evolution for each size. Trials start on the floor and are randomized in start, heading, friction and "
        "torque. A champion is confirmed by fresh trials in the arena in which it evolved."
    )
    return Table(columns, rows, sign(text, record))


def tabulate_models(benchmark: Record) -> Table:
    """Return success in the true arena by training model, from the benchmark of evolution."""
    rows = []
    for model, result in benchmark["models"].items():
        crossed = (_list_crossed(result, is_confirmed) for is_confirmed in (True, False))
        rows.append([name_network(model.replace(" ", "_")), *_summarize_runs(result), *crossed])
    columns = ["evolved in", *_SUMMARY, "crossings of 20 in the true arena, by run: confirmed champions",
               "crossings of 20 in the true arena, by run: not confirmed"]  # fmt: skip
    text = Markup(
        "Several seeds for each model, at most 600 genotypes per run (<code>python -m benchmarks.evolution</code>). A "
        "champion is confirmed by fresh trials in the arena of its run; it is robust if it is confirmed and crosses in "
        "at least 18 of 20 fresh trials in the true arena.{} {}"
    )
    return Table(columns, rows, text.format(_describe_seeds(benchmark), describe_benchmark(benchmark)))


def tabulate_stages(benchmark: Record) -> Table:
    """Return the comparison of coarse to fine with the fine model alone, from the benchmark of evolution."""
    coarse, rows = name_network(COARSE.replace(" ", "_")), []
    text = Markup(
        "Evolution in a coarse model first, then in a fine one (<code>python -m benchmarks.evolution</code>)."
    )
    for fine, parts in benchmark["stages"].items():
        name = name_network(fine.replace(" ", "_"))
        rows.append([f"{name} only", *_summarize_runs(parts["fine_only"])])
        rows.append([f"first {coarse}, then {name}", *_summarize_runs(parts["coarse_to_fine"])])
        compared = parts["compared"]
        if compared:
            text += (
                f" With {name} this takes {1 / compared['times_less_cpu_seconds']:.1f} times the processor time and "
                f"{1 / compared['times_less_genotypes']:.1f} times the genotypes of the fine model alone (medians of "
                "the runs with a robust champion)."
            )
    return Table(["stages", *_SUMMARY], rows, text + f" {describe_benchmark(benchmark)}")


_SUMMARY = (
    "runs with a robust champion", "runs without a confirmed champion (of which cross in 18 of 20)",
    "genotypes per run, median", "processor time per run, median [s]", "measured",
)  # fmt: skip


def _summarize_runs(result: Row | None) -> list[str]:
    """Return the cells of a part of the benchmark; "not measured" where there are no runs."""
    if not result:
        return ["not measured", *[ABSENT] * (len(_SUMMARY) - 1)]
    origins = [run["origin"] for run in result["runs"]]
    days = dict.fromkeys(sorted(origin["date"] for origin in origins))
    commits = dict.fromkeys(origin["commit"][:7] for origin in origins if origin["commit"])
    return [
        f"{result['champions_that_hold']} of {result['of']}",
        f"{result['unconfirmed']} ({result['unconfirmed_that_hold']})",
        f"{result['median_genotypes']:,.0f}",
        f"{result['median_cpu_seconds']:.0f}",
        "; ".join(", ".join(each) for each in (days, commits) if each),
    ]


def _list_crossed(result: Row | None, is_confirmed: bool) -> str:
    runs = result["runs"] if result else []
    return ", ".join(str(run["held_in_truth"]) for run in runs if run["confirmed"] == is_confirmed) or ABSENT


def _describe_seeds(benchmark: Record) -> str:
    """Return a sentence on the runs that were judged with fixed seeds; later ones draw a seed for each run."""
    runs = [run for result in benchmark["models"].values() if result for run in result["runs"]]
    known = sum("judging_seed" not in run for run in runs)
    return (
        f" {known} of {len(runs)} runs were judged with fixed seeds, the others with a seed drawn for the run."
        if known
        else ""
    )


def describe_benchmark(benchmark: Record) -> str:
    """Return a sentence on machine, versions and date of the benchmark, or that there are no results."""
    machine, versions = benchmark["machine"] or {}, benchmark["versions"] or {}
    if not machine:
        return "This installation has no results of the benchmark."
    about = [str(value) for key, value in machine.items() if key != "cores" and value]
    about += [f"{machine['cores']} cores"] if machine.get("cores") else []
    about += [f"{name} {version}" for name, version in versions.items()]
    return f"Measured on {', '.join(about)}; {benchmark['date']}."


def tabulate_widened(record: Record) -> Table:
    """Return the table of the surfaces after the pit was widened."""
    rows = [
        [row["surface"], f"{row['triangles']:,}", f"{row['seconds']:.2f}" if row["seconds"] else ABSENT,
         format_millimeters(row["truth_to_mesh"]), format_millimeters(row["truth_to_mesh_p95"]),
         format_millimeters(row["mesh_to_truth"]), row["boundary_loops"]]
        for row in record["figures"]["surfaces"]
    ]  # fmt: skip
    columns = ["GSRM", "triangles", "processor time [s]", "true surface to mesh, mean [mm]",
               "true surface to mesh, 95th percentile [mm]", "mesh to true surface, mean [mm]",
               "boundary loops"]  # fmt: skip
    text = (
        "Distances from the widened true surface. Processor time from the scan log to the surface, compilation not "
        "included: median of three."
    )
    return Table(columns, rows, sign(text, record))


def tabulate_widened_champions(record: Record) -> Table:
    """Return the success of the champions from before and after the pit was widened, in both true arenas."""
    figures = record["figures"]
    old, new = (f"{100 * pit:.0f} cm" for pit in figures["pit"])
    texts = {"before": "evolved in the surface before the change", "after": "evolved in the refined surface"}
    rows = [
        [text, figures[when]["genotypes"], *_count(figures[when]["judged"])] for when, text in texts.items()
    ]
    columns = ["champion", "genotypes", f"trials crossed, pit of {old}", f"trials crossed, pit of {new}"]
    text = "One evolution each; randomized trials from the floor in the true arenas."
    return Table(columns, rows, sign(text, record))


def _count(judged: Mapping[str, Mapping[str, int]]) -> list[str]:
    return [f"{judged[name]['successes']} of {judged[name]['trials']}" for name in ("narrow", "wide")]
