"""The fitness of one body's controllers over a grid of genes: a whole landscape in one batch."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from evolution._src.backends.outcome import Outcome
from evolution._src.errors import RunError
from evolution._src.limits import MAX_GENOTYPES
from evolution._src.search.evaluation import Evaluator


class Grid(NamedTuple):
    """Outcomes over a grid of genes.

    Attributes:
        genes: names of the genes that vary, one for each axis.
        values: their values.
        fitness: one axis for each gene; higher is better.
        success: share of the trials that succeed, likewise.
        genotypes: likewise, with the genes of each on the last axis.
        outcomes: of all genotypes, the last axis first to vary.
    """

    genes: tuple[str, ...]
    values: tuple[Float[np.ndarray, " _"], ...]
    fitness: Float[np.ndarray, "..."]
    success: Float[np.ndarray, "..."]
    genotypes: Float[np.ndarray, "... G"]
    outcomes: list[Outcome]


def evaluate_grid(
    genes: Mapping[str, Sequence[float]],
    genotype: Sequence[float] | Float[np.ndarray, " G"] | None = None,
    **options: Any,
) -> Grid:
    """Try one body's controllers over a grid of some genes, all under the same conditions and in one batch.

    Args:
        genes: name of a gene -> its values.
        genotype: the other genes; None for the start of the controller.
        options: as of `Evaluator`: arena, modules, controller, backend and so on.

    Raises:
        RunError: the controller has no such gene, the grid is empty or too large, or an option is refused.
    """
    with Evaluator(**options) as evaluator:
        names = evaluator.controller.parameters
        unknown = sorted(set(genes) - set(names))
        if unknown or not genes:
            raise RunError(f"genes has {unknown or 'no names'}; there are {', '.join(names)}")
        values = tuple(np.asarray(each, dtype=float).reshape(-1) for each in genes.values())
        shape = tuple(len(each) for each in values)
        if not 0 < np.prod(shape, dtype=float) <= MAX_GENOTYPES:
            raise RunError(f"genes make a grid of {shape}; 1 to {MAX_GENOTYPES} genotypes are possible")
        base = np.array(evaluator.controller.initial if genotype is None else genotype, dtype=float)
        if base.shape != (len(names),):
            raise RunError(f"genotype has shape {base.shape}; give one number for each of {', '.join(names)}")
        genotypes = np.tile(base, (*shape, 1))
        for gene, each in zip(genes, np.meshgrid(*values, indexing="ij"), strict=True):
            genotypes[..., names.index(gene)] = each
        fitness, outcomes = evaluator(genotypes.reshape(-1, len(names)))
    success = np.array([outcome.successes / outcome.trials for outcome in outcomes])
    return Grid(tuple(genes), values, fitness.reshape(shape), success.reshape(shape), genotypes, outcomes)
