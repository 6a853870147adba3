"""The strategy solves something, and two of equal seed are equal to the bit."""

import numpy as np
import pytest

from evolution._src.errors import RunError
from evolution._src.search.cmaes import CmaesConfig, Space, Strategy


def make_space(size: int = 6, with_integer: bool = False) -> Space:
    names = tuple(f"gene_{index}" for index in range(size))
    space = Space(names, (-1.5,) * size, (1.5,) * size, (0.0,) * size, (1.0,) * size)
    if not with_integer:
        return space
    return Space(
        (*names, "modules"),
        (*space.lower, 3.51),
        (*space.upper, 10.49),
        (*space.initial, 7.0),
        (*space.spread, 5.0),
        (size,),
    )


def climb(strategy: Strategy, generations: int, noise: float = 0.0) -> list[np.ndarray]:
    rng = np.random.default_rng(1)
    asked = []
    for _ in range(generations):
        genotypes = strategy.ask()
        asked.append(genotypes)
        fitness = -((genotypes - 0.4) ** 2).sum(axis=1) + noise * rng.standard_normal(len(genotypes))
        reevaluated = {
            int(index): float(fitness[index] + noise * rng.standard_normal())
            for index in strategy.find_reevaluations(fitness)
        }
        strategy.tell(genotypes, fitness, reevaluated)
    return asked


def test_it_finds_the_optimum():
    strategy = Strategy(make_space(), 0.3, 12, seed=0)
    climb(strategy, 60)
    assert np.abs(strategy.mean - 0.4).max() < 1e-3


@pytest.mark.parametrize("handle_noise", [False, True])
def test_equal_seeds_give_equal_genotypes_whatever_else_is_drawn(handle_noise):
    first = climb(Strategy(make_space(), 0.3, 8, seed=3, handle_noise=handle_noise), 20, noise=0.1)
    np.random.seed(99)  # noqa: NPY002
    second = climb(Strategy(make_space(), 0.3, 8, seed=3, handle_noise=handle_noise), 20, noise=0.1)
    other = climb(Strategy(make_space(), 0.3, 8, seed=4, handle_noise=handle_noise), 20, noise=0.1)
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


def test_genotypes_keep_their_bounds_and_integers():
    strategy = Strategy(make_space(with_integer=True), 0.8, 12, seed=0)
    genotypes = np.concatenate([strategy.ask() for _ in range(5)])
    assert np.abs(genotypes[:, :-1]).max() <= 1.5
    assert np.array_equal(genotypes[:, -1], np.round(genotypes[:, -1]))
    assert genotypes[:, -1].min() >= 4
    assert genotypes[:, -1].max() <= 10


def test_it_restarts_with_twice_the_population_on_a_plain():
    strategy = Strategy(make_space(), 0.3, 8, seed=0)
    for _ in range(400):
        strategy.tell(genotypes := strategy.ask(), np.zeros(len(genotypes)))
        if strategy.restarts:
            break
    assert strategy.restarts == 1
    assert len(strategy.ask()) == strategy.population_size == 16


def test_restarts_follow_their_config():
    config = CmaesConfig(max_doublings=0, restart_range=(0.9, 0.9))
    strategy = Strategy(make_space(), 0.01, 8, seed=0, config=config)
    while not strategy.restarts:
        strategy.tell(genotypes := strategy.ask(), np.zeros(len(genotypes)))
    assert strategy.population_size == 8
    assert strategy.mean == pytest.approx(np.full(6, 1.2))


@pytest.mark.parametrize(
    "arguments", [{"max_doublings": -1}, {"restart_range": (0.1, 1.1)}, {"max_trials_factor": 0}]
)
def test_configs_refuse(arguments):
    (name,) = arguments
    with pytest.raises(RunError, match=name):
        CmaesConfig(**arguments)


def test_noise_asks_for_more_trials():
    quiet = Strategy(make_space(), 0.3, 12, seed=0, handle_noise=True)
    noisy = Strategy(make_space(), 0.3, 12, seed=0, handle_noise=True)
    factors = []
    for _ in range(40):
        climb(quiet, 1)
        climb(noisy, 1, noise=3.0)
        factors.append(noisy.trials_factor)
    assert quiet.trials_factor == 1.0
    assert max(factors) > 1.2


def test_a_space_refuses_lengths_that_differ():
    with pytest.raises(ValueError, match="differ in length"):
        Space(("a", "b"), (0.0,), (1.0,), (0.5,), (1.0,))
