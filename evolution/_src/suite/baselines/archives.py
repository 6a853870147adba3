"""Quality diversity over the genes of a given body, by pyribs: MAP-Elites and CMA-MAE.

References:
    Mouret, Clune (2015), Illuminating search spaces by mapping elites, arXiv 1504.04909.
    Fontaine, Nikolaidis (2023), Covariance matrix adaptation MAP-annealing, GECCO.
    Tjanaka and others (2023), pyribs: a bare-bones Python library for quality diversity optimization, GECCO.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

from evolution._src.backends.outcome import FAILED_PROGRESS, Outcome
from evolution._src.backends.parts import read_organism
from evolution._src.body_search.algorithms.archives import ANNEALING_RATE
from evolution._src.body_search.descriptors import MAX_EFFORT
from evolution._src.suite.baselines.practice import POPULATION, SIGMA, Practice, find_law, score_all

DESCRIPTORS = ("extremes",)
"""What outcomes have to keep for `measure`."""
HIGHEST = 0.6
"""Modules that come higher than this above the zero of the arena count as this high [m]."""
CELLS = (6, 5)
"""Cells of the archive: by the highest place of a module, by effort."""
MUTATION = 0.3
"""Standard deviation of a child of an elite, in MAP-Elites."""


def run_map_elites(practice: Practice, rng: np.random.Generator) -> None:
    """Mutate elites of all cells alike; the zero genotype is the first one."""
    from ribs.emitters import GaussianEmitter

    archive = make_archive(practice, rng)
    lower, upper = _find_bounds(practice)
    emitter = GaussianEmitter(
        archive,
        sigma=MUTATION,
        x0=np.zeros(len(lower)),
        lower_bounds=lower,
        upper_bounds=upper,
        batch_size=POPULATION,
        seed=int(rng.integers(2**31)),
    )
    _fill(practice, archive, emitter)


def run_cma_mae(practice: Practice, rng: np.random.Generator) -> None:
    """Let CMA-ES climb where the archive improves, with thresholds that rise slowly; it begins at the zero genotype."""
    from ribs.emitters import EvolutionStrategyEmitter

    archive = make_archive(practice, rng, ANNEALING_RATE)
    lower, upper = _find_bounds(practice)
    emitter = EvolutionStrategyEmitter(
        archive,
        x0=np.zeros(len(lower)),
        sigma0=SIGMA,
        ranker="imp",
        selection_rule="mu",
        restart_rule="basic",
        lower_bounds=lower,
        upper_bounds=upper,
        batch_size=POPULATION,
        seed=int(rng.integers(2**31)),
    )
    _fill(practice, archive, emitter)


def measure(outcome: Outcome) -> Float[np.ndarray, " 2"]:
    """Return the highest place of a module [m] and the effort of one trial, inside the archive; zeros for a failure."""
    if not outcome.descriptors:
        return np.zeros(2)
    highest = float(np.mean([trial["highest"][2] for trial in outcome.descriptors]))
    return np.clip(np.array([highest, outcome.effort]), 0.0, np.array([HIGHEST, MAX_EFFORT]))


def make_archive(practice: Practice, rng: np.random.Generator, annealing_rate: float | None = None) -> Any:
    """Return an empty archive of genotypes, which draws elites by a seed of its own."""
    from ribs.archives import GridArchive

    rising = (
        {} if annealing_rate is None else {"learning_rate": annealing_rate, "threshold_min": FAILED_PROGRESS}
    )
    ranges = [(0.0, HIGHEST), (0.0, MAX_EFFORT)]
    size, seed = len(_find_bounds(practice)[0]), int(rng.integers(2**31))
    return GridArchive(solution_dim=size, dims=CELLS, ranges=ranges, seed=seed, **rising)


def _fill(practice: Practice, archive: Any, emitter: Any) -> None:
    """Try the zero genotype, then what the emitter asks for."""
    assert practice.task.body is not None
    body = read_organism(practice.task.body)
    genotypes = np.zeros((1, archive.solution_dim))
    outcomes = practice.run(body, genotypes)
    archive.add(genotypes, score_all(outcomes), np.array([measure(each) for each in outcomes]))
    while practice.has_time():
        genotypes = np.asarray(emitter.ask(), dtype=float)
        outcomes = practice.run(body, genotypes)
        fitness, measures = score_all(outcomes), np.array([measure(each) for each in outcomes])
        added = archive.add(genotypes, fitness, measures)
        emitter.tell(genotypes, fitness, measures, added)


def _find_bounds(practice: Practice) -> tuple[list[float], list[float]]:
    assert practice.task.body is not None
    law = find_law(practice.task, read_organism(practice.task.body))
    return list(law.lower), list(law.upper)
