"""The command `symbrion`: one subcommand for each step of the pipeline, and `demo` for all of them.

Exit codes: 0 success, 1 the work failed, 2 wrong usage, 3 an accuracy was missed under `--strict`, 130 interrupted by
the keyboard. Errors are one line on standard error; results go to standard output, as JSON with `--json`.
"""

import contextlib
import io
import json
import logging
import sys
from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

import tyro

from evolution._src.cli.command import Command, UsageError
from evolution._src.cli.commands import COMMANDS
from evolution._src.cli.console import Console, flush_streams, is_unread, prepare_streams
from evolution._src.cli.usage_errors import flatten_report
from evolution._src.errors import RunError
from reconstruction._src.base.errors import ReconstructionError, ScanError
from reconstruction._src.base.extras import MissingExtraError
from reconstruction._src.base.printable import make_printable
from symbrion_gym._src.errors import ArenaError, OrganismError

DESCRIPTION = """From a laser scan to a snake of docked robots that crosses the pit.

The pipeline, one subcommand for each step:
survey (scan an arena) -> reconstruct (points to surface) -> arena (surface to MuJoCo geometry; `view` shows it)
-> evolve (CMA-ES) -> replay (judge the champion, record a video). `symbrion demo` runs all of them.
`symbrion --version` prints the version."""

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
    except OSError as error:  # of the streams; `run` reports those of the work
        code, problem = 0, error
    problem = flush_streams() or problem
    if problem is not None and not is_unread(problem):
        code = _fail(problem, 1)
    sys.exit(code)


def run(arguments: Sequence[str]) -> int:
    """Run one command line."""
    if list(arguments) == ["--version"]:
        sys.stdout.write(f"symbrion-gym {version('symbrion-gym')}\n")
        return 0
    try:
        command = _parse(arguments)
    except SystemExit as end:  # --help, or wrong usage, which is already reported
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
        return _fail(
            "; ".join(filter(None, ("interrupted by the keyboard", command.explain_interruption()))), 130
        )
    if command.json:
        _print_json(summary)
    return int(summary.get("exit_code", 0 if summary.get("ok", True) else 1))


def _parse(arguments: Sequence[str]) -> Command:
    """Return the command of a command line."""
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
    except RunError as error:  # of an option that is a part of the configuration
        sys.exit(_fail(error, 2))
    except SystemExit as end:
        if end.code:
            _fail(flatten_report(errors.getvalue(), arguments), 2)
        else:
            sys.stderr.write(errors.getvalue())
        raise


def _fail(error: object, code: int) -> int:
    """Print an error as one line; return the exit code."""
    text = make_printable(" ".join(str(error).split())) or type(error).__name__
    with contextlib.suppress(BrokenPipeError):
        sys.stderr.write(f"symbrion: {text}\n")
    return code


def _print_json(summary: dict[str, Any]) -> None:
    with contextlib.suppress(BrokenPipeError):
        sys.stdout.write(json.dumps(summary, default=_to_plain) + "\n")


def _to_plain(value: object) -> object:
    """Return paths, arrays and NumPy numbers as JSON content."""
    tolist = getattr(value, "tolist", None)
    return tolist() if tolist else str(value)


if __name__ == "__main__":
    main()
