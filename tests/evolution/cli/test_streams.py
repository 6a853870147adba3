"""The command line at the end of a pipe, in any locale, with any names: real processes, no traceback."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import toys

from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve, load_run

ROOT = Path(__file__).parents[3]
SYMBRION = f"{sys.executable} -c 'from evolution._src.cli.main import main; main()'"
NAME = os.fsdecode(b"[bold]r\xc3\xbcn[/bold] $x^$ \xff\x1b[31m")
"""Markup, a letter beyond ASCII, bad mathematics, a byte that is no UTF-8, a control sequence."""
pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="needs bash, /dev/full and names of any bytes"
)
ASCII = {"LC_ALL": "C", "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / NAME
    config = EvolutionConfig(arena="truth", modules=3, population_size=4, trials=1, generations=1)
    evolve(replace(config, folder=str(folder)), simulate=toys.bowl)
    return folder


def shell(line, place, **environment):
    """Run a line of bash with the exit code of the first command in its pipe."""
    return subprocess.run(
        ["bash", "-c", f"{line}; exit ${{PIPESTATUS[0]}}"],
        capture_output=True,
        text=True,
        errors="replace",
        cwd=place,
        env=os.environ | {"PYTHONPATH": str(ROOT)} | environment,
        timeout=300,
    )


@pytest.mark.slow
def test_a_run_continues_when_nobody_reads(folder):
    line = f"exec 2> >(true); sleep 0.1; {SYMBRION} resume ./* --generations 2 --workers 1 | true"
    done = shell(line, folder.parent)
    assert (done.returncode, done.stderr) == (0, "")
    assert len(load_run(folder).history) == 2


@pytest.mark.slow
def test_any_name_in_any_locale(folder):
    done = shell(
        f"{SYMBRION} replay ./*m --trials 1 && {SYMBRION} replay ./*m --trials 1 --json",
        folder.parent,
        **ASCII,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    table, summary = done.stdout.split("{", 1)
    assert table.isascii()
    assert "\x1b" not in done.stdout
    assert json.loads("{" + summary)["trials"] == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("--version > /dev/full", "No space left"),
        ("--version >&-", ""),
        ("replay $'\\xff\\x1b'", r"\udcff\x1b"),
    ],
)
def test_streams_that_cannot_be_written(line, message, tmp_path):
    done = shell(f"{SYMBRION} {line}", tmp_path, **ASCII)
    assert done.returncode == (0 if not message else 1 if "full" in line else 2)
    assert len(done.stderr.splitlines()) == bool(message)
    assert message in done.stderr
