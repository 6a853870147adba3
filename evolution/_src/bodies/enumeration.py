"""All small bodies."""

from __future__ import annotations

from collections.abc import Iterator

from evolution._src.bodies.genome import SOCKETS, BodyGenome, is_possible
from evolution._src.errors import RunError

MAX_ENUMERATED = 9
"""More modules have millions of bodies."""


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
            for grown in grow_everywhere(body):
                if grown.canonical_text not in larger and is_possible(grown):
                    larger[grown.canonical_text] = grown
        bodies = larger
    chosen = (min(body, body.mirror(), key=lambda each: each.text) for body in bodies.values())
    return sorted(chosen, key=lambda body: body.text)


def grow_everywhere(genome: BodyGenome) -> Iterator[BodyGenome]:
    """Yield the genome with a module more, for each of its free sockets, overlaps included."""
    for path in genome.find_paths():
        limb = genome.find_limb(path)
        for socket in SOCKETS:
            if getattr(limb, socket) is None and not (limb.is_mirrored and socket == "right"):
                yield genome.replace_limb((*path, socket), BodyGenome())
