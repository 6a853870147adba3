"""Ways to make the trials of a search cheaper; candidates for the champion are always tried in full.

Each is a function that tries jobs, for `evolve(simulate=...)`. It changes the samples of a generation only.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from evolution._src.backends.environment_options import sort_options
from evolution._src.backends.outcome import Outcome
from evolution._src.backends.rollout import simulate
from evolution._src.backends.trials import Job
from evolution._src.search.record import SAMPLE

_KIND = 1
"""Place of the kind of a trial in its seed."""
_LEAST_KNOWN = 48
"""Outcomes from which a surrogate predicts."""
_MOST_KNOWN = 300
_NOISE = 0.1
"""Variance of a trial's progress, relative to that of all, as the surrogate takes it."""


@dataclass
class Tried:
    """Simulated time and genotypes of the samples.

    Attributes:
        seconds: simulated [s].
        genotypes: tried at least once.
        spared: genotypes that were not tried, or not in all trials.
    """

    seconds: float = 0.0
    genotypes: int = 0
    spared: int = 0


@dataclass
class FullTrials:
    """Try every sample in all its trials; what the others are compared with."""

    tried: Tried = field(default_factory=Tried)

    def __call__(self, jobs: Sequence[Job], threads: int) -> list[Outcome]:
        """Try jobs."""
        if not jobs or jobs[0].trials.seed[_KIND] != SAMPLE:
            return simulate(jobs, threads)
        outcomes = self.try_samples(jobs, threads)
        self.tried.seconds += sum(outcome.seconds for outcome in outcomes)
        self.tried.genotypes += len(jobs)
        return outcomes

    def try_samples(self, jobs: Sequence[Job], threads: int) -> list[Outcome]:
        """Try the samples of a generation."""
        return simulate(jobs, threads)


@dataclass
class OtherOptions(FullTrials):
    """Try samples with other options of the environment, such as a coarser time step.

    Attributes:
        options: of the environment.
    """

    options: dict[str, float] = field(default_factory=dict)

    def try_samples(self, jobs: Sequence[Job], threads: int) -> list[Outcome]:
        """Try the samples of a generation."""
        return simulate([_replace_options(job, self.options) for job in jobs], threads)


def _replace_options(job: Job, options: dict[str, float]) -> Job:
    episode = job.trials.episode
    environment = sort_options(dict(episode.environment) | options, episode.task)
    return job._replace(trials=replace(job.trials, episode=replace(episode, environment=environment)))


@dataclass
class Racing(FullTrials):
    """Try each sample once; those that fail get no more trials, unless they are in the better half."""

    def try_samples(self, jobs: Sequence[Job], threads: int) -> list[Outcome]:
        """Try the samples of a generation."""
        rest = jobs[0].trials.count - 1
        first = simulate([_with_trials(job, 1, 0) for job in jobs], threads)
        if rest < 1:
            return first
        middle = float(np.median([outcome.progress for outcome in first]))
        more = [k for k, outcome in enumerate(first) if all(outcome.succeeded) or outcome.progress > middle]
        others = dict(
            zip(more, simulate([_with_trials(jobs[k], rest, 1) for k in more], threads), strict=True)
        )
        self.tried.spared += len(jobs) - len(more)
        return [
            _join(outcome, others[k])
            if k in others
            else replace(outcome, succeeded=(*outcome.succeeded, *(False,) * rest))
            for k, outcome in enumerate(first)
        ]


def _with_trials(job: Job, count: int, block: int) -> Job:
    return job._replace(trials=replace(job.trials, count=count, seed=(*job.trials.seed, block)))


def _join(one: Outcome, two: Outcome) -> Outcome:
    share = one.trials / (one.trials + two.trials)
    return Outcome(
        progress=share * one.progress + (1 - share) * two.progress,
        effort=share * one.effort + (1 - share) * two.effort,
        succeeded=one.succeeded + two.succeeded,
        seconds=one.seconds + two.seconds,
        diverged=one.diverged + two.diverged,
    )


@dataclass
class Surrogate(FullTrials):
    """Try only the half of a generation that a Gaussian process takes for the better; predict the others' progress."""

    known: list[tuple[np.ndarray, float]] = field(default_factory=list)

    def try_samples(self, jobs: Sequence[Job], threads: int) -> list[Outcome]:
        """Try the samples of a generation."""
        genotypes = np.array([job.genotype for job in jobs])
        predicted = None
        chosen = list(range(len(jobs)))
        if len(self.known) >= _LEAST_KNOWN:
            predicted = _predict(self.known[-_MOST_KNOWN:], genotypes)
            order = np.argsort(-predicted, kind="stable")
            chosen = sorted(order[: (len(jobs) + 1) // 2].tolist())
        outcomes = dict(zip(chosen, simulate([jobs[k] for k in chosen], threads), strict=True))
        self.known += [(genotypes[k], outcome.progress) for k, outcome in outcomes.items()]
        self.tried.spared += len(jobs) - len(chosen)
        if predicted is None:
            return list(outcomes.values())
        # A genotype that was not tried is never fitter than the least fit that was.
        least = min(outcome.progress for outcome in outcomes.values())
        failed = (False,) * jobs[0].trials.count
        return [
            outcomes.get(k) or Outcome(min(float(predicted[k]), least), 0.0, failed) for k in range(len(jobs))
        ]


def _predict(known: Sequence[tuple[np.ndarray, float]], genotypes: np.ndarray) -> np.ndarray:
    """Return the mean of a Gaussian process; its length is the median distance of what is known."""
    places = np.array([place for place, _ in known])
    values = np.array([value for _, value in known])
    mean, spread = values.mean(), values.std() + 1e-9
    square = ((places[:, None] - places[None]) ** 2).sum(axis=-1)
    scale = np.median(square[square > 0]) if (square > 0).any() else 1.0
    inner = np.exp(-square / scale) + _NOISE * np.eye(len(places))
    between = np.exp(-((genotypes[:, None] - places[None]) ** 2).sum(axis=-1) / scale)
    return mean + spread * (between @ np.linalg.solve(inner, (values - mean) / spread))


WAYS: dict[str, Callable[[], FullTrials]] = {
    "full": FullTrials,
    "coarse physics": lambda: OtherOptions(options={"timestep": 0.01, "frame_skip": 2}),
    "short trials": lambda: OtherOptions(options={"duration": 45.0, "stuck_time": 2.5}),
    "racing": Racing,
    "surrogate": Surrogate,
}
"""Name -> what tries the samples of one run."""
