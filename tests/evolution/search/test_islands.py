"""Islands: each is a CMA-ES, their best genotypes travel around the ring, and runs of them resume to the bit."""

from dataclasses import replace

import numpy as np
import pytest
import toys
from histories import TOY, without_times

from evolution._src.errors import RunError
from evolution._src.search.cmaes import Space, Strategy
from evolution._src.search.islands import Islands, IslandsConfig
from evolution._src.search.loop import evolve, resume

SPACE = Space(("a", "b"), (-1.0, -1.0), (1.0, 1.0), (0.0, 0.0), (1.0, 1.0))
RUN = replace(TOY, generations=7, population_size=6, islands=IslandsConfig(3, interval=2))


def rate(genotypes):
    return -((genotypes - 0.6) ** 2).sum(axis=1)


def climb(islands, generations):
    asked = []
    for _ in range(generations):
        asked.append(islands.ask())
        islands.tell(asked[-1], rate(asked[-1]))
    return asked


def test_the_best_of_an_island_is_tried_on_the_next_one():
    islands = Islands(IslandsConfig(3, interval=2), SPACE, 0.3, 6, seed=0)
    first, second, third = climb(islands, 3)
    best = [own[rate(own).argmax()] for own in np.split(second, 3)]
    arrived = np.split(third, 3)
    for number in range(3):
        assert np.abs(arrived[(number + 1) % 3][0] - best[number]).max() < 1e-12
    assert not any(np.abs(own - best[0]).max(axis=1).min() < 1e-12 for own in np.split(first, 3))


def test_without_exchange_each_island_is_a_search_of_its_own():
    islands = Islands(IslandsConfig(2, interval=0), SPACE, 0.3, 6, seed=5)
    alone = Strategy(SPACE, 0.3, 6, seed=5)
    for together in climb(islands, 4):
        own = alone.ask()
        np.testing.assert_array_equal(together[:6], own)
        assert not np.array_equal(together[6:], own)
        alone.tell(own, rate(own))


def test_an_island_whose_population_has_doubled_gets_its_own_genotypes():
    islands = Islands(IslandsConfig(2, interval=1), SPACE, 0.3, 6, seed=0)
    sizes = set()
    for _ in range(200):
        genotypes = islands.ask()
        assert len(genotypes) == islands.population_size
        islands.tell(genotypes, rate(genotypes))
        sizes.add(islands.population_size)
    assert islands.restarts >= 1
    assert len(sizes) > 1


def test_islands_find_the_optimum_and_equal_seeds_give_equal_genotypes():
    first, second, other = (
        climb(Islands(IslandsConfig(3, interval=2), SPACE, 0.3, 6, seed=seed), 20) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, second)
    assert not np.array_equal(first, other)
    assert rate(first[-1]).max() > -1e-3


def test_a_run_is_equal_at_any_number_of_workers_and_after_a_resume(tmp_path):
    whole = evolve(replace(RUN, folder=str(tmp_path / "whole")), simulate=toys.bowl)
    parts = evolve(replace(RUN, folder=str(tmp_path / "parts"), generations=3), simulate=toys.bowl)
    assert len(parts.history) == 3
    resumed = resume(tmp_path / "parts", generations=7, simulate=toys.bowl)
    many = evolve(replace(RUN, workers=2, backend="processes"), simulate=toys.bowl)
    for other in (resumed, many):
        np.testing.assert_array_equal(without_times(other.history), without_times(whole.history))
        assert [entry.genotype.tolist() for entry in other.record.entries] == [
            entry.genotype.tolist() for entry in whole.record.entries
        ]
    assert set(whole.history["population_size"]) == {18}


def test_all_islands_are_tried_in_one_batch():
    sizes = []

    def simulate(jobs, threads):
        sizes.append(len(jobs))
        return toys.hopeless(jobs, threads)

    evolve(replace(RUN, generations=2), simulate=simulate)
    assert sizes.count(18) == 2


def test_one_island_is_a_run_without_islands():
    plain = replace(TOY, generations=4)
    one = replace(plain, islands=IslandsConfig(1))
    assert one.digest() == plain.digest()
    assert replace(plain, islands=IslandsConfig(2)).digest() != plain.digest()
    runs = [evolve(config, simulate=toys.bowl) for config in (plain, one)]
    assert without_times(runs[0].history) == without_times(runs[1].history)


@pytest.mark.parametrize("options", [{"count": 0}, {"count": 1.5}, {"interval": -1}])
def test_bad_values_are_refused(options):
    with pytest.raises(RunError, match=next(iter(options))):
        IslandsConfig(**options)


def test_noise_and_islands_do_not_go_together():
    with pytest.raises(RunError, match="handle_noise and islands"):
        replace(RUN, handle_noise=True)
