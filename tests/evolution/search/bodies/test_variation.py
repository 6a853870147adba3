"""Mutation and crossover: every child is a valid body, and nothing is drawn twice."""

import numpy as np
import pytest
from evolution._src.search.bodies.variation import OPERATORS, BodyLimits, cross_over, make_random_body, mutate

from evolution._src.errors import RunError
from evolution._src.search.bodies.genome import BodyGenome, enumerate_bodies, is_possible, parse_genome


@pytest.mark.parametrize("operator", OPERATORS)
def test_children_are_valid(operator):
    rng, limits = np.random.default_rng(0), BodyLimits(1, 7)
    parents = [make_random_body(rng, limits) for _ in range(60)]
    children = [mutate(parent, rng, limits, (operator,)) for parent in parents]
    assert all(is_possible(child) and 1 <= child.num_modules <= 7 for child in children)
    assert any(child.text != parent.text for child, parent in zip(children, parents, strict=True))


@pytest.mark.parametrize(
    ("operator", "parent", "children"),
    [
        ("grow", ".", {"b(.)", "l(.)", "r(.)"}),
        ("prune", "b(l(.))", {".", "b(.)"}),
        ("move", "b(.)", {"l(.)", "r(.)"}),
        ("swap", "b(.)l(b(.))", {"b(b(.))l(.)", "b(.)l(b(.))"}),
        ("duplicate", "b(.)", {"b(.)l(.)", "b(.)r(.)", "b(b(.))", "b(l(.))", "b(r(.))"}),
        ("mirror", "l(b(.))", {"m(b(.))"}),
        ("mirror", "m(l(.))", {"l(l(.))r(r(.))", "m(m(.))"}),
        ("root", "b(l(.))", {"l(.)", ".", "b(b(l(.)))", "l(b(l(.)))", "r(b(l(.)))"}),
    ],
)
def test_operators_do_what_their_names_say(operator, parent, children):
    found = {child.text for child in OPERATORS[operator](parse_genome(parent))}
    assert found - {parent} == children - {parent}


def test_a_swap_of_a_limb_within_another_is_none():
    assert list(OPERATORS["swap"](parse_genome("b(l(b(.)))"))) == []


def test_where_nothing_can_change_the_parent_is_returned():
    one = BodyGenome()
    rng = np.random.default_rng(0)
    assert mutate(one, rng, BodyLimits(1, 1)) is one
    assert cross_over(one, one, rng) is one


def test_crossover_takes_limbs_of_both():
    rng = np.random.default_rng(1)
    children = {cross_over(parse_genome("b(.)"), parse_genome("l(r(.))"), rng).text for _ in range(50)}
    assert children == {"b(l(r(.)))", "b(r(.))"}


def test_mutations_reach_every_small_body():
    """From one module, all bodies of up to 4 are reached."""
    rng, limits = np.random.default_rng(2), BodyLimits(1, 4)
    body, seen = BodyGenome(), set()
    for _ in range(4000):
        body = mutate(body, rng, limits)
        seen.add(body.canonical_text)
    assert seen == {each.canonical_text for count in range(1, 5) for each in enumerate_bodies(count)}


def test_equal_seeds_give_equal_children():
    def run(seed):
        rng = np.random.default_rng(seed)
        body = make_random_body(rng)
        for _ in range(20):
            body = cross_over(mutate(body, rng), make_random_body(rng), rng)
        return body.text

    assert run(5) == run(5)
    assert run(5) != run(6)


def test_impossible_limits_and_operators_are_refused():
    with pytest.raises(RunError, match="got 3 and 2"):
        BodyLimits(3, 2)
    with pytest.raises(RunError, match="no mutation 'fly'; there are: grow"):
        mutate(BodyGenome(), np.random.default_rng(0), operators=("fly",))
