"""Places beyond the map of small bodies: how bodies of up to twelve modules are searched there, and the rival snake."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import evolution as ev
from benchmarks.material.rubble import save_rubble
from evolution._src.backends.trials import Randomization, RolloutConfig
from evolution._src.bodies.genome import make_row
from evolution._src.body_search.confirmation import confirm
from evolution._src.body_search.run import BodyRun
from evolution._src.controllers.config import ControllerConfig
from evolution._src.controllers.controller import U_SHAPE_HINT
from evolution._src.landscape.places import SPACING, TIME_LIMIT, UNITS
from evolution._src.search.run import Run
from evolution._src.search.search_config import SearchConfig
from reconstruction._src.reconstruct import reconstruct
from reconstruction._src.scans.preprocess import preprocess, thin
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import StairsCourse
from symbrion_gym._src.arenas.making import make_arena
from symbrion_gym._src.sensing.survey import survey

LARGEST = 12
"""Modules of the largest body."""
DOFS = 2
"""Rotational degrees of freedom of each module."""
CANDIDATES = 4
"""Bodies of a search that are tried again."""
SEARCH_SHARE = 0.5
"""Share of the time after which no iteration of the search begins; the rest confirms, and trains the best body."""
TRAINING_SIGMA = 0.2
"""Step size with which the best body goes on learning."""
ROWS = (4, 6, 8, 10, 12)
"""Modules of the rows with which a search begins."""
HELD_OUT = 7
"""Seed of the rubble; configurations were chosen on that of seed 100."""
STAIRS = StairsCourse(steps=3, rise=0.07, run=0.30, floor=2.0, plateau=2.4)
"""Room for twelve modules in a row before and behind the steps: on the stairs of the landscape such a row begins beyond
the near end, and drives over the far end before all of it is on top."""
GENERATIONS = 1000
"""More than the time allows."""
FOLDER = Path("runs/beyond")
_UNSTRETCHED = Randomization(stretch=(1.0,))
_STUCK_TIME = 3.0
"""A trial without progress for this long ends [s], as in the landscape."""
_HINT = tuple(
    (f"angle_at_{100 * x:+.0f}_cm", angle)
    for x, angle in zip(ControllerConfig().knots, U_SHAPE_HINT, strict=True)
)


@dataclass(frozen=True)
class Place:
    """Where bodies are searched.

    Attributes:
        name: its name.
        seconds: simulated time for a body and its controller [s]; what has begun is finished.
        controller: the law of all bodies.
        options: of the environment.
        genes: at which founders begin.
        sigma: initial step size of CMA-ES.
        rungs: generations that a body has learned at the end of each rung.
        snake: options in which the run of a snake differs.
    """

    name: str
    seconds: float
    controller: str
    options: Mapping[str, Any]
    genes: tuple[tuple[str, float], ...] = ()
    sigma: float = 0.4
    rungs: tuple[int, ...] = (1, 4)
    snake: Mapping[str, Any] = field(default_factory=dict)


PLACES: dict[str, Place] = {
    place.name: place
    for place in (
        Place("stairs", 5000.0, "oscillators", {"task": "climb", "duration": 35.0}),
        Place(
            "pit",
            12_000.0,
            "travelling",
            {"task": "cross_gap", "start": "pit", "duration": 90.0},
            genes=_HINT,
            sigma=0.2,
            rungs=(1, 4, 16),
            # in a row all tracks look ahead; the hint of steering that goes with "skid" stops rows at this pit
            snake={"track_control": "body", "origin": "hint"},
        ),
        Place("rubble", 5000.0, "oscillators", {"task": "traverse", "duration": 45.0}),
    )
}


def find_arenas(name: str, folder: Path = FOLDER) -> tuple[str, Arena | str]:
    """Return the scanned arena of a place, and the exact one, which judges alone."""
    if name == "pit":
        return "gsrm", "truth"
    if name == "rubble":
        scanned, exact = save_rubble(folder, HELD_OUT)
        return str(scanned), str(exact)
    return str(_save_stairs(folder)), Arena.from_course(STAIRS, "stairs-truth")


def _save_stairs(folder: Path) -> Path:
    """Make the scanned stairs unless the folder has them, and return theirs."""
    path = folder / "stairs"
    if not (path / "arena.json").is_file():
        points = thin(preprocess(survey(Arena.from_course(STAIRS, "stairs-truth"), seed=0)), SPACING)
        mesh = reconstruct(points, method="gsrm", units=UNITS, seed=0).mesh
        make_arena(mesh, name="stairs", seed=0, time_limit=TIME_LIMIT).save(path)
    return path


def make_search(place: Place, arena: str, seed: int) -> ev.BodyEvolutionConfig:
    """Return the search for a body of up to twelve modules."""
    return ev.BodyEvolutionConfig(
        arena=arena,
        seed=seed,
        controller=place.controller,
        track_control="skid",
        randomization=_UNSTRETCHED,
        rollout=RolloutConfig(stuck_time=_STUCK_TIME),
        bodies=ev.BodiesConfig(
            algorithm="surrogate",
            largest=LARGEST,
            dofs=DOFS,
            founders=tuple(make_row(count).text for count in ROWS),
            founder_genes=place.genes,
            children=6,
            population_size=len(ROWS),
            max_seconds=SEARCH_SHARE * place.seconds,
        ),
        learning=ev.LearningConfig(rungs=place.rungs, is_inherited=True, sigma=place.sigma),
        iterations=GENERATIONS,
        **place.options,
    )


class Found(NamedTuple):
    """A champion and its cost.

    Attributes:
        champion: body and controller, with the trials that confirmed it.
        seconds: simulated until it was known [s].
        figures: further ones of the record.
    """

    champion: ev.Champion
    seconds: float
    figures: dict[str, Any]


def search_body(place: Place, arena: str, seed: int) -> Found:
    """Search for a body, confirm the champion on the scan, and let it learn on in the time that is left.

    The champion is the more reliable one of both, on the scan.
    """
    run: BodyRun = ev.evolve_bodies(make_search(place, arena, seed))
    confirmed = confirm(run, CANDIDATES)
    body = confirmed.lesson.pupil.body
    figures = {
        "genome": body.text,
        "plan": body.to_plan(),
        "modules": body.num_modules,
        "is_row": body == make_row(body.num_modules),
        "exam_fitness": confirmed.lesson.fitness,
        "bodies": len({lesson.pupil.body.canonical_text for lesson in run.record.lessons}),
    }
    seconds = run.record.seconds + confirmed.seconds
    trained = evolve_for(make_training(run.config, confirmed.champion), place.seconds - seconds)
    champion = max(confirmed.champion, trained.champion, key=lambda each: each.score)
    figures["trained_seconds"] = round(trained.seconds, 1)
    figures["is_trained"] = champion is trained.champion
    return Found(champion, seconds + trained.seconds, figures)


def make_training(search: ev.BodyEvolutionConfig, champion: ev.Champion) -> ev.EvolutionConfig:
    """Return the run in which the body of a champion goes on learning where its controller stands."""
    return ev.EvolutionConfig(
        arena=search.arena,
        seed=search.seed,
        body=champion.body,
        episode=champion.episode,
        control=champion.control,
        trial=search.trial,
        scoring=search.scoring,
        search=replace(make_controller_search(TRAINING_SIGMA), initial_genotype=champion.genotype),
        generations=GENERATIONS,
    )


def make_controller_search(sigma: float) -> SearchConfig:
    """Return how the controller of one body is searched, that of a snake or of the best body."""
    return SearchConfig(population_size=8, sigma=sigma, trials=1, is_start_tried=True)


class _Spent(Exception):
    """The time of a run is spent."""


def search_snake(place: Place, arena: str, seed: int, modules: int, seconds: float) -> Found:
    """Evolve the controller of a row of modules by CMA-ES, with validation, for a simulated time.

    It begins with the genotype that founders begin with, as these do. A confirmed champion ends it earlier.
    """
    return evolve_for(make_snake_run(place, arena, seed, modules), seconds)


def evolve_for(config: ev.EvolutionConfig, seconds: float) -> Found:
    """Evolve a controller until a champion is confirmed or a simulated time is spent, for a generation at least."""
    latest: list[Run] = []

    def watch(run: Run) -> None:
        latest[:] = [run]
        if sum_seconds(run) >= seconds:
            raise _Spent

    with suppress(_Spent):
        ev.evolve(config, on_generation=watch)
    champion = latest[0].champion
    assert champion is not None
    return Found(champion, sum_seconds(latest[0]), {})


def make_snake_run(place: Place, arena: str, seed: int, modules: int) -> ev.EvolutionConfig:
    """Return the run that evolves the controller of a row."""
    options = {"track_control": "skid", "origin": "zero"} | dict(place.options) | dict(place.snake)
    return ev.EvolutionConfig(
        arena=arena,
        seed=seed,
        organism=make_row(modules).to_organism(make_search(place, arena, seed).bodies.scout),
        controller=place.controller,
        randomization=_UNSTRETCHED,
        rollout=RolloutConfig(stuck_time=_STUCK_TIME),
        scoring=ev.Scoring(module=0.0),
        search=make_controller_search(place.sigma),
        generations=GENERATIONS,
        **options,
    )


def sum_seconds(run: Run) -> float:
    """Return the time that a run simulated [s]."""
    return sum(entry.outcome.seconds for entry in run.record.entries)


def make_plain_snakes(snake: ev.Champion, seed: int) -> dict[str, ev.Champion]:
    """Return the row of a snake's champion with the genotype zero, and with a random one."""
    rng = np.random.default_rng((seed, 12))
    count = len(snake.genotype)
    genes = {"zero": np.zeros(count), "random": rng.normal(0.0, 0.5, count)}
    return {
        name: replace(snake, genotype=tuple(values.tolist()), successes=0, trials=0)
        for name, values in genes.items()
    }
