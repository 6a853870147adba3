"""The tables of the experiments, each beside the paper's own numbers."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from markupsafe import Markup

from evolution.experiments.paper.benchmark import COARSE
from evolution.experiments.paper_page.numbers import (
    NETWORK_SECONDS,
    PHYSICS,
    PHYSICS_ARENAS,
    SCAN_RATIOS,
    SCANS,
)
from evolution.search.validation import Validation

Record = Mapping[str, Any]
Row = Mapping[str, Any]
ABSENT = "-"
NETWORKS = {"gsrm": "GSRM", "gg": "GG", "simple": "hand-made"}
METHODS = {
    "tree": "mj_multiRay, tree",
    "embree": "Embree, tree",
    "brute force": "every triangle",
    "hulls": "contact pieces",
    "boxes": "contact boxes",
    "mixed": "boxes and pieces",
    "height field": "height field",
}


class Table(NamedTuple):
    """A table of the page.

    Attributes:
        columns: headings.
        rows: cells.
        caption: what it shows; ends with machine, versions, number of runs.
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[object]]
    caption: str


def sign(text: str, record: Record) -> str:
    """Return a caption that ends with the machine, the versions and the date of what it shows."""
    return f"{text} Measured on {record['machine']}; {record['date']}."


def format_millimetres(metres: float | None, digits: int = 2) -> str:
    """Return a distance in millimetres."""
    return ABSENT if metres is None else f"{1000 * metres:.{digits}f}"


def format_cost(cost: Mapping[str, float], digits: int = 1) -> str:
    """Return mean ± deviation."""
    return f"{cost['mean']:,.{digits}f} ± {cost['deviation']:,.{digits}f}"


def format_ratio(ratio: Mapping[str, float]) -> str:
    """Return a ratio with its interval."""
    return f"{ratio['ratio']:.2f} ({ratio['low']:.2f} to {ratio['high']:.2f})"


def name_model(name: str) -> str:
    """Return how a network or arena is called in a table: "gsrm_2200" -> "GSRM 2200"."""
    method, _, size = name.partition("_")
    text = NETWORKS.get(method, method)
    return f"{text} {int(size):,}" if size else text


def name_network(name: str) -> str:
    """Return a network or arena with what its size counts: "gsrm_2200" -> "GSRM 2,200 units"."""
    method, _, size = name.partition("_")
    return name_model(name) + ({"gsrm": " units", "gg": " triangles"}[method] if size else "")


def tabulate_cloud(record: Record) -> Table:
    """Return the figures of the pre-processing's steps."""
    figures = record["figures"]
    rows = [
        [step["step"], f"{step['readings']:,}", format_millimetres(step["mean"], 1),
         format_millimetres(step["p95"], 1)]
        for step in figures["steps"]
    ]  # fmt: skip
    text = (
        f"{figures['scans']:,} scans of {figures['beams']} beams, 1 survey; distance of the readings within the "
        "arena's box from the true surface."
    )
    return Table(["step", "readings", "mean [mm]", "p95 [mm]"], rows, sign(text, record))


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
            format_millimetres(row["truth_to_mesh"]),
            format_millimetres(row["truth_to_mesh_p95"]),
            format_millimetres(row["mesh_to_truth"]),
            row["boundary_loops"],
        ])  # fmt: skip
    columns = ["network", "triangles", "paper", "cold [s]", "warm [s]", "paper [s]", "truth to mesh [mm]",
               "p95 [mm]", "mesh to truth [mm]", "boundary loops"]  # fmt: skip
    text = (
        "Table I. One cloud. Cold: the first call of a process that finds nothing compiled; warm: the median of the "
        "next three. One boundary loop is the rim. The hand-made model is measured without its sides, which no scan "
        "sees."
    )
    return Table(columns, rows, sign(text, record))


def tabulate_arenas(record: Record) -> Table:
    """Return what the arenas of Tables II and III are made of."""
    rows = [
        [row["arena"], row["text"], f"{row['triangles']:,}", _count_pieces(row),
         f"{row['seconds']:.1f}", format_millimetres(row["mean"]), format_millimetres(row["p95"])]
        for row in record["figures"]
    ]  # fmt: skip
    columns = ["arena", "what it is", "triangles seen", "pieces touched", "built in [s]", "contact to truth [mm]",
               "p95 [mm]"]  # fmt: skip
    return Table(
        columns, rows, sign("One build each; heights of the contact geometry against the truth.", record)
    )


def tabulate_physics(record: Record) -> Table:
    """Return Table II."""
    figures = record["figures"]
    runs = figures["runs"]
    rows = []
    for row in figures["rows"]:
        known = row["arena"] in PHYSICS_ARENAS
        ratios = figures["ratios"].get(row["arena"])
        rows.append([
            row["arena"], _count_pieces(row), f"{row['contacts']:.1f}",
            format_cost(row["physics_us"]), PHYSICS["physics_us"] if known else ABSENT,
            format_cost(row["collision_us"]), PHYSICS["collision_us"] if known else ABSENT,
            format_ratio(ratios["physics_us"]) if ratios else "1",
            f"{row['crossed']} of {runs}",
        ])  # fmt: skip
    columns = ["arena", "pieces", "contacts a step", "whole step [µs]", "paper: physics step [µs]",
               "of it collision [µs]", "paper: collision [µs]", "step / simple (95 %)", "crossed"]  # fmt: skip
    text = (
        f"Table II. Mean ± deviation over {runs} runs of {figures['steps']:,} steps each, by MuJoCo's own timers, from "
        "the moment the head is above the pit; the arenas take turns. Left out: ticks (20 ms simulated) in which "
        f"something else had the processor, {100 * figures['interrupted']:.1f} %. Our step contains its collision "
        "detection, the paper's does not."
    )
    return Table(columns, rows, sign(text, record))


def tabulate_laser(record: Record) -> Table:
    """Return Table III."""
    figures = record["figures"]
    rows = []
    for row in sorted(figures["rows"], key=_order_ways):
        if "_" in row["model"]:  # another size of a network: the figure shows it
            continue
        ratios = figures["ratios"].get(row["method"], {})
        paper = SCANS.get(row["model"]) if row["method"] in ("tree", "brute force") else None
        rows.append([
            name_model(row["model"]), METHODS[row["method"]],
            f"{row['triangles']:,}" if row["triangles"] else ABSENT,
            format_cost(row["scan_us"], 0), f"{paper[1]:,.0f}" if paper else ABSENT,
            _tell_ratio(ratios, row["model"]),
            SCAN_RATIOS[row["model"]] if paper else ABSENT,
            format_millimetres(row["error"], 1), row["scans"],
        ])  # fmt: skip
    columns = ["surface", "way", "triangles", "one scan [µs]", "paper [µs]", "to hand-made (95 %)",
               "paper", "wrong by [mm]", "scans"]  # fmt: skip
    text = (
        f"Table III. One scan of {figures['beams']} beams from places along the course, 0.3 m above ground, looking "
        f"ahead and 20 degrees down; {100 * figures['hits']:.0f} % of the beams hit the arena. Mean ± deviation of "
        "processor time; the ways take turns every 20 scans. The first rows see the exact surface, the last ones what "
        "robots touch. Wrong by: mean difference from the exact surface's ranges. Other sizes of the networks: in the "
        "figure."
    )
    return Table(columns, rows, sign(text, record))


def _count_pieces(row: Row) -> str:
    return f"{row['pieces']:,}" if row["pieces"] else ABSENT


def _tell_ratio(ratios: Mapping[str, Row], model: str) -> str:
    if not ratios:
        return ABSENT
    return "1" if model == "simple" else format_ratio(ratios[model])


def _order_ways(row: Row) -> tuple[int, int]:
    return list(METHODS).index(row["method"]), -row["triangles"]


def tabulate_resolutions(record: Record) -> Table:
    """Return truth success by the model that a champion has evolved in."""
    rows = [
        [name_network(row["model"]), f"{row['triangles']:,}", row["pieces"], row["genotypes"],
         "{} of {}".format(*row["validated"]), "yes" if Validation().is_solved(*row["validated"]) else "no",
         f"{row['successes']} of {row['trials']}"]
        for row in record["figures"]
    ]  # fmt: skip
    columns = ["evolved in", "triangles", "pieces", "genotypes", "held there", "confirmed", "held in truth"]
    text = (
        "One evolution for each size; trials randomised in start, yaw, friction and torque, from the floor. Only a "
        "champion that fresh trials have confirmed counts as one that holds."
    )
    return Table(columns, rows, sign(text, record))


def tabulate_models(benchmark: Record) -> Table:
    """Return the evolution benchmark's truth success by training model."""
    rows = []
    for model, result in benchmark["models"].items():
        held = (_list_held(result, is_confirmed) for is_confirmed in (True, False))
        rows.append([name_network(model.replace(" ", "_")), *_summarise_runs(result), *held])
    columns = ["evolved in", *_SUMMARY, "trials held in truth, of 20: confirmed", "not confirmed"]
    text = Markup(
        "Several seeds for each model, at most 600 genotypes a run (<code>python -m benchmarks.evolution</code>). A "
        "champion is confirmed by fresh trials in the arena of its run; it holds where it is confirmed and crosses in "
        "18 of 20 fresh trials in the true arena.{} {}"
    )
    return Table(columns, rows, text.format(_tell_seeds(benchmark), describe_benchmark(benchmark)))


def tabulate_stages(benchmark: Record) -> Table:
    """Return the evolution benchmark's comparison of coarse to fine with fine only."""
    coarse, rows = name_network(COARSE.replace(" ", "_")), []
    text = Markup("Coarse to fine (<code>python -m benchmarks.evolution</code>).")
    for fine, parts in benchmark["stages"].items():
        name = name_network(fine.replace(" ", "_"))
        rows.append([f"{name} only", *_summarise_runs(parts["fine_only"])])
        rows.append([f"first {coarse}, then {name}", *_summarise_runs(parts["coarse_to_fine"])])
        compared = parts["compared"]
        if compared:
            text += (
                f" Before {name} it takes {1 / compared['times_less_cpu_seconds']:.1f} times the processor time and "
                f"{1 / compared['times_less_genotypes']:.1f} times the genotypes of the fine model alone, by the "
                "medians of the runs that hold."
            )
    return Table(["stages", *_SUMMARY], rows, text + f" {describe_benchmark(benchmark)}")


_SUMMARY = (
    "confirmed champions that hold", "not confirmed (of which cross as often)", "genotypes, median",
    "processor time, median [s]", "measured",
)  # fmt: skip


def _summarise_runs(result: Row | None) -> list[str]:
    """Return the cells of a part of the benchmark, or that it was not measured."""
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


def _list_held(result: Row | None, is_confirmed: bool) -> str:
    runs = result["runs"] if result else []
    return ", ".join(str(run["held_in_truth"]) for run in runs if run["confirmed"] == is_confirmed) or ABSENT


def _tell_seeds(benchmark: Record) -> str:
    """Tell of runs that were judged by seeds which nobody has drawn."""
    runs = [run for result in benchmark["models"].values() if result for run in result["runs"]]
    known = sum("judging_seed" not in run for run in runs)
    return f" {known} of {len(runs)} were judged by seeds that stand in the code." if known else ""


def describe_benchmark(benchmark: Record) -> str:
    """Return machine, versions and date of the benchmark, or that there is none."""
    machine, versions = benchmark["machine"] or {}, benchmark["versions"] or {}
    if not machine:
        return "No results of the benchmark are here."
    about = [str(value) for key, value in machine.items() if key != "cores" and value]
    about += [f"{machine['cores']} cores"] if machine.get("cores") else []
    about += [f"{name} {version}" for name, version in versions.items()]
    return f"Measured on {', '.join(about)}; {benchmark['date']}."


def tabulate_widened(record: Record) -> Table:
    """Return the surfaces after the pit has been widened."""
    rows = [
        [row["surface"], f"{row['triangles']:,}", f"{row['seconds']:.2f}" if row["seconds"] else ABSENT,
         format_millimetres(row["truth_to_mesh"]), format_millimetres(row["truth_to_mesh_p95"]),
         format_millimetres(row["mesh_to_truth"]), row["boundary_loops"]]
        for row in record["figures"]["surfaces"]
    ]  # fmt: skip
    columns = ["GSRM", "triangles", "processor time, warm [s]", "truth to mesh [mm]", "p95 [mm]", "mesh to truth [mm]",
               "boundary loops"]  # fmt: skip
    return Table(
        columns, rows, sign("From the scan log on, against the widened truth; time: median of 3.", record)
    )


def tabulate_widened_champions(record: Record) -> Table:
    """Return how the champions hold before and after the pit has been widened."""
    figures = record["figures"]
    old, new = (f"{100 * pit:.0f} cm" for pit in figures["pit"])
    texts = {"before": "before: evolved in the old surface", "after": "after: evolved in the refined surface"}
    rows = [
        [text, figures[when]["genotypes"], *_count(figures[when]["judged"])] for when, text in texts.items()
    ]
    columns = ["champion", "genotypes", f"held, pit of {old}", f"held, pit of {new}"]
    text = "One evolution each; randomised trials from the floor in the true arenas."
    return Table(columns, rows, sign(text, record))


def _count(judged: Mapping[str, Mapping[str, int]]) -> list[str]:
    return [f"{judged[name]['successes']} of {judged[name]['trials']}" for name in ("narrow", "wide")]
