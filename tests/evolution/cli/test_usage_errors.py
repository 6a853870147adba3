"""Wrong usage is one line that names the command, the value and where the help is, and no class of ours."""

import pytest

from evolution._src.cli.main import run


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("evolve --seed x", "--seed: 'x' is not a whole number; see symbrion evolve --help"),
        ("evolve --trials x", "--trials: 'x' is not a whole number; see symbrion evolve --help"),
        ("evolve --bodies x", "--bodies: 'x' is not whole numbers; see symbrion evolve --help"),
        ("evolve --bodies 2 1", "smallest <= largest modules, got 2 and 1; see symbrion evolve --help"),
        (
            "evolve --bodies 1 2 3",
            "for example --bodies 1 8; or one number for both; see symbrion evolve --help",
        ),
        ("evolve --start 1", "--start: '1' is not floor, pit or 2 numbers; see symbrion evolve --help"),
        ("evolve --arena nowhere", "an arena folder or a mesh file; see symbrion evolve --help"),
        ("bench-suite run --methods x", "perhaps you meant --method; see symbrion bench-suite --help"),
        ("replay", "see symbrion replay --help"),
        ("evolve --task", "see symbrion evolve --help"),
        ("evolve --algorithm foo --bodies 1 2", "'exhaustive'); see symbrion evolve --help"),
        ("--foo", "; see symbrion --help"),
    ],
)
def test_the_line_says_what_is_wrong_and_where_the_help_is(words, line, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(words.split()) == 2
    (printed,) = capsys.readouterr().err.splitlines()
    assert printed.endswith(line)
    assert not any(word in printed for word in ("Error parsing", "NoneType", "<class", "Got errors"))
    assert printed.count("--help") == 1
