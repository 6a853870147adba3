"""Any algorithm can search: here CMA-ES of pycma, by ask and tell around environments that stay compiled."""

import cma

import evolution as ev


def main(generations: int = 20) -> tuple[list[float], float]:
    """Return the fittest genotype found and its fitness."""
    with ev.Evaluator(arena="truth", controller="reactive", trials=3, workers=2) as evaluator:
        search = cma.CMAEvolutionStrategy(evaluator.controller.initial, 0.15, {"seed": 1, "verbose": -9})
        for generation in range(generations):
            genotypes = search.ask()
            search.tell(genotypes, list(-evaluator(genotypes, seed=generation).fitness))
    return list(search.result.xbest), -search.result.fbest
