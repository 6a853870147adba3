"""Genomes of bodies: text, mirroring, limbs, what they develop into, all small ones, and how they vary."""

import itertools

import numpy as np
import pytest

from evolution._src.errors import RunError
from evolution._src.search.bodies.genome import (
    OPERATORS,
    BodyGenome,
    cross_over,
    enumerate_bodies,
    is_possible,
    make_random_body,
    make_row,
    mutate,
)
from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.organism import Docking, Organism, snake

ONE = BodyGenome()
TEXTS = [".", "b(.)", "l(.)r(b(.))", "b(m(b(.)))", "b(b(l(.)))m(b(.))", "b(b(b(.)))l(.)r(.)"]


@pytest.mark.parametrize("text", TEXTS)
def test_a_genome_survives_text_and_being_mirrored_twice(text):
    genome = BodyGenome.parse(text)
    assert genome.text == text
    assert genome.mirror().mirror() == genome
    assert genome.mirror().canonical_text == genome.canonical_text == genome.develop().canonical_text
    assert genome.mirror().develop() == genome.develop().mirror()
    assert genome.num_modules == genome.develop().num_modules == genome.to_organism().num_modules


@pytest.mark.parametrize(
    "text", ["", "b", "b(.", "b()", "b(.)b(.)", "l(.)b(.)", "m(.)r(.)", "b(.)x", "..", "b(" * 5000, 3]
)
def test_what_is_no_genome_is_refused(text):
    for make in (BodyGenome.parse, BodyGenome):
        with pytest.raises(RunError, match=r"[gG]enome|mirrored"):
            make(text)


def test_a_mirrored_module_repeats_its_left_limb_on_the_right():
    genome = BodyGenome(left=BodyGenome(left=ONE), is_mirrored=True)
    assert genome.develop() == BodyGenome(left=BodyGenome(left=ONE), right=BodyGenome(right=ONE))
    for change in ({}, {"left": ONE, "right": ONE}):
        with pytest.raises(RunError, match="mirrored"):
            BodyGenome(**change, is_mirrored=True)


def test_a_snake_hangs_on_the_back_of_its_head():
    genome = BodyGenome.parse("b(b(.))")
    assert genome == make_row(3)
    assert genome.to_plan() == "SBSFSBSF00000000"
    ends = [{frozenset(each.ends) for each in body.dockings} for body in (genome.to_organism(), snake(3))]
    assert ends[0] == ends[1]


def test_overlap_is_found():
    ring = BodyGenome.parse("l(l(l(l(.))))")
    assert not is_possible(ring)
    with pytest.raises(OrganismError, match="overlap"):
        ring.to_organism()


def test_limbs_are_found_and_replaced_and_paths_into_nothing_refused():
    genome = BodyGenome.parse("b(l(.))m(.)")
    assert genome.find_paths() == [(), ("back",), ("back", "left"), ("left",)]
    assert genome.find_limb(("back", "left")) == ONE
    assert genome.replace_limb(("back", "left"), None).text == "b(.)m(.)"
    assert genome.replace_limb(("back", "back"), ONE).text == "b(b(.)l(.))m(.)"
    assert genome.replace_limb(("left",), None).text == "b(l(.))"
    assert genome.replace_limb((), ONE) == ONE
    for action in (lambda: ONE.find_limb(("back",)), lambda: ONE.replace_limb(("back", "left"), ONE)):
        with pytest.raises(RunError, match="leads to no module"):
            action()
    with pytest.raises(RunError, match="root cannot be removed"):
        ONE.replace_limb((), None)


@pytest.mark.parametrize(("num_modules", "count"), list(enumerate([1, 2, 7, 29, 134, 643], start=1)))
def test_there_are_as_many_bodies_as_published(num_modules, count):
    """Of 4 modules, none overlap: ternary trees of 4 nodes, 55, of which 3 are their own mirror image: 58 / 2."""
    bodies = enumerate_bodies(num_modules)
    assert len(bodies) == len({body.canonical_text for body in bodies}) == count
    assert all(body.num_modules == num_modules and is_possible(body) for body in bodies)


def test_dockings_drawn_blindly_give_the_same_bodies():
    """Each module but the first docks its arm to any socket of any other; trees without overlap are kept."""
    count, found = 4, set()
    sockets = [(module, side) for module in range(count) for side in ("back", "left", "right")]
    for places in itertools.permutations(sockets, count - 1):
        if any(parent == child for child, (parent, _) in enumerate(places, start=1)):
            continue
        dockings = (Docking(child, "front", *place) for child, place in enumerate(places, start=1))
        try:
            found.add(_describe(Organism(count, tuple(dockings))))
        except OrganismError:
            continue
    bodies = {_describe(body.to_organism()) for body in enumerate_bodies(count)}
    assert {min(one, _mirror(one)) for one in found} == {min(one, _mirror(one)) for one in bodies}


def _describe(body: Organism) -> tuple[tuple[int, int, int], ...]:
    """Return where the modules of a body lie seen from the one with a free arm [mm and quarter turns]."""
    (root,) = set(range(body.num_modules)) - set(body.hinges)
    poses = body.compute_poses()
    seen = [poses[root].invert().compose(pose) for pose in poses]
    return tuple(sorted((round(p.x * 1e3), round(p.y * 1e3), round(p.heading / 1.5707963) % 4) for p in seen))


def _mirror(places: tuple[tuple[int, int, int], ...]) -> tuple[tuple[int, int, int], ...]:
    return tuple(sorted((x, -y, -turn % 4) for x, y, turn in places))


@pytest.mark.parametrize("num_modules", [0, 10])
def test_what_cannot_be_listed_is_refused(num_modules):
    with pytest.raises(RunError, match=f"1 to 9, got {num_modules}"):
        enumerate_bodies(num_modules)


@pytest.mark.parametrize(
    ("operator", "parent", "children"),
    [
        ("grow", ".", {"b(.)", "l(.)", "r(.)"}),
        ("prune", "b(l(.))", {".", "b(.)"}),
        ("move", "b(.)", {"l(.)", "r(.)"}),
        ("swap", "b(.)l(b(.))", {"b(b(.))l(.)", "b(.)l(b(.))"}),
        ("swap", "b(l(b(.)))", set()),
        ("duplicate", "b(.)", {"b(.)l(.)", "b(.)r(.)", "b(b(.))", "b(l(.))", "b(r(.))"}),
        ("mirror", "l(b(.))", {"m(b(.))"}),
        ("mirror", "m(l(.))", {"l(l(.))r(r(.))", "m(m(.))"}),
        ("root", "b(l(.))", {"l(.)", ".", "b(b(l(.)))", "l(b(l(.)))", "r(b(l(.)))"}),
    ],
)
def test_operators_do_what_their_names_say(operator, parent, children):
    found = {child.text for child in OPERATORS[operator](BodyGenome.parse(parent))}
    assert found - {parent} == children - {parent}


def test_children_are_valid():
    rng, limits = np.random.default_rng(0), (2, 7)
    parents = [make_random_body(rng, limits) for _ in range(60)]
    children = [mutate(parent, rng, limits) for parent in parents]
    children += [cross_over(*pair, rng, limits) for pair in itertools.pairwise(parents)]
    assert all(is_possible(child) and 2 <= child.num_modules <= 7 for child in children)


def test_where_nothing_can_change_the_parent_is_returned():
    rng = np.random.default_rng(0)
    assert mutate(ONE, rng, (1, 1)) is ONE
    assert cross_over(ONE, ONE, rng, (1, 8)) is ONE


def test_crossover_takes_limbs_of_both():
    rng, parents = np.random.default_rng(1), (BodyGenome.parse("b(.)"), BodyGenome.parse("l(r(.))"))
    assert {cross_over(*parents, rng, (1, 8)).text for _ in range(50)} == {"b(l(r(.)))", "b(r(.))"}


def test_mutations_reach_every_small_body_and_equal_seeds_the_same():
    def walk(seed, steps):
        rng, body, texts = np.random.default_rng(seed), ONE, []
        for _ in range(steps):
            body = mutate(body, rng, (1, 4))
            texts.append(body.canonical_text)
        return texts

    assert set(walk(2, 4000)) == {
        each.canonical_text for count in range(1, 5) for each in enumerate_bodies(count)
    }
    assert walk(5, 20) == walk(5, 20) != walk(6, 20)
