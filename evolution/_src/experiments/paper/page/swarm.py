"""The page's section on the swarm."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from evolution._src.experiments.paper.page import tables
from evolution._src.experiments.paper.page.context import PaperContext
from evolution._src.experiments.paper.swarm import FILM, TIMELINE

COLUMNS = ("seed", "gathered", "crossed", "recoveries", "across")


def add_swarm(context: PaperContext) -> None:
    """Add film, timeline and table of the stories; nothing where none was told."""
    record = context.records.get("swarm")
    if record is None:
        return
    figures, page = record["figures"], context.page
    stories, alone = figures["stories"], figures["without_docking"]
    num_robots, successes = stories[0]["robots"], sum(story["success"] for story in stories)
    page.add_section(
        "Beyond the paper: a swarm becomes the organism",
        f"{num_robots} single robots are scattered before the pit of the GSRM arena, which none of them can cross. One "
        "meets the pit and calls; the others dock to it one by one, over what they sense and hear only; the champion "
        f"drives the snake across in full contact; all undock and go on. {successes} of {len(stories)} swarms are "
        f"across; of those that may not dock, {sum(story['success'] for story in alone)} of {len(alone)}.",
    )
    folder = context.folder / "films"
    if figures["film"]:
        page.add_video(
            (folder / FILM).read_bytes(),
            context.sign("The first story; gathering at 20 times, the rest at 5 times real time."),
        )
    page.add_figure(
        (folder / TIMELINE).read_bytes(),
        context.sign("Who did what when in the first story, and where all were along the way."),
    )
    page.add_table(*tabulate_stories(record))


def tabulate_stories(record: Mapping[str, Any]) -> tables.Table:
    """Return a row for each story."""
    heads = ["seed", "whole after [s]", "across after [s]", "failed attempts to dock", "robots across"]
    rows = [
        ["-" if story[name] is None else f"{story[name]:g}" for name in COLUMNS]
        for story in record["figures"]["stories"]
    ]
    text = "Stories of the swarm; a robot counts as across if it is beyond the pit, undocked and upright."
    return tables.Table(heads, rows, tables.sign(text, record))
