"""The boxed report of the parser of options as one line: what is wrong, and where the help is."""

import re
from collections.abc import Sequence

from evolution._src.cli.commands import COMMANDS

_REPLACED = (
    (r"\[/?bold\]", ""),
    (r"For full helptext, (?:run|see):? ", "See "),
    (r"Argument helptext:.*?(?=See )", ""),
    (r"Error parsing (-[\w.-]+): ", r"\1: "),
    (r"invalid literal for int\(\) with base 10: ('.*?')", r"\1 is not a whole number"),
    (r"could not convert string to float: ('.*?')", r"\1 is not a number"),
    (r"\{None\}\|", ""),
    (r"\s+", " "),
    (r"[.;]? *See symbrion\b[^;]*--help$", ""),
)
_UNION = re.compile(
    r"no type matching (.*?) could be instantiated from \[(.*?)\]\. Got errors: .*?(?= See symbrion|$)"
)
_NUMBERS = {"INT": "whole number", "FLOAT": "number"}
"""What stands for numbers in the parser's reports, in words."""
_HINT = re.compile(r"(--[\w.-]+) .*? in symbrion (\S+) --help")


def flatten_report(report: str, arguments: Sequence[str]) -> str:
    """Return the report of the parser as one line."""
    lines = [re.sub(r"[╭╮╰╯│]", " ", line).strip() for line in report.splitlines()]
    text = " ".join(line for line in lines[1:] if line.strip("─- ")).strip()
    for pattern, replacement in _REPLACED:
        text = re.sub(pattern, replacement, text)
    text = _UNION.sub(lambda found: f"{found[2]} is not {_name_kinds(found[1])}", text)
    return _shorten_hints(text, _find_command(arguments))


def point_to_help(text: str, arguments: Sequence[str]) -> str:
    """Return a line about a wrong command line that ends with the help of its command."""
    return f"{text.rstrip('.;: ')}; see {' '.join(('symbrion', _find_command(arguments))).strip()} --help"


def _find_command(arguments: Sequence[str]) -> str:
    return next((word for word in arguments if word in COMMANDS), "")


def _name_kinds(kinds: str) -> str:
    """Return in words what the parser would have taken, such as "a number or unlimited" for "FLOAT|{unlimited}"."""
    names = []
    for kind in kinds.split("|"):
        words = re.findall(r"[^\s{}\[\]]+", kind.replace("...", ""))
        number = _NUMBERS.get(words[0]) if words else None
        if number is None or set(words) != {words[0]}:
            names += [name for word in words for name in word.split(",") if name != "None"]
        elif "..." in kind:
            names.append(f"{number}s")
        else:
            names.append(f"a {number}" if len(words) == 1 else f"{len(words)} {number}s")
    return " or ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def _shorten_hints(text: str, command: str) -> str:
    """Return a text whose proposals are names of options, of the command if it has some."""
    lead, found, hints = text.partition(" Perhaps you meant: ")
    if not found:
        return text
    proposals = _HINT.findall(hints)
    own = [flag for flag, where in proposals if where == command] or [flag for flag, _ in proposals]
    return f"{lead}; perhaps you meant {' or '.join(dict.fromkeys(own))}" if own else lead
