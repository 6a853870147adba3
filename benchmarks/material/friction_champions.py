"""Champions on a course with ice, evolved on what robots felt or on one friction for all."""

from pathlib import Path
from typing import Any, NamedTuple

from scipy.stats import binomtest

from evolution._src.backends.trials import Randomization
from evolution._src.champions.playback import judge
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve
from evolution._src.search.validation import Validation
from reconstruction._src.reconstruct import reconstruct
from reconstruction._src.scans.preprocess import preprocess, thin
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.course import Course
from symbrion_gym._src.arenas.making import make_arena
from symbrion_gym._src.ready_made import SPACING
from symbrion_gym._src.sensing.friction_robot import FrictionRobot
from symbrion_gym._src.sensing.survey import survey

ICE = Course(pit=0.0, friction_patches=((-1.6, -0.4, -0.25, 1.0, 0.15),))
"""Two ramps; ice on the first, from its left side to 0.25 m right of the middle: straight ahead leads onto it."""
START, GOAL = (-2.75, 0.0), (0.1, 0.0)
GENERATIONS = 10
"""Small budgets: two genes."""
_JUDGING_SEED = 77


class Models(NamedTuple):
    """Folders of the arenas.

    Attributes:
        truth: the course as it is.
        felt: as surveyed, with the friction that robots felt.
        one: as surveyed, with one friction for all.
        map: friction and half-width of the patches that were felt.
    """

    truth: str
    felt: str
    one: str
    map: list[tuple[float, float]]


def make_models(folder: Path, seed: int = 0) -> Models:
    """Survey the course, reconstruct it, and save it with both frictions."""
    truth = Arena.from_course(ICE)
    log = survey(truth, seed=seed, friction=FrictionRobot(spacing=0.35))
    surface = reconstruct(thin(preprocess(log), SPACING), units=1500, seed=seed)
    felt = make_arena(surface.refine(slip=log.slip), seed=seed)
    arenas = {"truth": truth, "felt": felt, "one": make_arena(surface, kind="convex", seed=seed)}
    for name, arena in arenas.items():
        arena.save(folder / name)
    estimate = surface.refine(slip=log.slip).friction
    assert estimate is not None
    known = [(round(patch.friction, 4), round(patch.half_width, 4)) for patch in estimate.patches]
    truth_folder, felt_folder, one_folder = (str(folder / name) for name in arenas)
    return Models(truth_folder, felt_folder, one_folder, known)


def evolve_champion(models: Models, name: str, seed: int, trials: int) -> dict[str, Any]:
    """Evolve on an arena of `Models`, and try the champion there and in the truth."""
    arena = getattr(models, name)
    config = EvolutionConfig(
        arena=arena,
        seed=seed,
        generations=GENERATIONS,
        workers=1,
        population_size=8,
        trials=2,
        randomization=Randomization(stretch=(1.0,)),
        validation=Validation(rounds=(8, 8)),
        modules=1,
        task="reach",
        start=START,
        goal=GOAL,
        controller="benchmarks.material.detour:Detour",
        track_control="skid",
        timestep=0.01,
        frame_skip=2,
        duration=50.0,
    )
    run = evolve(config)
    champion = run.champion
    assert champion is not None
    there, truth = (judge(champion, place, trials, _JUDGING_SEED) for place in (arena, models.truth))
    return {
        "seed": seed,
        "genotypes": int(run.history["evaluations"][-1]),
        "genotype": [round(float(gene), 3) for gene in champion.genotype],
        "model": [there.successes, trials],
        "truth": [truth.successes, trials],
    }


def find_interval(successes: int, trials: int) -> tuple[float, float]:
    """Return the 95 % interval of a share (Wilson)."""
    interval = binomtest(successes, trials).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)
