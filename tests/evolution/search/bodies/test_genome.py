"""Genomes of bodies: text, mirroring, limbs, and what they develop into."""

import pytest

from evolution._src.errors import RunError
from evolution._src.search.bodies.genome import BodyGenome, genome_of, is_possible, parse_genome
from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.body_plans import load_organism
from symbrion_gym._src.robot.organism import Docking, Organism, cross, snake

ONE = BodyGenome()
TEXTS = [".", "b(.)", "l(.)r(b(.))", "b(m(b(.)))", "b(b(l(.)))m(b(.))", "b(b(b(.)))l(.)r(.)"]


@pytest.mark.parametrize("text", TEXTS)
def test_a_genome_survives_being_written_and_read(text):
    assert parse_genome(text).text == text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no limb"),
        ("b", "'b' at character 0"),
        ("b(.", "is missing at character 3"),
        ("b()", "no limb and no '.' at character 2"),
        ("b(.)b(.)", "'b' at character 4"),
        ("m(.)r(.)", "'r' at character 4"),
        ("l(.)m(.)", "'m' at character 4"),
        ("b(.)x", "'x' at character 4"),
        ("..", "'.' at character 1"),
    ],
)
def test_what_is_no_genome_is_refused(text, message):
    with pytest.raises(RunError, match=message.replace("(", r"\(").replace(".", r"\.")):
        parse_genome(text)


def test_a_mirrored_module_repeats_its_left_limb_on_the_right():
    genome = BodyGenome(left=BodyGenome(left=ONE), is_mirrored=True)
    assert genome.num_modules == genome.develop().num_modules == 5
    assert genome.develop() == BodyGenome(left=BodyGenome(left=ONE), right=BodyGenome(right=ONE))
    assert genome.canonical_text == genome.develop().canonical_text


@pytest.mark.parametrize("text", TEXTS)
def test_mirroring_twice_changes_nothing_and_mirroring_keeps_the_body(text):
    genome = parse_genome(text)
    assert genome.mirror().mirror() == genome
    assert genome.mirror().canonical_text == genome.canonical_text
    assert genome.mirror().develop() == genome.develop().mirror()
    assert genome.mirror().num_modules == genome.num_modules


@pytest.mark.parametrize(
    "change",
    [{"is_mirrored": True}, {"left": ONE, "right": ONE, "is_mirrored": True}],
)
def test_a_mirrored_module_needs_a_left_limb_and_no_right_one(change):
    with pytest.raises(RunError, match="mirrored"):
        BodyGenome(**change)


def test_a_snake_hangs_on_the_back_of_its_head():
    genome = parse_genome("b(b(.))")
    assert genome.to_plan() == "SBSFSBSF00000000"
    body = genome.to_organism()
    assert body.num_modules == 3
    assert {frozenset(each.ends) for each in body.dockings} == {
        frozenset(each.ends) for each in snake(3).dockings
    }
    assert genome_of(snake(8)).text == "b(" * 7 + "." + ")" * 7


@pytest.mark.parametrize("text", TEXTS)
def test_a_body_plan_gives_back_the_developed_genome(text):
    genome = parse_genome(text)
    assert genome_of(load_organism(genome.to_plan())) == genome.develop()


def test_the_root_is_found_wherever_module_0_is():
    body = Organism(3, (Docking(0, "front", 2, "left"), Docking(2, "front", 1, "back")))
    assert genome_of(body).text == "b(l(.))"


def test_two_arms_dock_in_no_evolved_body():
    with pytest.raises(RunError, match="front to front"):
        genome_of(cross(1))


def test_overlap_is_found():
    ring = parse_genome("l(l(l(l(.))))")
    assert not is_possible(ring)
    with pytest.raises(OrganismError, match="overlap"):
        ring.to_organism()


def test_limbs_are_found_and_replaced():
    genome = parse_genome("b(l(.))m(.)")
    assert genome.find_paths() == [(), ("back",), ("back", "left"), ("left",)]
    assert genome.find_limb(("back", "left")) == ONE
    assert genome.replace_limb(("back", "left"), None).text == "b(.)m(.)"
    assert genome.replace_limb(("back", "back"), ONE).text == "b(b(.)l(.))m(.)"
    assert genome.replace_limb(("left",), None).text == "b(l(.))"
    assert genome.replace_limb((), ONE) == ONE


def test_paths_into_nothing_are_refused():
    with pytest.raises(RunError, match="leads to no module"):
        ONE.find_limb(("back",))
    with pytest.raises(RunError, match="leads to no module"):
        ONE.replace_limb(("back", "left"), ONE)
    with pytest.raises(RunError, match="root cannot be removed"):
        ONE.replace_limb((), None)
