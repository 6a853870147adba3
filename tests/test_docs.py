"""The documentation is correct: its links exist, its command lines parse, its Python runs, the site builds."""

import contextlib
import io
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import tyro

from evolution._src.cli.command import UsageError
from evolution._src.cli.commands import COMMANDS

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))]
MOST_PAGES, MOST_WORDS = 16, 20_000  # of docs; of docs and README
LONGEST_README = 6_000  # [bytes]
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def _name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def find_commands(page: Path) -> list[list[str]]:
    """Return the arguments of every `symbrion` command line in code blocks and inline code."""
    text = page.read_text()
    lines = [line for language, block in BLOCK.findall(text) if not language for line in block.splitlines()]
    lines += re.findall(r"`(symbrion [a-z][^`]*)`", BLOCK.sub("", text))
    return [line.split("#")[0].split()[1:] for line in lines if line.startswith("symbrion ")]


def find_programs(page: Path) -> list[str]:
    """Return the Python blocks of a page, in order."""
    return [block for language, block in BLOCK.findall(page.read_text()) if language == "python"]


WITH_COMMANDS = [page for page in PAGES if find_commands(page)]
WITH_PROGRAMS = [page for page in PAGES if find_programs(page)]


@pytest.mark.parametrize("page", WITH_COMMANDS, ids=_name)
def test_command_lines_parse(page: Path) -> None:
    for words in find_commands(page):
        if len(words) == 1:
            assert words[0] in COMMANDS
            continue
        errors = io.StringIO()
        try:
            with contextlib.redirect_stderr(errors):
                tyro.extras.subcommand_cli_from_dict(
                    COMMANDS,
                    args=words,
                    config=(tyro.conf.OmitSubcommandPrefixes, tyro.conf.FlagCreatePairsOff),
                )
        except UsageError:  # files that the words name may be absent
            continue
        except SystemExit:  # a word such as N may stand for a number
            assert "Value error" in errors.getvalue(), f"symbrion {' '.join(words)}\n{errors.getvalue()}"


@pytest.mark.parametrize("page", PAGES, ids=_name)
def test_links_exist(page: Path) -> None:
    for link in re.findall(r"\]\(([^)#\s]+)[^)]*\)", BLOCK.sub("", page.read_text())):
        assert link.startswith("https://") or (page.parent / link).exists(), link


@pytest.mark.parametrize("page", PAGES, ids=_name)
def test_make_targets_exist(page: Path) -> None:
    text = page.read_text()
    lines = [line for language, block in BLOCK.findall(text) if not language for line in block.splitlines()]
    lines += re.findall(r"`(make [a-z][^`]*)`", BLOCK.sub("", text))
    makefile = (ROOT / "Makefile").read_text()
    for line in lines:
        if line.startswith("make "):
            for target in re.findall(r"\b[a-z-]+\b", line.split("#")[0].split("QUICK")[0])[1:]:
                assert re.search(rf"^{target}:", makefile, re.MULTILINE), line


def test_python_blocks_are_python() -> None:
    """Also those that are not run (`py`), as their files do not exist."""
    for page in PAGES:
        for language, block in BLOCK.findall(page.read_text()):
            if language in ("python", "py"):
                compile(block, _name(page), "exec")


def test_pages_are_few_and_short() -> None:
    pages = sorted(DOCS.rglob("*.md"))
    nav = (ROOT / "mkdocs.yml").read_text()
    assert len(pages) <= MOST_PAGES
    assert not [page for page in pages if str(page.relative_to(DOCS)) not in nav]
    readme = (ROOT / "README.md").read_text()
    assert len(readme.encode()) <= LONGEST_README
    assert sum(len(text.split()) for text in [readme, *(page.read_text() for page in pages)]) <= MOST_WORDS


@pytest.mark.slow
@pytest.mark.parametrize("page", WITH_PROGRAMS, ids=_name)
def test_programs_of_a_page_run_in_order(page: Path, tmp_path: Path) -> None:
    """But for the length of an evolution, which `make evidence` runs whole."""
    program = tmp_path / "page.py"
    program.write_text("\n".join(find_programs(page)).replace("generations=24", "generations=1"))
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, str(program)],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
