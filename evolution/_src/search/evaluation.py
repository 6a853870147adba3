"""The fitness of genotypes, on any backend: once, or call after call for a search of one's own."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float, Num

from evolution._src.backends.cluster import Backend, make_backend
from evolution._src.backends.pool import Simulate
from evolution._src.backends.scoring import Outcome, Scoring, ScoringFunction, compute_fitness, find_scoring
from evolution._src.backends.trials import Job, Trials, check_tried, find_trial_controller
from evolution._src.controllers.protocol import Controller, check_genotypes
from evolution._src.errors import RunError
from evolution._src.references import MAX_TRIALS
from evolution._src.search.record import Attempt, Entry
from reconstruction._src.base.range_checks import as_integers

if TYPE_CHECKING:
    from evolution._src.backends.trials import ArenaSource
    from symbrion_gym._src.robot.organism import Organism

Genotypes: TypeAlias = Num[np.ndarray, "*P G"] | Sequence[Num[np.ndarray, " G"]]
"""One genotype per row, a single one, or a list of them."""


def try_attempts(attempts: Sequence[Attempt], backend: Backend, scoring: Any, generation: int) -> list[Entry]:
    """Return an entry of a run for each of some attempts."""
    outcomes = backend.run([attempt.job for attempt in attempts])
    return [
        Entry(
            generation=generation,
            kind=attempt.kind,
            index=attempt.index,
            genotype=attempt.job.genotype,
            fitness=compute_fitness(scoring, outcome, attempt.job.trials.find_organism()),
            outcome=outcome,
            body=attempt.body,
        )
        for attempt, outcome in zip(attempts, outcomes, strict=True)
    ]


class Evaluation(NamedTuple):
    """Fitness of genotypes, and the outcomes of their trials.

    Attributes:
        fitness: fitness of each genotype; higher is better.
        outcomes: outcome of each genotype.
    """

    fitness: Float[np.ndarray, " P"]
    outcomes: list[Outcome]


class Evaluator:
    """Try genotypes call after call, on workers that keep their compiled environments: the tell of any algorithm.

    Example::

        with ev.Evaluator(arena="truth", modules=8, workers=2) as evaluator:
            search = cma.CMAEvolutionStrategy(evaluator.controller.initial, 0.15)
            while not search.stop():
                genotypes = search.ask()
                search.tell(genotypes, -evaluator(genotypes).fitness)

    Args:
        arena: name, folder, file, or an `Arena` (backend "batch").
        modules: number of modules of a snake, or an `Organism`; None: 8, unless `organism` is given.
        seed: seed of the conditions.
        trials: number of trials of each genotype.
        scoring: a `Scoring`, a function of (outcome, body), or "module:name" of one; None means a `Scoring` without
            a penalty for modules.
        backend: "batch", "processes" or "ray"; the results are equal. "warp" is a GPU in single precision, with results
            that are equal in distribution only.
        workers: threads, processes or tasks.
        address: address of an existing Ray cluster; None starts a local one.
        simulate: the function that tries jobs; None means physics.
        options: fields of `Trials`, such as `controller` ("reactive" by default; that of `evolve` is "path"), `start`,
            `organism` or `randomization`; all others are options of the environment.

    Attributes:
        trials: the trials of each genotype.
        controller: the controller, with names, bounds and start of its genes.

    Raises:
        RunError: an argument is unknown or out of range, or controller and body do not fit.
    """

    def __init__(
        self,
        arena: "ArenaSource" = "truth",
        modules: "int | Organism | None" = None,
        *,
        seed: int = 0,
        trials: int = 2,
        scoring: "ScoringFunction | str | None" = None,
        backend: str = "batch",
        workers: int = 1,
        address: str | None = None,
        simulate: Simulate | None = None,
        **options: Any,
    ) -> None:
        if options.get("randomization", ()) is None:
            del options["randomization"]
        (trials,) = as_integers("trials", [trials], 1, MAX_TRIALS, RunError)
        (seed,) = as_integers("seed", [seed], 0, np.inf, RunError)
        if modules is not None:
            options["modules"] = modules
        self.trials = Trials(arena=arena, count=trials, seed=(seed,), **options)
        self.controller: Controller = find_trial_controller(self.trials)
        self._scoring = find_scoring(Scoring(module=0.0) if scoring is None else scoring)
        self._backend = make_backend(backend, workers, address, simulate)
        self._is_closed = False

    def __enter__(self) -> "Evaluator":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop the workers."""
        self._is_closed = True
        self._backend.close()

    def __call__(self, genotypes: Genotypes, seed: int | None = None) -> Evaluation:
        """Try genotypes, all under the same conditions.

        Args:
            genotypes: one genotype per row, or a single one; lists of arrays as well. Genes beyond the bounds of the
                controller are tried as they are; `controller.lower` and `controller.upper` are for the search.
            seed: another number gives other conditions, such as the generation of a search that shall not adapt to
                a few; None: the same ones in each call.

        Raises:
            RunError: the genotypes do not fit the controller, none of them could be tried, or the evaluator is closed.
        """
        if self._is_closed:
            raise RunError("this evaluator is closed; make another one")
        genotypes = np.atleast_2d(np.asarray(genotypes, dtype=float))
        check_genotypes(self.controller, genotypes)
        trials = self.trials
        if seed is not None:
            (seed,) = as_integers("seed", [seed], 0, np.inf, RunError)
            trials = replace(trials, seed=(*trials.seed, seed))
        outcomes = self._backend.run([Job(genotype, trials) for genotype in genotypes])
        check_tried(outcomes)
        body = trials.find_organism()
        fitness = [compute_fitness(self._scoring, outcome, body) for outcome in outcomes]
        return Evaluation(np.array(fitness), outcomes)


def evaluate(
    genotypes: Genotypes,
    arena: "ArenaSource" = "truth",
    modules: "int | Organism | None" = None,
    seed: int = 0,
    **options: Any,
) -> Evaluation:
    """Try genotypes under the same randomized conditions, once; see `Evaluator`, whose arguments these are.

    Args:
        genotypes: one genotype per row, or a single one.
        arena: name, folder, file, or an `Arena` (backend "batch").
        modules: number of modules of a snake, or an `Organism`; None: 8, unless `organism` is given.
        seed: seed of the conditions.
        options: as of `Evaluator`.

    Raises:
        RunError: the genotypes do not fit the controller, or an argument is unknown or out of range.
    """
    with Evaluator(arena, modules, seed=seed, **options) as evaluator:
        return evaluator(genotypes)
