"""The strategy solves something, and two of equal seed are equal to the bit."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from evolution._src.search.cmaes import Strategy


def make_strategy(sigma: float = 0.3, population_size: int = 8, seed: int = 0, genes: int = 6) -> Strategy:
    law: Any = SimpleNamespace(lower=(-1.5,) * genes, upper=(1.5,) * genes)
    return Strategy(law, (0.0,) * genes, sigma, population_size, seed)


def climb(strategy: Strategy, generations: int) -> list[np.ndarray]:
    asked = []
    for _ in range(generations):
        genotypes = strategy.ask()
        asked.append(genotypes)
        strategy.tell(genotypes, -((genotypes - 0.4) ** 2).sum(axis=1))
    return asked


def test_it_finds_the_optimum():
    strategy = make_strategy(population_size=12)
    climb(strategy, 60)
    assert np.abs(strategy.mean - 0.4).max() < 1e-3


def test_equal_seeds_give_equal_genotypes_whatever_else_is_drawn_and_leave_the_global_state_alone():
    first = climb(make_strategy(seed=3), 20)
    np.random.seed(99)  # noqa: NPY002
    expected = np.random.uniform(size=3)  # noqa: NPY002
    np.random.seed(99)  # noqa: NPY002
    second = climb(make_strategy(seed=3), 20)
    assert np.array_equal(np.random.uniform(size=3), expected)  # noqa: NPY002
    assert np.array_equal(first, second)
    assert not np.array_equal(first[0], climb(make_strategy(seed=4), 1)[0])


def test_a_single_gene_is_searched_and_bounds_are_kept_also_where_the_step_is_large():
    asked = climb(make_strategy(sigma=1.0, genes=1), generations=20)
    assert np.abs(asked).max() <= 1.5
    assert abs(asked[-1].mean() - 0.4) < 0.1
    assert np.abs([make_strategy(sigma=0.8).ask() for _ in range(5)]).max() <= 1.5


def test_it_restarts_with_twice_the_population_on_a_plain():
    strategy = make_strategy()
    for _ in range(400):
        strategy.tell(genotypes := strategy.ask(), np.zeros(len(genotypes)))
        if strategy.restarts:
            break
    assert strategy.restarts == 1
    assert len(strategy.ask()) == strategy.population_size == 16
