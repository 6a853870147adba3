"""The page of a search for bodies: a grid of the fittest body of each kind; a click shows how it drives."""

from __future__ import annotations

from evolution.body_search.descriptors import DESCRIPTORS
from evolution.body_search.learning import Lesson
from evolution.body_search.run import BodyRun
from evolution.champions.playback import play
from evolution.errors import RunError
from evolution.report.bodies import draw_bodies
from evolution.report.page import Card, Page
from evolution.report.pictures import to_png
from evolution.report.provenance import describe_machine
from reconstruction.progress import Progress, silent

FILM_SPEED = 5.0
"""Playback speed of films, relative to real time."""


def make_body_page(run: BodyRun, num_films: int = 0, seed: int = 0, progress: Progress = silent) -> Page:
    """Return a page on which the bodies of a run can be looked through.

    Args:
        run: a search for bodies.
        num_films: how many of them are filmed, the fittest first; the machine needs OpenGL.
        seed: seed of the trials that are filmed.
        progress: called with the body that is filmed and the share done.

    Raises:
        RunError: no body has learned yet.
    """
    elites = sorted(run.find_elites().values(), key=lambda lesson: -lesson.fitness)
    if not elites:
        raise RunError("no body has learned yet; resume the run")
    axes = " and ".join(name.replace("_", " ") for name in run.config.bodies.axes)
    page = Page(
        title="Bodies that evolved",
        summary=(
            f"{len({each.pupil.key for each in run.record.lessons})} bodies learned in {run.config.arena}, "
            f"{run.record.seconds:.0f} s of robot time; shown is the fittest of each kind by {axes}."
        ),
        footer=describe_machine(),
    )
    page.add_section("The fittest body of each kind")
    cards = []
    for number, lesson in enumerate(elites):
        film = None
        if number < num_films:
            progress(f"film of {lesson.pupil.body.text}", number / min(num_films, len(elites)))
            film = _film(run, lesson, seed)
        cards.append(_make_card(lesson, film))
    page.add_cards(cards, "From above, ahead is up; the free arm of the root is red. Click to see more.")
    return page


def _make_card(lesson: Lesson, film: bytes | None) -> Card:
    body = lesson.pupil.body
    measures = ", ".join(
        f"{name.replace('_', ' ')} {axis.measure(lesson):.3g}" for name, axis in DESCRIPTORS.items()
    )
    text = (
        f"Genome {body.text}, body plan {body.to_plan()}: succeeds in {lesson.successes} of {lesson.trials} trials of "
        f"its exam; {measures}."
    )
    return Card(to_png(draw_bodies([body], [""])), f"{lesson.fitness:.2f}", text, film)


def _film(run: BodyRun, lesson: Lesson, seed: int) -> bytes | None:
    """Return one trial as a film; None where there is no OpenGL."""
    from evolution.report.video import encode_video

    recording = play(run.make_champion(lesson), run.config.arena, seed, film=True, speed=FILM_SPEED)
    return encode_video(recording.frames, recording.fps) if recording.frames else None
