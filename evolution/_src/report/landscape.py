"""Charts of the landscape of bodies: fitness by size, its distribution, the scan against the truth, searches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evolution._src.landscape.reliability import correlate_ranks, find_goal
from evolution._src.landscape.replay import Replay
from evolution._src.landscape.table import Landscape
from evolution._src.report.bodies import draw_bodies
from evolution._src.report.figures import EDGE_COLOR, INK_COLOR, MARK_COLOR, PALETTE
from evolution._src.report.pictures import CHART_DPI

_PANEL = (3.1, 2.7)
"""Width and height of the chart of a task [inch]."""
_LABELS = {
    "freeze_thaw": "freeze-thaw",
    "niches": "successive halving in niches",
    "halving": "successive halving",
    "genetic": "genetic algorithm",
    "map_elites": "MAP-Elites",
    "cma_mae": "CMA-MAE",
    "exhaustive": "all, small ones first",
}
_SPREAD = 0.28
"""Largest distance of a point from the line of its number of modules."""


def draw_sizes(table: Landscape) -> Figure:
    """Draw the fitness of each body over its number of modules; the dashed line is 95 % of the optimum."""
    figure, panels = _make_panels(table)
    rng = np.random.default_rng(0)
    places = table.num_modules + rng.uniform(-_SPREAD, _SPREAD, len(table.bodies))
    for task, axes in enumerate(panels):
        solved = table.successes[task] == table.config.exam_trials
        for is_solved, color in ((False, PALETTE[0]), (True, PALETTE[1])):
            shown = solved == is_solved
            axes.plot(places[shown], table.fitness[task][shown], ".", color=color, markersize=4)
        axes.axhline(find_goal(table, task), color=EDGE_COLOR, linewidth=0.8, linestyle="--")
        axes.set(xlabel="modules", xticks=range(1, table.config.largest + 1))
    panels[0].set_ylabel("fitness [m]; red: succeeds in all trials")
    return figure


def draw_distribution(table: Landscape) -> Figure:
    """Draw which share of the bodies has at most a fitness."""
    figure, panels = _make_panels(table)
    shares = np.arange(1, len(table.bodies) + 1) / len(table.bodies)
    for task, axes in enumerate(panels):
        axes.step(np.sort(table.fitness[task]), shares, where="post", color=PALETTE[0])
        axes.axvline(find_goal(table, task), color=EDGE_COLOR, linewidth=0.8, linestyle="--")
        axes.set(xlabel="fitness [m]", ylim=(0.0, 1.02))
    panels[0].set_ylabel("share of the bodies")
    return figure


def draw_truth(table: Landscape) -> Figure:
    """Draw the fitness in the truth, and that of a second exam on the scan, over that on the scan."""
    figure, panels = _make_panels(table)
    for task, axes in enumerate(panels):
        fitness = table.fitness[task]
        kinds = (
            ("again", table.again_fitness[task], PALETTE[4]),
            ("truth", table.truth_fitness[task], PALETTE[0]),
        )
        for name, values, color in kinds:
            if np.isnan(values).any():
                continue
            label = f"{name}, rank correlation {correlate_ranks(fitness, values):.2f}"
            axes.plot(fitness, values, ".", color=color, markersize=4, label=label)
        ends = [fitness.min(), fitness.max()]
        axes.plot(ends, ends, color=EDGE_COLOR, linewidth=0.8, zorder=0)
        axes.legend(fontsize=6, frameon=False, loc="upper left")
        axes.set(xlabel="fitness on the scan [m]")
    panels[0].set_ylabel("fitness of the same genotype [m]")
    return figure


def draw_winners(table: Landscape, task: str, count: int = 12) -> Figure:
    """Draw the fittest bodies of a task with their fitness on the scan and in the truth."""
    place = table.find_task(task)
    best = np.argsort(-table.fitness[place], kind="stable")[:count]
    labels = [
        f"{table.fitness[place, each]:.2f} | {table.truth_fitness[place, each]:.2f}\n{table.bodies[each].text}"
        for each in best
    ]
    return draw_bodies([table.bodies[each] for each in best], labels)


def draw_longer(table: Landscape, longer: Mapping[str, Any]) -> Figure:
    """Draw the fitness of the fittest bodies after learning longer over that of the landscape.

    Args:
        table: the landscape.
        longer: what the fittest bodies learned, as `evolution._src.landscape.longer.load_longer` returns it.
    """
    figure, panels = _make_panels(table)
    for task, axes in enumerate(panels):
        rows = longer["tasks"][table.tasks[task]]
        short = np.array([table.fitness[task, table.index[each["body"]]] for each in rows])
        long, truth = (np.array([each[name] for each in rows]) for name in ("fitness", "truth_fitness"))
        axes.plot(short, truth, "x", color=PALETTE[4], markersize=4, label="in the truth")
        axes.plot(short, long, ".", color=PALETTE[0], markersize=5, label="on the scan")
        ends = [short.min(), max(short.max(), long.max())]
        axes.plot(ends, ends, color=EDGE_COLOR, linewidth=0.8, zorder=0)
        axes.set(xlabel="fitness in the landscape [m]")
    panels[0].set_ylabel(f"fitness after {longer['times']} times the genotypes [m]")
    panels[0].legend(fontsize=6, frameon=False, loc="best")
    return figure


def draw_searches(
    table: Landscape, runs: Mapping[str, Mapping[str, Sequence[Replay]]], budgets: Mapping[str, float]
) -> Figure:
    """Draw the mean best fitness of replayed searches over the share of the exhaustive search's time.

    Args:
        table: the landscape.
        runs: task -> search -> a replay of each seed.
        budgets: simulated time at which the searches of a task end [s].
    """
    figure, panels = _make_panels(table)
    for task, axes in enumerate(panels):
        name = table.tasks[task]
        total, lowest = float(table.seconds[task].sum()), float(table.fitness[task].min())
        times = np.linspace(0.0, budgets[name], 200)
        for number, (search, replays) in enumerate(runs[name].items()):
            heights = [_hold(each, times, lowest) for each in replays]
            axes.plot(
                100 * times / total,
                np.mean(heights, axis=0),
                color=PALETTE[number % len(PALETTE)],
                linestyle=("-", ":", "--")[number // len(PALETTE) % 3],
                linewidth=1.2,
                label=_LABELS.get(search, search),
            )
        axes.axhline(find_goal(table, task), color=EDGE_COLOR, linewidth=0.8, linestyle="--")
        axes.axhline(float(table.fitness[task].max()), color=MARK_COLOR, linewidth=0.8)
        axes.set(xlabel="share of the exhaustive search [%]")
    panels[0].set_ylabel("best fitness so far [m]")
    panels[-1].legend(fontsize=6, frameon=False, loc="lower right")
    return figure


def _hold(run: Replay, times: np.ndarray, lowest: float) -> np.ndarray:
    """Return the best fitness at some times."""
    return np.maximum(run.best[np.searchsorted(run.seconds, times, side="right") - 1], lowest)


def _make_panels(table: Landscape) -> tuple[Figure, list[Axes]]:
    count = len(table.tasks)
    figure = Figure(figsize=(_PANEL[0] * count, _PANEL[1]), dpi=CHART_DPI, layout="constrained")
    panels = [figure.add_subplot(1, count, place + 1) for place in range(count)]
    for name, axes in zip(table.tasks, panels, strict=True):
        axes.set_title(name, fontsize=9, color=INK_COLOR)
        axes.tick_params(labelsize=7)
        axes.xaxis.label.set_size(8)
        axes.yaxis.label.set_size(8)
        axes.spines[["top", "right"]].set_visible(False)
    return figure, panels
