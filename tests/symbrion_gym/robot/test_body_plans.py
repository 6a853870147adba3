"""Organisms as text: names, body plans, files; and random trees."""

import numpy as np
import pytest

from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.body_plans import load_organism, make_random_organism, organism_to_text
from symbrion_gym._src.robot.organism import cross, letter_h, snake
from symbrion_gym._src.robot.scout_constants import ScoutConfig


@pytest.mark.parametrize(
    ("what", "body"),
    [
        (3, snake(3)),
        ("snake8", snake(8)),
        ("snake", snake(8)),
        ("cross", cross(2)),
        ("cross3", cross(3)),
        ("H", letter_h()),
        ("h5", letter_h(5)),
        (" SF0F0000 ", snake(1)),
        ("SBSF0000", snake(2)),
        ("SBSF SBSF 0000 0000", snake(3)),
        ("SBSFSBSF0000SLSF0000SRSF00000000", cross(1)),
        ("SBSF0000; 0 1", snake(2)),
        (cross(1), cross(1)),
    ],
)
def test_what_describes_an_organism(what, body):
    assert load_organism(what) == body


def test_two_hundred_random_trees_survive_being_written_and_read():
    rng = np.random.default_rng(0)
    for _ in range(200):
        body = make_random_organism(int(rng.integers(1, 13)), rng)
        read = load_organism(organism_to_text(body))
        assert {frozenset(each.ends) for each in read.dockings} == {
            frozenset(each.ends) for each in body.dockings
        }
        assert (read.num_modules, read.parents) == (body.num_modules, body.parents)
        assert organism_to_text(read) == organism_to_text(body)


@pytest.mark.parametrize("body", [snake(1), snake(9), cross(1), cross(3), letter_h(), letter_h(4)])
def test_shapes_survive_exactly(body):
    assert load_organism(organism_to_text(body)) == body


def test_a_file_may_have_comments(tmp_path):
    (tmp_path / "plan.txt").write_text("# a cross\nSBSF SBSF0000\nSLSF0000 SRSF00000000\n", encoding="utf-8")
    assert load_organism(tmp_path / "plan.txt") == cross(1)


def test_constants_are_those_that_are_given():
    scout = ScoutConfig(friction=0.4)
    assert [load_organism(what, scout).scout for what in (2, "H", "SBSF0000")] == [scout] * 3


@pytest.mark.parametrize(
    ("what", "message"),
    [
        ("SBSF", "1 '0000' are missing"),
        ("SBSF00", "6 characters"),
        ("SBSX0000", "'SBSX' at character 0"),
        ("SBSF0000XFSF0000", "'XFSF' at character 8"),
        ("KBKF0000", "a KIT; only Scouts"),
        ("SBAF0000", "an? Active Wheel"),
        ("SBSF00000000", "goes back from module 0"),
        ("SBSF0000SBSF0000", "dock 'back' of module 0 is used twice"),
        ("SBSB0000", "'back' of module 0"),
        ("SFSF0000", "join the arm"),
        ("SBSFSLSFSLSFSLSF0000000000000000", "modules . and . overlap"),
        ("SBSF0000; 0 2", "numbers must be 0 to 1"),
        ("SBSF0000; 1 0", "0 first"),
        ("dragon3", "no organism 'dragon3'"),
        ("0000", "no organism"),
        ("", "no organism"),
        ("snake0", "at least 1 module"),
        ("cross0", "at least 1 module"),
        ("H1", "at least 2 modules"),
        (True, "got True"),
        (2.5, r"got 2\.5"),
    ],
)
def test_what_does_not_is_refused(what, message):
    with pytest.raises(OrganismError, match=message):
        load_organism(what)


def test_random_trees_repeat_with_the_seed():
    first, second = (make_random_organism(7, np.random.default_rng(3)) for _ in range(2))
    assert first == second
    assert first != make_random_organism(7, np.random.default_rng(4))
    with pytest.raises(OrganismError, match="at least 1"):
        make_random_organism(0, np.random.default_rng(0))
