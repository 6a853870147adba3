"""Quality diversity with pyribs (pip install ribs): gaits by how high and how far to the left a module comes."""

import numpy as np
from ribs.archives import GridArchive
from ribs.emitters import EvolutionStrategyEmitter
from ribs.schedulers import Scheduler

import evolution as ev


def main(generations: int = 20, workers: int = 2, **options) -> GridArchive:
    """Return the archive: the fittest genotype of each cell."""
    with ev.Evaluator(
        controller="reactive", descriptors=("extremes",), workers=workers, **options
    ) as evaluator:
        initial = np.array(evaluator.controller.initial)
        archive = GridArchive(solution_dim=len(initial), dims=(20, 20), ranges=[(0, 0.6), (-0.5, 0.5)])
        emitter = EvolutionStrategyEmitter(archive, x0=initial, sigma0=0.2, batch_size=12, seed=1)
        scheduler = Scheduler(archive, [emitter])
        for _ in range(generations):
            fitness, outcomes = evaluator(scheduler.ask())
            highest = [np.mean([trial["highest"] for trial in each.descriptors], axis=0) for each in outcomes]
            scheduler.tell(fitness, np.array(highest)[:, [2, 1]])
    return archive
