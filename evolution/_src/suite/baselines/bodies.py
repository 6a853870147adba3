"""Baselines where the body is free: the algorithms of `symbrion evolve --bodies`; each body learns a little."""

from __future__ import annotations

import numpy as np

from evolution._src.backends.trials import Randomization
from evolution._src.body_search.algorithms.making import make_algorithm
from evolution._src.body_search.config import BodiesConfig, BodyEvolutionConfig
from evolution._src.body_search.learner import Learner
from evolution._src.body_search.learning import LearningConfig, Lesson
from evolution._src.body_search.record import BodyRecord
from evolution._src.suite.baselines.practice import CONTROLLER, Practice
from evolution._src.suite.submission import SCORING
from evolution._src.suite.tasks import LARGEST, find_arena

LEARNING = LearningConfig(population_size=6, rungs=(2,), exam_trials=1, is_inherited=True)
"""A child begins with the genes of its parent, as far as they have the same names: they, then six around them."""
RUNGS = LearningConfig(population_size=6, rungs=(1, 2, 4), exam_trials=1, is_examined_early=False)
"""Of `IN_RUNGS`; the first rung is the zero genotype alone."""
IN_RUNGS = ("niches", "surrogate")
CHILDREN, POPULATION = 4, 6
"""Bodies of an iteration, and parents."""


def search_bodies(algorithm: str, practice: Practice, rng: np.random.Generator) -> None:
    """Let an algorithm propose bodies until the budget is spent; the body that did best in its exam is kept.

    Args:
        algorithm: name of `evolution._src.body_search.config.ALGORITHMS`.
        practice: whose body is free.
        rng: drawn from.
    """
    config = _make_config(algorithm, practice, int(rng.integers(2**31)))
    record = BodyRecord()
    searcher, learner = make_algorithm(config), Learner(config, record, practice.backend)
    paid: set[tuple[str, int]] = set()
    while practice.has_time():
        lessons: list[Lesson] = []
        for assignment in searcher.ask():
            if not practice.has_time():
                return
            lessons += learner.learn([assignment])
            for rung in record.find_until(lessons[-1]):
                if (rung.pupil.key, rung.rung) not in paid:
                    paid.add((rung.pupil.key, rung.rung))
                    practice.seconds += rung.seconds
            _offer(practice, lessons[-1])
        searcher.tell(lessons)


def _offer(practice: Practice, lesson: Lesson) -> None:
    fitness = np.array([lesson.fitness])
    practice.offer(lesson.pupil.body.to_organism(), np.array([lesson.genotype]), fitness)


def _make_config(algorithm: str, practice: Practice, seed: int) -> BodyEvolutionConfig:
    task = practice.task
    return BodyEvolutionConfig(
        arena=find_arena(task, in_truth=False),
        seed=seed,
        controller=CONTROLLER,
        randomization=Randomization(stretch=(1.0,)),
        scoring=SCORING,
        bodies=BodiesConfig(
            algorithm=algorithm, largest=LARGEST, children=CHILDREN, population_size=POPULATION
        ),
        learning=RUNGS if algorithm in IN_RUNGS else LEARNING,
        **task.make_options(),
    )
