"""A grid of genes: every combination once, in one batch, the other genes as given."""

import numpy as np
import pytest

import evolution as ev
from evolution._src.backends.outcome import Outcome
from evolution._src.errors import RunError

NAMES = ev.Evaluator(modules=4, controller="reactive").controller.parameters


class Batches:
    """Stand-in for physics whose progress is the first gene plus ten times the second one."""

    def __init__(self):
        self.sizes = []

    def __call__(self, jobs, threads):
        self.sizes.append(len(jobs))
        return [
            Outcome(float(job.genotype[0] + 10 * job.genotype[1]), 0.0, (job.genotype[0] > 0,) * 2)
            for job in jobs
        ]


def evaluate(genes, genotype=None, **options):
    options = {"simulate": Batches(), "scoring": lambda outcome, body: outcome.progress} | options
    return ev.evaluate_grid(genes, genotype, modules=4, controller="reactive", trials=2, **options)


def test_every_combination_is_tried_once_in_one_batch():
    batches = Batches()
    grid = evaluate({NAMES[1]: [0.1, 0.2], NAMES[0]: [-0.5, 0.0, 0.5]}, simulate=batches)
    assert batches.sizes == [6]
    np.testing.assert_allclose(grid.fitness, [[0.5, 1.0, 1.5], [1.5, 2.0, 2.5]])
    np.testing.assert_array_equal(grid.success, [[0.0, 0.0, 1.0]] * 2)
    assert grid.genes == (NAMES[1], NAMES[0])
    assert grid.genotypes.shape == (2, 3, len(NAMES))
    assert [outcome.progress for outcome in grid.outcomes] == grid.fitness.reshape(-1).tolist()


def test_other_genes_are_as_given():
    genotype = np.linspace(-0.4, 0.4, len(NAMES))
    grid = evaluate({NAMES[0]: [0.3]}, genotype)
    np.testing.assert_array_equal(grid.genotypes[0], [0.3, *genotype[1:]])


def test_physics_gives_what_evaluate_gives():
    options = {"arena": "truth", "modules": 2, "controller": "posture", "trials": 1, "duration": 0.5}
    name = ev.Evaluator(**options).controller.parameters[0]
    grid = ev.evaluate_grid({name: [0.0, 0.5]}, **options)
    alone = [ev.evaluate(genotype, **options).fitness[0] for genotype in grid.genotypes]
    assert grid.fitness.tolist() == alone


@pytest.mark.parametrize(
    ("genes", "genotype", "message"),
    [
        ({"wings": [1.0]}, None, r"genes has \['wings'\]; there are"),
        ({}, None, "genes has no names"),
        ({NAMES[0]: []}, None, r"grid of \(0,\)"),
        ({NAMES[0]: np.zeros(1000), NAMES[1]: np.zeros(1000)}, None, r"grid of \(1000, 1000\)"),
        ({NAMES[0]: [0.0]}, [0.0], r"genotype has shape \(1,\)"),
    ],
)
def test_what_makes_no_grid_is_refused(genes, genotype, message):
    with pytest.raises(RunError, match=message):
        evaluate(genes, genotype)
