"""What a claim is: words, and the paths in the results that its numbers come from."""

import math
import operator
import re
import statistics
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

REDUCTIONS: dict[str, Callable[[list[Any]], Any]] = {
    "only": lambda found: found[0],
    "min": min,
    "max": max,
    "median": statistics.median,
    "mean": statistics.fmean,
    "sum": sum,
    "count": len,
}
MM = 1000.0
PERCENT = 100.0
SENSES = {"<=": operator.le, ">=": operator.ge}


class ClaimError(ValueError):
    """A claim has no figure: its file or its path in the file is missing, or the entry there does not fit."""


@dataclass(frozen=True)
class Value:
    """The place of one number of a claim.

    Attributes:
        file: name of the results without `.json`.
        path: keys of `results` from the top, with `/` between them; `*` means every entry there. After ` | ` an
            older path may follow; the first one that exists is used.
        reduce: how several entries are combined: only, min, max, median, mean, sum, count.
        scale: factor into the unit of the claim (1000: from meters to millimeters).
        offset: added after that (-100: from 112 % of something to 12 % more than it).
        pattern: for an entry that is text, a regular expression whose first group is the number.
    """

    file: str
    path: str
    reduce: str = "only"
    scale: float = 1.0
    offset: float = 0.0
    pattern: str = ""

    def __post_init__(self) -> None:
        if self.reduce not in REDUCTIONS:
            raise ClaimError(f"no reduction {self.reduce!r}; there are: {', '.join(REDUCTIONS)}")

    def find_part(self, results: dict[str, Any]) -> str | None:
        """Return the part of the results that contains the number; None if it was never measured."""
        keys = self.path.split("/")
        return "/".join(keys[: _find_key(results, keys)]) or None

    def read(self, results: dict[str, Any]) -> float | int | str:
        """Return the number from the `results` of its file.

        Raises:
            ClaimError: there is no entry, or several where one is expected.
        """
        *places, last = self.path.split(" | ")
        path = next((place for place in places if _is_there(results, place)), last)
        found = [self._take(entry) for entry in _walk(results, path.split("/"), path)]
        if self.reduce == "only" and len(found) != 1:
            raise ClaimError(f"{len(found)} entries at {path!r}; say how to reduce them")
        reduced = REDUCTIONS[self.reduce](found)
        if (self.scale, self.offset) == (1.0, 0.0) or isinstance(reduced, str):
            return reduced
        return self.scale * reduced + self.offset

    def _take(self, entry: Any) -> Any:
        if not self.pattern:
            if self.reduce != "count" and (isinstance(entry, dict | list) or entry is None):
                raise ClaimError(f"no number at {self.path!r} but {entry!r:.60}")
            return entry
        match = re.search(self.pattern, str(entry))
        if match is None:
            raise ClaimError(f"{self.pattern!r} is not found in {entry!r:.60} at {self.path!r}")
        return float(match[1]) if "." in match[1] else int(match[1])


@dataclass(frozen=True)
class Claim:
    """One line of the table.

    Attributes:
        what: the quantity, as a sentence that is clear without the source.
        figure: a format string; `{0}` is the first of `values`.
        values: the places of the numbers.
        bar: the target, as `<= 1.0 mm`; its number is compared with value `bar_index`.
        bar_index: index of the value that the bar is about.
        is_headline: whether the row is in the README too.
        set_after: whether the bar, or the way of measuring, was set after a first figure was known.
        sources: the code that is measured, if not that of `claims/sources.py`.
    """

    what: str
    figure: str
    values: tuple[Value, ...]
    bar: str = ""
    bar_index: int = 0
    is_headline: bool = False
    set_after: bool = False
    sources: tuple[str, ...] = ()

    @property
    def file(self) -> str:
        """Name of the results that contain the first number."""
        return self.values[0].file

    def find_parts(self, records: dict[str, dict[str, Any]]) -> list[tuple[str, str]]:
        """Return file and part of the results that contain the numbers, as far as they were measured."""
        places = [
            (value.file, value.find_part(records.get(value.file, {}).get("results", {})))
            for value in self.values
        ]
        return list(dict.fromkeys((file, part) for file, part in places if part is not None))

    def is_measured(self, records: dict[str, dict[str, Any]]) -> bool:
        """Return whether the parts of the results that contain the numbers exist."""
        return all(value.find_part(records.get(value.file, {}).get("results", {})) for value in self.values)

    def read(self, records: dict[str, dict[str, Any]]) -> list[Any]:
        """Return the numbers.

        Args:
            records: file name -> its whole content.

        Raises:
            ClaimError: a file or a path is missing; the message names the claim and the remedy.
        """
        numbers = []
        for value in self.values:
            try:
                if value.file not in records:
                    raise ClaimError("there is no such file")
                numbers.append(value.read(records[value.file]["results"]))
            except ClaimError as error:
                raise ClaimError(
                    f"claim {self.what!r}, benchmarks/results/{value.file}.json: {error}; "
                    f"run `python -m benchmarks.{value.file}` or correct benchmarks/claims/"
                ) from None
        return numbers

    def format(self, records: dict[str, dict[str, Any]]) -> str:
        """Return the figure as text.

        Raises:
            ClaimError: a number is missing or does not fit the format.
        """
        numbers = self.read(records)
        try:
            return self.figure.format(*numbers)
        except (ValueError, IndexError) as error:
            raise ClaimError(
                f"claim {self.what!r}: {self.figure!r} does not fit {numbers}: {error}"
            ) from None

    def check_bar(self, records: dict[str, dict[str, Any]]) -> str:
        """Return the bar and whether it is met; empty without a bar.

        Raises:
            ClaimError: a number is missing, or the bar has no number.
        """
        if not self.bar:
            return ""
        match = re.match(r"(<=|>=) ([\d.]+)", self.bar)
        if match is None:
            raise ClaimError(f"claim {self.what!r}: a bar reads `<= 1.0 mm` or `>= 3 of 5`, not {self.bar!r}")
        number = float(self.read(records)[self.bar_index])
        is_met = math.isfinite(number) and SENSES[match[1]](number, float(match[2]))
        words = self.bar.replace("<=", "≤").replace(">=", "≥")
        return f"{words}: {'met' if is_met else '**missed**'}"


def _walk(entry: Any, keys: list[str], path: str) -> Iterator[Any]:
    if not keys:
        yield entry
        return
    key, *rest = keys
    joined = _find_key(entry, keys)
    if key == "*" and isinstance(entry, dict | list) and entry:
        for below in entry.values() if isinstance(entry, dict) else entry:
            yield from _walk(below, rest, path)
    elif isinstance(entry, dict) and joined:
        yield from _walk(entry["/".join(keys[:joined])], keys[joined:], path)
    elif isinstance(entry, list) and key.lstrip("-").isdigit() and -len(entry) <= int(key) < len(entry):
        yield from _walk(entry[int(key)], rest, path)
    else:
        there = ", ".join(map(repr, entry)) if isinstance(entry, dict) else f"a {type(entry).__name__}"
        raise ClaimError(f"no {key!r} on the way to {path!r}; there is {there:.200}")


def _is_there(results: dict[str, Any], path: str) -> bool:
    try:
        return any(True for _ in _walk(results, path.split("/"), path))
    except ClaimError:
        return False


def _find_key(entry: Any, keys: list[str]) -> int:
    """Return how many of the keys together are one key of the entry (`a/b` may be one), 0 if none are."""
    if not isinstance(entry, dict):
        return 0
    return next((n for n in range(1, len(keys) + 1) if "/".join(keys[:n]) in entry), 0)
