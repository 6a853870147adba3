"""Baselines by their names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from evolution._src.backends.making import Backend
from evolution._src.errors import RunError
from evolution._src.suite.baselines import archives
from evolution._src.suite.baselines.bodies import search_bodies
from evolution._src.suite.baselines.chance import do_nothing, draw
from evolution._src.suite.baselines.evolving import run_cmaes, run_genetic
from evolution._src.suite.baselines.practice import CONTROLLER, Baseline, Practice
from evolution._src.suite.submission import Entry, find_score
from evolution._src.suite.tasks import BUDGET, SuiteTask
from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.range_checks import check_choice
from symbrion_gym._src.robot.body_plans import organism_to_text


@dataclass(frozen=True)
class Method:
    """A baseline.

    Attributes:
        given: for tasks that give the body; None where it does not suit these.
        free: for tasks in which the method chooses the body.
        descriptors: what outcomes keep for it.
        needs: extra that has to be installed.
    """

    given: Baseline | None
    free: Baseline
    descriptors: tuple[str, ...] = ()
    needs: str | None = None

    def suits(self, task: SuiteTask) -> bool:
        """Return whether it can run on a task."""
        return task.body is None or self.given is not None


METHODS: Mapping[str, Method] = {
    "zero": Method(do_nothing, do_nothing),
    "random": Method(draw, draw),
    "cmaes": Method(run_cmaes, run_cmaes),
    "genetic": Method(run_genetic, partial(search_bodies, "genetic")),
    "map_elites": Method(
        archives.run_map_elites, partial(search_bodies, "map_elites"), archives.DESCRIPTORS, "ribs"
    ),
    "cma_mae": Method(archives.run_cma_mae, partial(search_bodies, "cma_mae"), archives.DESCRIPTORS, "ribs"),
    "surrogate": Method(None, partial(search_bodies, "surrogate")),
    "niches": Method(None, partial(search_bodies, "niches")),
}
"""Baselines by name."""


def find_method(name: str) -> Method:
    """Return a baseline that can run here.

    Raises:
        RunError: there is none of this name.
        MissingExtraError: its extra is not installed.
    """
    check_choice("method", name, tuple(METHODS), RunError)
    method = METHODS[name]
    if method.needs is not None:
        require_extras(f"the baseline {name!r}", method.needs)
    return method


def run_baseline(name: str, task: SuiteTask, seed: int, backend: Backend, budget: float = BUDGET) -> Entry:
    """Return what a baseline finds for a task.

    Args:
        name: one of `METHODS`.
        task: the task.
        seed: seed of the method.
        backend: runs the trials.
        budget: simulated time that it may spend [s]; a generation that has begun is finished.

    Raises:
        RunError: there is no such baseline, or it does not suit the task.
        MissingExtraError: its extra is not installed.
    """
    method = find_method(name)
    run = method.free if task.body is None else method.given
    if run is None:
        raise RunError(
            f"the baseline {name!r} searches bodies, and {task.name!r} gives one; leave the task out"
        )
    rng = np.random.default_rng((seed, *task.name.encode(), *name.encode()))
    practice = Practice(task, backend, budget, method.descriptors if task.body is not None else ())
    run(practice, rng)
    found = practice.best
    assert found is not None
    plan = organism_to_text(found.body)
    scan, truth = (
        find_score(task, plan, CONTROLLER, found.genotype, in_truth, backend) for in_truth in (False, True)
    )
    genes = tuple(float(gene) for gene in found.genotype)
    return Entry(task.name, seed, plan, CONTROLLER, genes, practice.seconds, scan, truth)
