"""JSON from outside: strict numbers, bounded nesting, types by field."""

from dataclasses import dataclass

import pytest
from evil_json import DEEP

from reconstruction._src.base.printable import make_printable
from reconstruction._src.base.typed_json import JsonError, as_type, parse_json, read_json


@dataclass(frozen=True)
class Wheel:
    radius: float
    spokes: int = 3


@dataclass(frozen=True)
class Cart:
    wheels: tuple[Wheel, ...]
    name: str | None = None

    def __post_init__(self) -> None:
        if not self.wheels:
            raise ValueError("wheels are needed")


def test_content_becomes_its_type() -> None:
    content = parse_json('{"wheels": [{"radius": 1}, {"radius": 0.5, "spokes": 4}]}')
    assert as_type(content, Cart) == Cart((Wheel(1.0), Wheel(0.5, 4)))
    assert isinstance(as_type(content, Cart).wheels[0].radius, float)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[]", "cart: Expected `object`, got `array`"),
        ("{}", "cart: lacks the field `wheels`"),
        ('{"wheels": []}', "cart: wheels are needed"),
        ('{"wheels": [{"radius": "1"}]}', r"cart\.wheels\[0\]\.radius: Expected `float`, got `str`"),
        ('{"wheels": [{"radius": true}]}', r"cart\.wheels\[0\]\.radius: Expected `float`, got `bool`"),
        ('{"wheels": [{"radius": 1, "spokes": 3.5}]}', r"spokes: Expected `int`, got `float`"),
        ('{"wheels": [{"radius": 1, "tyre": 0}]}', r"cart\.wheels\[0\] has unknown entries \['tyre'\]"),
    ],
)
def test_what_is_wrong_is_named(text: str, said: str) -> None:
    with pytest.raises(JsonError, match=said):
        as_type(parse_json(text), Cart, "cart")


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_numbers_are_finite(number: str) -> None:
    with pytest.raises(JsonError, match=r"b\[1\]\.c is (nan|-?inf)"):
        parse_json(f'{{"a": 1, "b": [0, {{"c": {number}}}]}}')


def test_nesting_is_bounded() -> None:
    assert parse_json("[" * 50 + "]" * 50)
    with pytest.raises(JsonError, match=r"b.* is nested deeper than 50"):
        parse_json(f'{{"a": "[[{{", "b": {DEEP}}}')
    with pytest.raises(JsonError, match="cannot be read as JSON"):
        parse_json("[" * 100_000 + "]" * 100_000)


@pytest.mark.parametrize("content", [b"", b"{", b"\xff\xfe", b"9" * 5000, b'{"a": 1} x'])
def test_damaged_files_are_refused_in_one_line(content: bytes, tmp_path) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(content)
    with pytest.raises(JsonError, match=r"cannot be read as JSON \(.*\)") as refusal:
        read_json(path)
    assert str(refusal.value).isprintable()


def test_what_is_no_file_is_refused(tmp_path) -> None:
    with pytest.raises(JsonError, match="no such file"):
        read_json(tmp_path / "absent.json")
    with pytest.raises(JsonError, match="no such file"):
        read_json(tmp_path)


def test_printable_text_has_no_control_characters() -> None:
    assert make_printable("Grüße 東京 a b") == "Grüße 東京 a b"
    assert make_printable("a\x1b[2J\n\udcffb") == "a\\x1b[2J\\n\\udcffb"
    assert len(make_printable("x" * 5000)) == 2003


@pytest.mark.parametrize("end", ["", '"}'])
def test_a_long_string_of_escapes_is_read_in_proportion(tmp_path, end: str) -> None:
    """Were it in proportion to the square, this would take an hour."""
    path = tmp_path / "long.json"
    path.write_text('{"a": "' + '\\"' * 400_000 + end)
    if end:
        assert len(read_json(path)["a"]) == 400_000
        return
    with pytest.raises(JsonError):
        read_json(path)
