"""Organisms as text: names of common shapes, and body plans as the robots of the project exchange them.

A body plan lists the tree of modules depth first, from module 0. A docking is four characters: type and side of a
module that is there, then type and side of the new one; `0000` goes back to the module before. Types are S (Scout),
K (KIT) and A (Active Wheel), sides F (front), R (right), B (back) and L (left): `SBSF0000` is a Scout whose back holds
the front of another, `SF0F0000` one alone. Modules are numbered as they are listed, unless other numbers follow, which
is an addition to the format: `SBSF0000SLSF0000; 0 2 1`.

References:
    symbrion-morph (W. Liu), the program of the robots, OrganismSequence: the format, restated.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from symbrion_gym._src.errors import OrganismError
from symbrion_gym._src.robot.organism import Docking, Organism, cross, letter_h, snake
from symbrion_gym._src.robot.scout_constants import SIDES, ScoutConfig

_SIDES = {"F": "front", "R": "right", "B": "back", "L": "left"}
_LETTERS = {side: letter for letter, side in _SIDES.items()}
_OTHER_ROBOTS = {"K": "KIT", "A": "Active Wheel"}
_SHAPES = {"snake": (snake, 8), "cross": (cross, 2), "h": (letter_h, 3)}
"""Name -> maker, and the size that it has unless one is given."""
_NAME = re.compile(r"([a-z]+?)(\d{0,4})", re.IGNORECASE)
_BACK, _ALONE = "0000", "SF0F"
_PLAN = re.compile(r"[A-Z][A-Z0-9\s]{3,}(;[\d\s]*)?")
_MAX_CHARACTERS = 100_000  # Longer files are no body plans


def load_organism(what: int | str | Path | Organism, scout: ScoutConfig | None = None) -> Organism:
    """Return the organism that a number, a name, a body plan or a file of one describes.

    Args:
        what: length of a snake; "snake8", "cross" or "cross3" (length of its arms), "H" or "H5" (length of its spine);
            a body plan such as "SBSF0000"; the path of a text file with a body plan, where lines that begin with # are
            comments; or an organism, which is returned.
        scout: constants of the modules; None for the defaults.

    Raises:
        OrganismError: there is no such shape or file, the plan does not parse or contains other robots than Scouts, a
            dock is used twice, two arms or two sockets meet, or modules overlap.
    """
    if isinstance(what, Organism):
        return what
    if isinstance(what, int | np.integer) and not isinstance(what, bool):
        return snake(int(what), scout)
    if not isinstance(what, str | Path):
        raise OrganismError(f"an organism is a number, a name, a body plan or a file of one, got {what!r}")
    text = str(what).strip()
    name = _NAME.fullmatch(text)
    if name and name[1].lower() in _SHAPES:
        make, size = _SHAPES[name[1].lower()]
        return make(int(name[2] or size), scout)
    if _PLAN.fullmatch(text):
        return _read_plan(text, scout)
    return _read_plan(_read_file(text), scout)


def organism_to_text(organism: Organism) -> str:
    """Return the body plan of an organism, which `load_organism` reads.

    The constants of the modules are not part of it.
    """
    sides = {}  # (module, its neighbor) -> side of the module
    for docking in organism.dockings:
        sides[docking.first, docking.second] = docking.first_side
        sides[docking.second, docking.first] = docking.second_side
    words, parents, open_modules = [], organism.parents, [0]
    for module in organism.order[1:]:
        parent = parents[module]
        while open_modules[-1] != parent:
            open_modules.pop()
            words.append(_BACK)
        words.append(f"S{_LETTERS[sides[parent, module]]}S{_LETTERS[sides[module, parent]]}")
        open_modules.append(module)
    words += [_BACK] * (len(open_modules) - 1) if len(words) else [_ALONE, _BACK]
    is_listed = organism.order == tuple(range(organism.num_modules))
    return "".join(words) + ("" if is_listed else "; " + " ".join(map(str, organism.order)))


def _read_file(path: str) -> str:
    """Return the body plan in a file."""
    try:
        with Path(path).open(encoding="utf-8") as file:
            text = file.read(_MAX_CHARACTERS + 1)
    except (OSError, ValueError) as error:
        what = "a body plan, a readable file of one, nor a name such as 'snake8', 'cross' or 'H'"
        raise OrganismError(f"no organism {path!r}: neither {what}") from error
    if len(text) > _MAX_CHARACTERS:
        raise OrganismError(f"{path} is longer than {_MAX_CHARACTERS} characters; that is no body plan")
    return " ".join(line for line in text.splitlines() if not line.lstrip().startswith("#"))


def _read_plan(text: str, scout: ScoutConfig | None) -> Organism:
    """Return the organism of a body plan."""
    plan, _, order = text.partition(";")
    plan = "".join(plan.split())
    words = [plan[i : i + 4] for i in range(0, len(plan), 4)]
    if not words or len(words[-1]) < 4:
        raise _make_error(text, f"it has {len(plan)} characters, which is no multiple of 4 above 0")
    dockings = _read_words(words, text)
    count = len(dockings) + 1
    if order.strip():
        numbers = [int(number) if number.isdecimal() else -1 for number in order.split()]
        if sorted(numbers) != list(range(count)) or numbers[0] != 0:
            raise _make_error(text, f"its numbers must be 0 to {count - 1} in any order, 0 first")
        dockings = [replace(d, first=numbers[d.first], second=numbers[d.second]) for d in dockings]
    dockings.sort(key=lambda docking: docking.first)
    return Organism(count, tuple(dockings), scout or ScoutConfig())


def _read_words(words: list[str], text: str) -> list[Docking]:
    """Return the dockings of a plan, whose modules are numbered as listed."""
    if len(words) == 2 and words[0][::2] == "S0" and words[1] == _BACK:
        return []  # a module alone
    dockings: list[Docking] = []
    open_modules = [0]
    for place, word in enumerate(words):
        if word == _BACK:
            if len(open_modules) == 1:
                raise _make_error(text, f"'0000' at character {4 * place} goes back from module 0")
            open_modules.pop()
            continue
        for robot, side in (word[:2], word[2:]):
            if robot in _OTHER_ROBOTS:
                raise _make_error(text, f"it contains a {_OTHER_ROBOTS[robot]}; only Scouts (S) are modeled")
            if robot != "S" or side not in _SIDES:
                raise _make_error(
                    text, f"{word!r} at character {4 * place} is no docking such as 'SBSF', nor '0000'"
                )
        new = len(dockings) + 1
        dockings.append(Docking(new, _SIDES[word[3]], open_modules[-1], _SIDES[word[1]]))
        open_modules.append(new)
    if len(open_modules) > 1:
        raise _make_error(text, f"{len(open_modules) - 1} '0000' are missing at its end")
    return dockings


def _make_error(text: str, what: str) -> OrganismError:
    short = text if len(text) <= 60 else f"{text[:57]}..."
    return OrganismError(f"cannot read the body plan {short!r}: {what}")


def make_random_organism(
    num_modules: int, rng: np.random.Generator, scout: ScoutConfig | None = None
) -> Organism:
    """Return a tree of modules, each docked at random to one of those before it: its arm to a socket, or the other's
    arm to a socket of its own.

    Args:
        num_modules: number of modules.
        rng: drawn from.
        scout: constants of the modules; None for the defaults.

    Raises:
        OrganismError: fewer than one module.
    """
    if num_modules < 1:
        raise OrganismError(f"an organism needs at least 1 module, got {num_modules}")
    body = Organism(1, scout=scout or ScoutConfig())
    while body.num_modules < num_modules:
        new = body.num_modules
        docking = Docking(new, str(rng.choice(SIDES)), int(rng.integers(new)), str(rng.choice(SIDES)))
        try:
            body = Organism(new + 1, (*body.dockings, docking), body.scout)
        except OrganismError:
            continue  # a side is taken, two arms or two sockets meet, or the module would lie on another
    return body
