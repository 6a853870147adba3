"""Several runs side by side: their learning curves in one figure, their results in one table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from evolution._src.search.run import Run
from reconstruction._src.base.printable import make_printable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from evolution._src.report.page import Page

COLUMNS = (
    "run",
    "arenas",
    "modules",
    "seed",
    "generations",
    "genotypes",
    "trials",
    "seconds",
    "best",
    "champion",
)


def draw_comparison(runs: Mapping[str, Run]) -> Figure:
    """Draw the median and the best fitness of each run over the number of evaluated genotypes.

    Args:
        runs: name -> run; those without a finished generation are skipped.
    """
    from matplotlib.figure import Figure

    from evolution._src.report.figures import PALETTE, style_axes
    from evolution._src.report.pictures import CHART_DPI, CHART_WIDTH

    figure = Figure(figsize=(CHART_WIDTH, 3.2), dpi=CHART_DPI, layout="constrained")
    axes = figure.add_subplot()
    for index, (name, run) in enumerate(runs.items()):
        history, color = run.history, PALETTE[index % len(PALETTE)]
        if not len(history):
            continue
        axes.plot(
            history["evaluations"],
            history["median"],
            color=color,
            marker="o",
            ms=3,
            label=make_printable(name),
        )
        axes.plot(history["evaluations"], history["best"], color=color, lw=0.8, ls=":")
        for generation in range(1, len(history)):
            if history["stage"][generation] != history["stage"][generation - 1]:
                axes.axvline(history["evaluations"][generation - 1], color=color, lw=0.8, alpha=0.5)
    axes.set(xlabel="genotypes evaluated", ylabel="fitness: median (line), best (dots)")
    for text in axes.legend(frameon=False, fontsize=8).get_texts():
        text.set_parse_math(False)  # a folder name may contain a dollar sign
    style_axes(axes)
    return figure


def tabulate(runs: Mapping[str, Run]) -> list[list[object]]:
    """Return one row per run, in the order of `COLUMNS`."""
    rows: list[list[object]] = []
    for name, run in runs.items():
        config, last = run.config, run.history[-1] if len(run.history) else None
        champion = run.champion
        crossed = f"{champion.successes} of {champion.trials}" if champion and champion.trials else "none yet"
        numbers: Sequence[object] = ("-",) * 4
        if last is not None:
            best = float(run.history["best"].max())
            numbers = (
                int(last["evaluations"]),
                int(last["trials"]),
                f"{last['wall_seconds']:.0f}",
                f"{best:.2f}",
            )
        arenas = " -> ".join(make_printable(stage.arena) for stage in config.all_stages)
        modules = champion.modules if champion else config.modules
        rows.append([make_printable(name), arenas, modules, config.seed, len(run.history), *numbers, crossed])
    return rows


def make_comparison_page(runs: Mapping[str, Run]) -> Page:
    """Return a page with the figure and the table."""
    from evolution._src.report.page import Page

    page = Page(
        "Comparison of runs", "Champions: crossings in fresh trials, in the arena in which they evolved."
    )
    page.add_section("Learning curves")
    page.add_figure(draw_comparison(runs), "Vertical lines: a run continues in its next arena.")
    page.add_section("Results")
    page.add_table(
        COLUMNS,
        tabulate(runs),
        "genotypes, trials: evaluated so far; seconds: wall time; best: highest fitness; champion: crossings in fresh "
        "trials.",
    )
    return page
