"""The command `symbrion`: one subcommand for each step of the pipeline, and `demo` for all of them.

Exit codes: 0 success, 1 the work failed, 2 wrong usage, 3 an arena is not good throughout under `--strict`, 130
interrupted by the keyboard. Errors are one line on standard error; results go to standard output, with `--json` as
JSON.
"""

import contextlib
import io
import json
import logging
import re
import sys
from collections.abc import Sequence
from importlib.metadata import version

import tyro

from evolution._src.cli.command import EXPECTED_ERRORS, Command, UsageError
from evolution._src.cli.commands import COMMANDS
from evolution._src.cli.console import Console, flush_streams, is_unread, prepare_streams
from reconstruction._src.base.printable import make_printable
from reconstruction._src.base.range_checks import check_choice

_REPLACED = (
    (r"\[/?bold\]", ""),
    (r"For full helptext, (?:run|see):? ", "See "),
    (r"Argument helptext:.*?(?=See )", ""),
    (r"Error parsing (-[\w.-]+): ", r"\1: "),
    (r"invalid literal for int\(\) with base 10: ('.*?')", r"\1 is not a whole number"),
    (r"could not convert string to float: ('.*?')", r"\1 is not a number"),
    (r"\{None\}\|", ""),
    (r"(?<=Expected one of \()[^)]*", lambda found: ", ".join(sorted({*found[0].split(", ")} - {"'None'"}))),
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


DESCRIPTION = """From a laser scan to a snake of docked robots that crosses the pit.

The pipeline, one subcommand for each step:
survey (scan an arena) -> reconstruct (points to surface) -> arena (surface to MuJoCo geometry; `view` shows it)
-> evolve (CMA-ES) -> replay (judge the champion, record a video). `symbrion demo` runs all of them.
`symbrion --version` prints the version."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit with its code."""
    prepare_streams()
    problem: OSError | None = None
    try:
        code = run(sys.argv[1:] if arguments is None else arguments)
    except OSError as error:  # of the streams; `run` reports those of the work
        code, problem = 0, error
    problem = flush_streams() or problem
    if problem is not None and not is_unread(problem):
        code = _fail(problem, 1)
    sys.exit(code)


class PrintableFormatter(logging.Formatter):
    """Names of files may hold what a terminal obeys."""

    def format(self, record: logging.LogRecord) -> str:
        return make_printable(super().format(record))


def run(arguments: Sequence[str]) -> int:
    """Run one command line."""
    if list(arguments) == ["--version"]:
        sys.stdout.write(f"symbrion-gym {version('symbrion-gym')}\n")
        return 0
    try:
        command = _parse(arguments)
    except UsageError as error:
        where = f"symbrion {_find_command(arguments)}".strip()
        return _fail(f"{str(error).rstrip('.;: ')}; see {where} --help", 2)
    except SystemExit:  # --help
        return 0
    console = Console(quiet=command.quiet or command.json, mute=command.json)
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(PrintableFormatter("symbrion: %(message)s"))
    logging.basicConfig(level=logging.WARNING, handlers=[handler])
    try:
        with console:
            summary = command.run(console)
    except UsageError as error:
        return _fail(error, 2)
    except EXPECTED_ERRORS as error:
        return _fail(error, 1)
    except KeyboardInterrupt:
        lines = "interrupted by the keyboard", command.explain_interruption()
        return _fail("; ".join(filter(None, lines)), 130)
    if command.json:
        with contextlib.suppress(BrokenPipeError):
            sys.stdout.write(json.dumps(summary, default=_to_plain) + "\n")
    return int(summary.get("exit_code", 0 if summary.get("ok", True) else 1))


def _parse(arguments: Sequence[str]) -> Command:
    """Return the command of a command line."""
    errors = io.StringIO()
    if arguments and not arguments[0].startswith("-"):
        check_choice("command", arguments[0], tuple(COMMANDS), UsageError)
    try:
        with contextlib.redirect_stderr(errors):
            return tyro.extras.subcommand_cli_from_dict(
                COMMANDS,
                prog="symbrion",
                description=DESCRIPTION,
                args=list(arguments) or ["--help"],
                config=(tyro.conf.OmitSubcommandPrefixes, tyro.conf.FlagCreatePairsOff),
                sort_subcommands=False,
            )
    except SystemExit as end:
        if end.code:
            raise UsageError(flatten_report(errors.getvalue(), arguments)) from end
        sys.stderr.write(errors.getvalue())
        raise


def _fail(error: object, code: int) -> int:
    """Print an error as one line; return the exit code."""
    text = make_printable(" ".join(str(error).split())) or type(error).__name__
    with contextlib.suppress(BrokenPipeError):
        sys.stderr.write(f"symbrion: {text}\n")
    return code


def _to_plain(value: object) -> object:
    """Return paths, arrays and NumPy numbers as JSON content."""
    tolist = getattr(value, "tolist", None)
    return tolist() if tolist else str(value)


if __name__ == "__main__":
    main()
