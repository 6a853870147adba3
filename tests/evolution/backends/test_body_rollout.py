"""Bodies that do not fit into an arena: they fail, and all others are tried as if they were alone."""

import logging
from collections import OrderedDict

import numpy as np

import evolution as ev
import symbrion_gym as sg
from evolution._src.backends import body_rollout, rollout
from evolution._src.backends.trials import FAILED_PROGRESS, Job, make_failure
from evolution._src.errors import NoEnvironmentError
from evolution._src.search.bodies.genome import parse_genome
from symbrion_gym._src.tasks.traverse import FarEnd

WIDE = "l(l(.))r(.)"
"""Four modules across the way."""
ROW = "b(.)"


def make_config(arena):
    return ev.BodyEvolutionConfig(
        arena=str(arena),
        task="traverse",
        track_control="skid",
        duration=2.0,
        bodies=ev.BodiesConfig("exhaustive", largest=2),
        learning=ev.LearningConfig(levels=(2,), population_size=4),
        iterations=1,
    )


def test_a_search_goes_on_where_a_body_does_not_fit(monkeypatch, caplog):
    config = make_config("stairs")
    usual = ev.evolve_bodies(config)
    find = FarEnd.find

    def refuse_two(self, arena, organism, start):
        if organism.num_modules == 2:
            raise sg.ArenaError("no way is wide enough")
        return find(self, arena, organism, start)

    monkeypatch.setattr(FarEnd, "find", refuse_two)
    monkeypatch.setattr(rollout, "_environments", OrderedDict())
    with caplog.at_level(logging.WARNING):
        run = ev.evolve_bodies(config)
    known, found = (
        {result.body.num_modules: result for result in each.results if result.level == 0}
        for each in (usual, run)
    )
    assert known[2].seconds > 0.0
    assert (found[2].successes, found[2].seconds, found[2].fitness) == (0, 0.0, FAILED_PROGRESS)
    assert found[1].fitness == known[1].fitness
    assert "a body of 2 modules counts as failed: the environment cannot be made: no way" in caplog.text


def test_jobs_of_the_others_are_tried_together(monkeypatch):
    config = make_config("gsrm")
    trials = {text: config.make_trials(parse_genome(text), 3, ()) for text in (ROW, WIDE, ".")}
    calls = []

    def simulate(jobs, threads):
        calls.append(len(jobs))
        if any(job.trials == trials[WIDE] for job in jobs):
            raise NoEnvironmentError("the environment cannot be made: too wide")
        return [make_failure(job.trials, f"tried {job.genotype[0]:g}") for job in jobs]

    monkeypatch.setattr(rollout, "simulate", simulate)
    jobs = [
        Job(np.array([float(number)]), trials[text])
        for number, text in enumerate((ROW, WIDE, ".", ROW, WIDE))
    ]
    outcomes = body_rollout.simulate_bodies(jobs, 2)
    assert [outcome.error for outcome in outcomes] == [
        "tried 0",
        "the environment cannot be made: too wide",
        "tried 2",
        "tried 3",
        "the environment cannot be made: too wide",
    ]
    assert calls == [5, 2, 2, 1]
