"""A search for bodies on made physics: larger bodies go farther."""

import evolution as ev
from evolution._src.backends.scoring import Outcome


def simulate(jobs, threads):
    return [
        Outcome(
            0.1 * job.trials.find_organism().num_modules + float(job.genotype.sum()) * 1e-3,
            0.01,
            (False,) * job.trials.count,
            seconds=1.0,
        )
        for job in jobs
    ]


def make_config(**changes):
    values = {
        "track_control": "skid",
        "bodies": ev.BodiesConfig(algorithm="exhaustive", largest=3, children=20),
        "learning": ev.LearningConfig(population_size=4, levels=(1,), exam_trials=1),
        "iterations": 1,
    }
    return ev.BodyEvolutionConfig(**values | changes)
