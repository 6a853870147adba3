"""The strategy solves something, and two of equal seed are equal to the bit."""

import numpy as np
import pytest

from evolution._src.search.cmaes import Space, Strategy


def make_space(size: int = 6) -> Space:
    names = tuple(f"gene_{index}" for index in range(size))
    return Space(names, (-1.5,) * size, (1.5,) * size, (0.0,) * size, (1.0,) * size)


def climb(strategy: Strategy, generations: int) -> list[np.ndarray]:
    asked = []
    for _ in range(generations):
        genotypes = strategy.ask()
        asked.append(genotypes)
        strategy.tell(genotypes, -((genotypes - 0.4) ** 2).sum(axis=1))
    return asked


def test_it_finds_the_optimum():
    strategy = Strategy(make_space(), 0.3, 12, seed=0)
    climb(strategy, 60)
    assert np.abs(strategy.mean - 0.4).max() < 1e-3


def test_equal_seeds_give_equal_genotypes_whatever_else_is_drawn():
    first = climb(Strategy(make_space(), 0.3, 8, seed=3), 20)
    np.random.seed(99)  # noqa: NPY002
    second = climb(Strategy(make_space(), 0.3, 8, seed=3), 20)
    other = climb(Strategy(make_space(), 0.3, 8, seed=4), 20)
    assert np.array_equal(first, second)
    assert not np.array_equal(first[0], other[0])


def test_a_single_gene_is_searched_also_where_the_step_is_large():
    space = Space(("gene",), (0.0,), (1.0,), (0.0,), (1.0,))
    asked = climb(Strategy(space, sigma=0.5, population_size=6, seed=1), generations=20)
    assert np.min(asked) >= 0.0
    assert np.max(asked) <= 1.0
    assert abs(asked[-1].mean() - 0.4) < 0.05


def test_the_global_random_state_is_left_alone():
    np.random.seed(5)  # noqa: NPY002
    expected = np.random.uniform(size=3)  # noqa: NPY002
    np.random.seed(5)  # noqa: NPY002
    climb(Strategy(make_space(), 0.3, 8, seed=0), 3)
    assert np.array_equal(np.random.uniform(size=3), expected)  # noqa: NPY002


def test_genotypes_keep_their_bounds():
    strategy = Strategy(make_space(), 0.8, 12, seed=0)
    assert np.abs([strategy.ask() for _ in range(5)]).max() <= 1.5


def test_it_restarts_with_twice_the_population_on_a_plain():
    strategy = Strategy(make_space(), 0.3, 8, seed=0)
    for _ in range(400):
        strategy.tell(genotypes := strategy.ask(), np.zeros(len(genotypes)))
        if strategy.restarts:
            break
    assert strategy.restarts == 1
    assert len(strategy.ask()) == strategy.population_size == 16


def test_a_space_refuses_lengths_that_differ():
    with pytest.raises(ValueError, match="differ in length"):
        Space(("a", "b"), (0.0,), (1.0,), (0.5,), (1.0,))
