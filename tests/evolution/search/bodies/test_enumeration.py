"""All small bodies: their numbers, counted in two other ways."""

import itertools

import pytest

from evolution._src.errors import RunError
from evolution._src.search.bodies.genome import enumerate_bodies, is_possible, parse_genome
from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.organism import Docking, Organism


@pytest.mark.parametrize(("num_modules", "count"), list(enumerate([1, 2, 7, 29, 134, 643], start=1)))
def test_there_are_as_many_bodies_as_published(num_modules, count):
    bodies = enumerate_bodies(num_modules)
    assert len(bodies) == len({body.canonical_text for body in bodies}) == count
    assert all(body.num_modules == num_modules and is_possible(body) for body in bodies)
    assert all(parse_genome(body.text) == body for body in bodies)


def test_without_overlap_there_would_be_as_many_as_ternary_trees():
    """Ternary trees of 4 nodes: 55, of which 3 are their own mirror image; (55 + 3) / 2 = 29."""
    assert len(enumerate_bodies(4)) == (55 + 3) // 2


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
