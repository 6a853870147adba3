"""The command `symbrion`: one subcommand a step of the road, and `demo` for the whole of it.

Exit codes: 0 done, 1 the work failed, 2 wrong use, 130 stopped by the keyboard. Errors are one line on standard
error; results go to standard output, as JSON with `--json`.
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

from evolution.cli.command import Command, UsageError
from evolution.cli.commands import COMMANDS
from evolution.cli.console import Console
from evolution.cli.streams import flush_streams, is_unread, prepare_streams
from evolution.errors import RunError
from reconstruction.errors import ReconstructionError, ScanError
from reconstruction.extras import MissingExtraError
from reconstruction.files.printable import make_printable
from symbrion_gym.errors import ArenaError, OrganismError

DESCRIPTION = """From a laser scan to a snake of docked robots that crosses the pit.

The road, a subcommand a step:
survey (scan an arena) -> reconstruct (surface from points) -> arena (surface to MuJoCo geometry)
-> evolve (CMA-ES) -> replay (judge and film the champion). `symbrion demo` walks all of it.
`symbrion --version` tells the release."""

EXPECTED_ERRORS = (
    ScanError,
    ReconstructionError,
    ArenaError,
    OrganismError,
    RunError,
    MissingExtraError,
    OSError,
    MemoryError,
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit with its code."""
    prepare_streams()
    problem: OSError | None = None
    try:
        code = run(sys.argv[1:] if arguments is None else arguments)
    except OSError as error:  # of the streams: those of the work are told by `run`
        code, problem = 0, error
    problem = flush_streams() or problem
    if problem is not None and not is_unread(problem):
        code = _fail(problem, 1)
    sys.exit(code)


def run(arguments: Sequence[str]) -> int:
    """Run one command line.

    Args:
        arguments: the words after `symbrion`.

    Returns:
        The exit code: 0 done, 1 failed, 2 wrong use, 130 stopped by the keyboard.
    """
    if list(arguments) == ["--version"]:
        sys.stdout.write(f"symbrion-gym {version('symbrion-gym')}\n")
        return 0
    try:
        command = _parse(arguments)
    except SystemExit as end:  # --help, or wrong use already reported
        return int(end.code or 0)
    console = Console(quiet=command.quiet or command.json, mute=command.json)
    logging.basicConfig(level=logging.WARNING, format="symbrion: %(message)s", stream=sys.stderr)
    try:
        with console:
            summary = command.run(console)
    except UsageError as error:
        return _fail(error, 2)
    except EXPECTED_ERRORS as error:
        return _fail(error, 1)
    except KeyboardInterrupt:
        return _fail("stopped by the keyboard", 130)
    if command.json:
        _print_json(summary)
    return 0 if summary.get("ok", True) else 1


def _parse(arguments: Sequence[str]) -> Command:
    """Return the command that the words ask for; raise SystemExit with 0 after `--help`, 2 after wrong use."""
    errors = io.StringIO()
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
            _fail(_flatten(errors.getvalue()), 2)
        else:
            sys.stderr.write(errors.getvalue())
        raise


def _flatten(report: str) -> str:
    """Make one line of the parser's boxed report: what is wrong, and where the help is."""
    lines = [re.sub(r"[╭╮╰╯│]", " ", line).strip() for line in report.splitlines()]
    lines = [line for line in lines[1:] if line.strip("─- ")]
    text = " ".join(lines)
    text = re.sub(r"For full helptext, (?:run|see):? ", "See ", text)
    text = re.sub(r"Argument helptext:.*?(?=See )", "", text)
    return re.sub(r"\s+", " ", text).strip()


def _fail(error: object, code: int) -> int:
    text = make_printable(" ".join(str(error).split())) or type(error).__name__
    with contextlib.suppress(BrokenPipeError):
        sys.stderr.write(f"symbrion: {text}\n")
    return code


def _print_json(summary: dict) -> None:
    with contextlib.suppress(BrokenPipeError):
        sys.stdout.write(json.dumps(summary, default=_to_plain) + "\n")


def _to_plain(value: object) -> object:
    """Turn paths, arrays and NumPy numbers into what JSON knows."""
    tolist = getattr(value, "tolist", None)
    return tolist() if tolist else str(value)


if __name__ == "__main__":
    main()
