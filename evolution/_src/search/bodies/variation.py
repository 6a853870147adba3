"""How bodies vary: mutations and crossover, each of which lists its possible children and draws one.

Nothing is drawn and rejected: where an operator has no valid child the next one is tried, and where none has, the
parent is returned.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from evolution._src.errors import RunError
from evolution._src.search.bodies.genome import (
    SOCKETS,
    BodyGenome,
    Path,
    grow_everywhere,
    is_possible,
    join_limbs,
)

Operator = Callable[[BodyGenome], Iterator[BodyGenome]]
"""From a genome to what one change makes of it, overlaps included."""


@dataclass(frozen=True)
class BodyLimits:
    """How many modules a body has.

    Raises:
        RunError: the range is empty or begins below 1.
    """

    smallest: int = 1  # at least this many
    largest: int = 8  # at most this many

    def __post_init__(self) -> None:
        if not 1 <= self.smallest <= self.largest:
            raise RunError(
                f"bodies need 1 <= smallest <= largest modules, got {self.smallest} and {self.largest}"
            )

    def allow(self, genome: BodyGenome) -> bool:
        """Return whether a body has the right size and no overlap."""
        return self.smallest <= genome.num_modules <= self.largest and is_possible(genome)


def prune(genome: BodyGenome) -> Iterator[BodyGenome]:
    """Yield the genome without each of its limbs."""
    for path in genome.find_paths()[1:]:
        yield genome.replace_limb(path, None)


def move(genome: BodyGenome) -> Iterator[BodyGenome]:
    """Yield the genome with each limb moved to each free socket outside of it."""
    for path in genome.find_paths()[1:]:
        limb, rest = genome.find_limb(path), genome.replace_limb(path, None)
        for place in _find_free_sockets(rest):
            if place != path:
                yield rest.replace_limb(place, limb)


def swap(genome: BodyGenome) -> Iterator[BodyGenome]:
    """Yield the genome with each two limbs exchanged of which neither contains the other."""
    paths = genome.find_paths()[1:]
    for i, one in enumerate(paths):
        for other in paths[i + 1 :]:
            if one != other[: len(one)]:
                first, second = genome.find_limb(one), genome.find_limb(other)
                if first != second:
                    yield genome.replace_limb(one, second).replace_limb(other, first)


def duplicate(genome: BodyGenome) -> Iterator[BodyGenome]:
    """Yield the genome with a copy of each limb on each free socket."""
    for path in genome.find_paths()[1:]:
        limb = genome.find_limb(path)
        for place in _find_free_sockets(genome):
            yield genome.replace_limb(place, limb)


def toggle_mirroring(genome: BodyGenome) -> Iterator[BodyGenome]:
    """Yield the genome with each pair of sides mirrored, or no longer mirrored.

    What becomes mirrored loses its right limb; what no longer is keeps both limbs, and they vary apart from then on.
    """
    for path in genome.find_paths():
        limb = genome.find_limb(path)
        if limb.is_mirrored and limb.left is not None:
            parted = replace(limb, right=limb.left.mirror(), is_mirrored=False)
            yield genome.replace_limb(path, parted)
        elif limb.left is not None:
            yield genome.replace_limb(path, replace(limb, right=None, is_mirrored=True))


def take_root(genome: BodyGenome) -> Iterator[BodyGenome]:
    """Yield each body that begins at a limb, and those where a new root carries the whole body on a socket."""
    for path in genome.find_paths()[1:]:
        yield genome.find_limb(path)
    for socket in SOCKETS:
        yield join_limbs({socket: genome})


OPERATORS: dict[str, Operator] = {
    "grow": grow_everywhere,
    "prune": prune,
    "move": move,
    "swap": swap,
    "duplicate": duplicate,
    "mirror": toggle_mirroring,
    "root": take_root,
}
"""Mutations by name."""


def mutate(
    genome: BodyGenome,
    rng: np.random.Generator,
    limits: BodyLimits | None = None,
    operators: tuple[str, ...] = tuple(OPERATORS),
) -> BodyGenome:
    """Return a child with one change."""
    limits = limits or BodyLimits()
    unknown = [name for name in operators if name not in OPERATORS]
    if unknown:
        raise RunError(f"no mutation {unknown[0]!r}; there are: {', '.join(OPERATORS)}")
    for index in rng.permutation(len(operators)):
        children = list({child.text: child for child in OPERATORS[operators[index]](genome)}.values())
        children = [child for child in children if child.text != genome.text]
        for child in _shuffle(children, rng):
            if limits.allow(child):
                return child
    return genome


def cross_over(
    first: BodyGenome, second: BodyGenome, rng: np.random.Generator, limits: BodyLimits | None = None
) -> BodyGenome:
    """Return a child: the first parent with one of its limbs replaced by one of the second's."""
    limits = limits or BodyLimits()
    limbs = {second.find_limb(path).text: second.find_limb(path) for path in second.find_paths()}
    children: dict[str, BodyGenome] = {}
    for path in first.find_paths()[1:]:
        for limb in limbs.values():
            child = first.replace_limb(path, limb)
            children.setdefault(child.text, child)
    children.pop(first.text, None)
    for child in _shuffle(list(children.values()), rng):
        if limits.allow(child):
            return child
    return first


def make_random_body(rng: np.random.Generator, limits: BodyLimits | None = None) -> BodyGenome:
    """Return a body of a random number of modules, grown a module at a time on random free sockets."""
    limits = limits or BodyLimits()
    body = BodyGenome()
    for _ in range(int(rng.integers(limits.smallest, limits.largest + 1)) - 1):
        children = _shuffle(list(grow_everywhere(body)), rng)
        body = next(child for child in children if is_possible(child))
    return body


def _shuffle(bodies: list[BodyGenome], rng: np.random.Generator) -> Iterator[BodyGenome]:
    for index in rng.permutation(len(bodies)):
        yield bodies[index]


def _find_free_sockets(genome: BodyGenome) -> Iterator[Path]:
    """Yield the path to each free socket."""
    for path in genome.find_paths():
        limb = genome.find_limb(path)
        for socket in SOCKETS:
            if getattr(limb, socket) is None and not (limb.is_mirrored and socket == "right"):
                yield (*path, socket)
