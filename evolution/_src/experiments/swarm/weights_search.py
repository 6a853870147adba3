"""CMA-ES over the weights of the behaviors: robots that dock sooner, so that a swarm assembles faster."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from evolution._src.errors import RunError
from evolution._src.experiments.swarm.docking_trials import TrialSetup, run_docking_trials
from evolution._src.search.cmaes import Space, Strategy
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.base.range_checks import check_counts, check_positive
from symbrion_gym._src.swarm.behavior.weights import BehaviorWeights, list_bounds

EVOLVED = (
    "locate_speed", "lookahead", "align_distance", "align_angle", "align_offset", "dock_speed", "dock_time",
    "recover_speed", "recover_time",
)  # fmt: skip
"""The weights of locating, aligning, docking and recovering, which take most of the time of an assembly."""
START_POSITIONS = 5
"""Start positions of the docking trials."""


@dataclass(frozen=True)
class WeightsConfig:
    """Configuration of `evolve_weights`.

    Attributes:
        seed: decides everything: equal seeds give equal results.
        names: the weights that evolve; the others keep their values.
        pairs: docking trials of a candidate, all at once; a generation meets the same ones, each generation others.
        duration: a trial that takes longer counts as this long [s].
        population_size: candidates of a generation.
        generations: how many.
        sigma: first step size, as a share of the range of each weight.
        base: where the search begins.

    Raises:
        RunError: a value is out of range, or there is no such weight.
    """

    seed: int = 0
    names: tuple[str, ...] = EVOLVED
    pairs: int = 15
    duration: float = 60.0
    population_size: int = 8
    generations: int = 6
    sigma: float = 0.15
    base: BehaviorWeights = field(default_factory=BehaviorWeights)

    def __post_init__(self) -> None:
        check_counts(self, ("pairs", "population_size", "generations"), RunError)
        check_positive(self, ("duration", "sigma"), RunError)
        if self.seed < 0:
            raise RunError(f"seed is {self.seed}; give 0 or more")
        unknown = sorted(set(self.names) - set(list_bounds()))
        if unknown or not self.names:
            raise RunError(f"names are {self.names}; give some of: {', '.join(list_bounds())}")


class WeightsResult(NamedTuple):
    """What evolved.

    Attributes:
        weights: at the mean of the last distribution.
        fitness: of all candidates in turn: the mean time to lock, negated [s].
    """

    weights: BehaviorWeights
    fitness: Float[np.ndarray, " C"]


def evolve_weights(config: WeightsConfig, progress: Progress = silent) -> WeightsResult:
    """Evolve weights with which two robots dock sooner, in docking trials as on the hardware, on level ground.

    Pairs stand for the assembly: many of them are simulated at once, and their times vary less from seed to seed than
    those of whole swarms. Whether a swarm of many robots gains as well is for `find_gathering_time` to judge.
    """
    names, count = config.names, len(config.names)
    start = tuple(config.base.to_genotype(names).tolist())
    space = Space(names, (0.0,) * count, (1.0,) * count, start, (1.0,) * count)
    strategy = Strategy(space, config.sigma, config.population_size, config.seed)
    rows = []
    for generation in range(config.generations):
        genotypes = strategy.ask()
        weights = [BehaviorWeights.from_genotype(each, names, config.base) for each in genotypes]
        trial_seed = int(np.random.SeedSequence((config.seed, generation)).generate_state(1)[0])
        fitness = -find_docking_times(weights, config, trial_seed)
        strategy.tell(genotypes, fitness)
        rows.append(fitness)
        progress("weights", (generation + 1) / config.generations)
    best = BehaviorWeights.from_genotype(np.clip(strategy.mean, 0.0, 1.0), names, config.base)
    return WeightsResult(best, np.concatenate(rows))


def find_docking_times(
    weights: Sequence[BehaviorWeights], config: WeightsConfig, seed: int
) -> Float[np.ndarray, " P"]:
    """Return the mean times that pairs of robots take to dock [s]; one that does not counts as `duration`.

    The pairs of all candidates are simulated at once.
    """
    positions = np.tile(1 + np.arange(config.pairs) % START_POSITIONS, len(weights))
    stacked = BehaviorWeights.stack(weights, 2 * config.pairs)
    times = run_docking_trials(
        positions, replace(TrialSetup(), duration=config.duration, weights=stacked), seed
    )
    seconds = np.where(times.locked, times.seconds, config.duration)
    return seconds.reshape(len(weights), config.pairs).mean(axis=1)
