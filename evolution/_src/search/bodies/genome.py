"""The genome of a body: a rooted tree of modules, the rule that a limb grows mirrored, and how genomes vary.

A Scout has one connector, on its hinged arm, and three sockets. So each docking joins the arm of one module with a
socket of another, exactly one module of a body keeps its arm free, and a body is a tree with that module as its root
and at most three children a module, on its back, left and right. The side is the orientation of a child, too: it always
looks at its parent.

Mutations and crossover list their possible children and draw one. Nothing is drawn and rejected: where a mutation has
no valid child the next one is tried, and where none has, the parent is returned.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from evolution._src.errors import RunError
from evolution._src.references import MAX_MODULES
from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.body_plans import organism_to_text
from symbrion_gym._src.robot.organism import Docking, Organism
from symbrion_gym._src.robot.scout_constants import ScoutConfig

SOCKETS = ("back", "left", "right")
Path = tuple[str, ...]  # The sockets from the root to a module
Limits = tuple[int, int]  # Smallest and largest number of modules
_OPPOSITE = {"back": "back", "left": "right", "right": "left"}
_SOCKETS = {"b": "back", "l": "left", "r": "right", "m": "left"}  # By letters of a genome's text


@dataclass(frozen=True)
class BodyGenome:
    """A module and what hangs on its sockets.

    Attributes:
        back: the limb on the socket at the back; None: nothing.
        left: likewise on the left.
        right: likewise on the right.
        is_mirrored: what hangs on the left hangs on the right, too, as its mirror image; `right` is None then.

    Raises:
        RunError: a limb is no genome; a mirrored module has a limb of its own on the right, or none on the left.
    """

    back: BodyGenome | None = None
    left: BodyGenome | None = None
    right: BodyGenome | None = None
    is_mirrored: bool = False

    def __post_init__(self) -> None:
        for socket in SOCKETS:
            limb = getattr(self, socket)
            if limb is not None and not isinstance(limb, BodyGenome):
                raise RunError(
                    f"{socket}={limb!r} is no BodyGenome; BodyGenome.parse('b(b(.)m(.))') reads a text"
                )
        if self.is_mirrored and (self.left is None or self.right is not None):
            raise RunError(
                "a mirrored module repeats its left limb on the right; give it a left limb and none on the right"
            )

    @classmethod
    def parse(cls, text: str) -> BodyGenome:
        """Return the genome that a text describes, as `text` writes it.

        Raises:
            RunError: it describes none.
        """
        genome = _parse(iter(text)) if isinstance(text, str) and text.count("(") < MAX_MODULES else None
        if genome is None or genome.text != text:
            raise RunError(f"cannot read the genome {text!r}; one such as 'b(b(.)m(.))' is needed")
        return genome

    @property
    def limbs(self) -> Iterator[tuple[str, BodyGenome]]:
        """Socket and limb of each limb of this module, before mirroring."""
        for socket in SOCKETS:
            limb = getattr(self, socket)
            if limb is not None:
                yield socket, limb

    @cached_property
    def num_modules(self) -> int:
        """Number of modules of the body."""
        count = 1 + sum(limb.num_modules for _, limb in self.limbs)
        return count + (self.left.num_modules if self.is_mirrored and self.left else 0)

    def develop(self) -> BodyGenome:
        """Return the same body without mirrored modules: each limb is written out."""
        limbs = {socket: limb.develop() for socket, limb in self.limbs}
        if self.is_mirrored:
            limbs["right"] = limbs["left"].mirror()
        return join_limbs(limbs)

    def mirror(self) -> BodyGenome:
        """Return the mirror image: left and right swapped all over."""
        if self.is_mirrored:  # both sides are there, so that only the back changes
            return replace(self, back=self.back and self.back.mirror())
        return join_limbs({_OPPOSITE[socket]: limb.mirror() for socket, limb in self.limbs})

    @cached_property
    def text(self) -> str:
        """The genome as text: `b`, `l`, `r` and the limb in brackets, `m` for a mirrored pair, "." for one alone."""
        if self.is_mirrored and self.left is not None:
            pair = f"m({self.left.text})"
            return f"b({self.back.text}){pair}" if self.back is not None else pair
        return "".join(f"{socket[0]}({limb.text})" for socket, limb in self.limbs) or "."

    @cached_property
    def canonical_text(self) -> str:
        """The same for each genome of the same body up to its mirror image."""
        body = self.develop()
        return min(body.text, body.mirror().text)

    def find_paths(self) -> list[Path]:
        """Return the way to each module of the genome, the root first."""
        paths: list[Path] = [()]
        for socket, limb in self.limbs:
            paths += [(socket, *path) for path in limb.find_paths()]
        return paths

    def find_free_sockets(self) -> Iterator[Path]:
        """Yield the path to each free socket."""
        for path in self.find_paths():
            limb = self.find_limb(path)
            for socket in SOCKETS:
                if getattr(limb, socket) is None and not (limb.is_mirrored and socket == "right"):
                    yield (*path, socket)

    def find_limb(self, path: Path) -> BodyGenome:
        """Return the limb at the end of a path.

        Raises:
            RunError: the path leads to nothing.
        """
        limb: BodyGenome | None = self
        for socket in path:
            limb = getattr(limb, socket, None)
        if limb is None:
            raise RunError(f"the path {path} leads to no module of {self.text!r}")
        return limb

    def replace_limb(self, path: Path, limb: BodyGenome | None) -> BodyGenome:
        """Return the genome with another limb at the end of a path; None removes it.

        A module that loses its left limb is no longer mirrored. The path may end on a free socket.

        Raises:
            RunError: the path leads past the modules, or is that of the root and the limb is None.
        """
        if not path:
            if limb is None:
                raise RunError("the root cannot be removed; a body has at least one module")
            return limb
        socket, *rest = path
        if rest:
            limb = self.find_limb((socket,)).replace_limb(tuple(rest), limb)
        is_mirrored = self.is_mirrored and not (socket == "left" and limb is None)
        return replace(self, **{socket: limb, "is_mirrored": is_mirrored})

    def to_organism(self, scout: ScoutConfig | None = None) -> Organism:
        """Return the body; module 0 is the root, whose arm is free.

        Raises:
            OrganismError: modules overlap when all hinges are straight.
        """
        dockings: list[Docking] = []
        _add_dockings(self.develop(), 0, dockings)
        return Organism(len(dockings) + 1, tuple(dockings), scout or ScoutConfig())

    def to_plan(self) -> str:
        """Return the body plan, as `symbrion_gym.load_organism` reads it."""
        return organism_to_text(self.to_organism())


def join_limbs(limbs: Mapping[str, BodyGenome]) -> BodyGenome:
    """Return a module with limbs on its sockets."""
    return BodyGenome(limbs.get("back"), limbs.get("left"), limbs.get("right"))


def make_row(num_modules: int) -> BodyGenome:
    """Return modules in a row, each docked to the back of the one ahead."""
    if num_modules < 1:
        raise RunError(f"a row has at least 1 module, got {num_modules}")
    row = BodyGenome()
    for _ in range(num_modules - 1):
        row = BodyGenome(back=row)
    return row


def _parse(letters: Iterator[str]) -> BodyGenome:
    """Return the genome up to the bracket that closes it; what is no genome becomes another one's text."""
    limbs: dict[str, BodyGenome] = {}
    is_mirrored = False
    for letter in letters:
        if letter == ")":
            break
        if letter in _SOCKETS:
            next(letters, "")  # the opening bracket
            limbs[_SOCKETS[letter]] = _parse(letters)
            is_mirrored |= letter == "m"
    return BodyGenome(**limbs, is_mirrored=is_mirrored)


def is_possible(genome: BodyGenome) -> bool:
    """Return whether no modules overlap when all hinges are straight."""
    try:
        genome.to_organism()
    except OrganismError:
        return False
    return True


def _add_dockings(genome: BodyGenome, module: int, dockings: list[Docking]) -> None:
    """Add the dockings below a module, depth first, as body plans list them."""
    for socket, limb in genome.limbs:
        child = len(dockings) + 1
        dockings.append(Docking(child, "front", module, socket))
        _add_dockings(limb, child, dockings)


MAX_ENUMERATED = 9  # More modules have millions of bodies


def enumerate_bodies(num_modules: int) -> list[BodyGenome]:
    """Return all bodies of a number of modules, one of each pair of mirror images, sorted by their text.

    A body without overlap has a leaf, and is without overlap when the leaf is taken off; so all bodies of n modules
    come from those of n - 1 by adding a module on a free socket.
    """
    if not 1 <= num_modules <= MAX_ENUMERATED:
        raise RunError(f"the number of modules must be 1 to {MAX_ENUMERATED}, got {num_modules}")
    bodies = {".": BodyGenome()}
    for _ in range(num_modules - 1):
        larger: dict[str, BodyGenome] = {}
        for body in bodies.values():
            for grown in grow(body):
                if grown.canonical_text not in larger and is_possible(grown):
                    larger[grown.canonical_text] = grown
        bodies = larger
    chosen = (min(body, body.mirror(), key=lambda each: each.text) for body in bodies.values())
    return sorted(chosen, key=lambda body: body.text)


def grow(genome: BodyGenome) -> Iterator[BodyGenome]:
    """Yield the genome with a module more, for each of its free sockets, overlaps included."""
    for place in genome.find_free_sockets():
        yield genome.replace_limb(place, BodyGenome())


def prune(genome: BodyGenome) -> Iterator[BodyGenome]:
    """Yield the genome without each of its limbs."""
    for path in genome.find_paths()[1:]:
        yield genome.replace_limb(path, None)


def move(genome: BodyGenome) -> Iterator[BodyGenome]:
    """Yield the genome with each limb moved to each free socket outside of it."""
    for path in genome.find_paths()[1:]:
        limb, rest = genome.find_limb(path), genome.replace_limb(path, None)
        for place in rest.find_free_sockets():
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
        for place in genome.find_free_sockets():
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


OPERATORS: dict[str, Callable[[BodyGenome], Iterator[BodyGenome]]] = {
    "grow": grow,
    "prune": prune,
    "move": move,
    "swap": swap,
    "duplicate": duplicate,
    "mirror": toggle_mirroring,
    "root": take_root,
}
"""Mutations by name: from a genome to what one change makes of it, overlaps included."""


def mutate(genome: BodyGenome, rng: np.random.Generator, limits: Limits) -> BodyGenome:
    """Return a child with one change."""
    for index in rng.permutation(len(OPERATORS)):
        operator = list(OPERATORS.values())[index]
        children = {child.text: child for child in operator(genome) if child.text != genome.text}
        child = _draw(list(children.values()), rng, limits)
        if child is not None:
            return child
    return genome


def cross_over(first: BodyGenome, second: BodyGenome, rng: np.random.Generator, limits: Limits) -> BodyGenome:
    """Return a child: the first parent with one of its limbs replaced by one of the second's."""
    limbs = {second.find_limb(path).text: second.find_limb(path) for path in second.find_paths()}
    children: dict[str, BodyGenome] = {}
    for path in first.find_paths()[1:]:
        for limb in limbs.values():
            child = first.replace_limb(path, limb)
            children.setdefault(child.text, child)
    children.pop(first.text, None)
    return _draw(list(children.values()), rng, limits) or first


def make_random_body(rng: np.random.Generator, limits: Limits) -> BodyGenome:
    """Return a body of a random number of modules, grown a module at a time on random free sockets."""
    body = BodyGenome()
    for _ in range(int(rng.integers(limits[0], limits[1] + 1)) - 1):
        children = list(grow(body))
        body = next(children[i] for i in rng.permutation(len(children)) if is_possible(children[i]))
    return body


def _draw(bodies: list[BodyGenome], rng: np.random.Generator, limits: Limits) -> BodyGenome | None:
    """Return one of the bodies of a right size and without overlap; None where there is none."""
    for index in rng.permutation(len(bodies)):
        body = bodies[index]
        if limits[0] <= body.num_modules <= limits[1] and is_possible(body):
            return body
    return None
