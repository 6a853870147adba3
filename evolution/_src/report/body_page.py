"""The page of a search for bodies: a grid of the fittest ones; a click shows how it drives."""

import os
import platform
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from evolution._src.champions.playback import play
from evolution._src.errors import RunError
from evolution._src.report.figures import draw_bodies, to_png
from evolution._src.report.page import Card, Page
from evolution._src.report.video import encode_video
from evolution._src.search.bodies.algorithms import LevelResult
from evolution._src.search.bodies.run import BodyRun, describe_success, format_fitness
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.base.range_checks import format_count

PACKAGES = ("symbrion-gym", "mujoco", "jax", "numpy", "coacd", "cma")


def describe_machine() -> str:
    """Return processor, cores, versions of Python and packages in one line."""
    packages = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    try:  # Linux has the name of the processor in a file
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    name = next(names, "") or platform.machine()
    return f"{name}, {os.cpu_count()} cores, Python {platform.python_version()}, {packages}"


FILM_SPEED = 5.0  # Playback speed of films, relative to real time
MOST_CARDS = 24  # Bodies on a page


def make_body_page(run: BodyRun, num_films: int = 0, seed: int = 0, progress: Progress = silent) -> Page:
    """Return a page on which the bodies of a run can be looked through."""
    fittest = run.list_fittest()[:MOST_CARDS]
    if not fittest:
        raise RunError("no body has learned yet; resume the run")
    bodies = format_count(len({each.body.canonical_text for each in run.results}), "body", "bodies")
    page = Page(
        title="Bodies that evolved",
        summary=f"{bodies} learned in {run.config.arena}, {run.seconds:.0f} s of robot time.",
        footer=describe_machine(),
    )
    champion = run.champion
    assert champion is not None
    page.add_verdict(
        f"The best body: {describe_success(run)}.", good=champion.successes > champion.trials / 2
    )
    page.add_section("The fittest bodies")
    page.add_list(_explain(run))
    cards = _make_cards(run, fittest, num_films, seed, progress)
    page.add_cards(
        cards, "From above, ahead is up; the free arm of the root is red. A click on a body opens its card."
    )
    return page


def _explain(run: BodyRun) -> list[str]:
    """Return how the cards are read."""
    confirmed = (
        "The champion is the body that succeeded most often when the fittest ones were tried again, under conditions "
        "that none had met. Its successes are those of these fresh trials; those of the others are of the exam."
        if run.confirmation is not None
        else "The champion is the fittest body; it has not been tried again, which symbrion resume does."
    )
    return [
        "Fitness is what the scoring of the run (ev.Scoring) makes of an exam: trials of what the body has learned, "
        "under other conditions. Higher is better.",
        confirmed,
        "Cards with the mark “film” show the body drive, at "
        f"{FILM_SPEED:g} times the speed of the robot. The option --films of symbrion replay says for how many bodies.",
    ]


def _make_cards(
    run: BodyRun, fittest: Sequence[LevelResult], num_films: int, seed: int, progress: Progress
) -> list[Card]:
    """Return the card of the champion, then one for each of the fittest that is not the champion."""
    champion = run.best if run.confirmation is None else run.confirmation.result
    assert champion is not None
    others = [
        result
        for result in fittest
        if (result.body.canonical_text, result.level) != (champion.body.canonical_text, champion.level)
    ]
    cards = []
    for number, result in enumerate([champion, *others]):
        film = None
        if number < num_films:
            progress(f"film of {result.body.text}", number / min(num_films, 1 + len(others)))
            shown = play(run.make_champion(result), run.config.arena, seed, film=True, speed=FILM_SPEED)
            film = encode_video(shown.frames, shown.fps) if shown.frames else None
        cards.append(_make_card(run, result, film, result is champion))
    return cards


def _make_card(run: BodyRun, result: LevelResult, film: bytes | None, is_champion: bool) -> Card:
    body = result.body
    exam = f"{result.successes} of {result.trials} trials" if result.trials else "no exam yet"
    rate, mark = f"{exam} of its exam" if result.trials else exam, ""
    if is_champion:
        mark = "champion" if run.confirmation is not None else "champion, not confirmed"
        if run.confirmation is not None:
            found = run.confirmation.champion
            rate = f"{found.successes} of {found.trials} fresh trials"
    fitness = format_fitness(run, result.fitness)
    text = (
        f"Exam: {exam} succeeded, {fitness}; it learned in {result.seconds:.0f} s of robot time in its last level.\n"
        f"Body plan {body.to_plan()}, genome {body.text}"
    )
    label = f"{fitness}\n{format_count(body.num_modules, 'module')}\n{rate}"
    return Card(to_png(draw_bodies([body], [""])), label, text, film, mark)
