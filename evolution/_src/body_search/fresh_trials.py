"""The fresh trials by which the champion of a search for bodies is confirmed, as JSON: `confirmation.json`.

They are a function of the configuration and of what the candidates have learned. So what is stored for a body counts
as long as it is a candidate, and is not tried again.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from evolution._src.body_search.learning import LevelResult
from evolution._src.errors import RunError
from evolution._src.search.validation import Validation, expect_success

FORMAT = "symbrion confirmation 1"


class Retrial(NamedTuple):
    """Fresh trials of a candidate.

    Attributes:
        key: the body.
        level: of its result.
        successes: of each round so far.
        seconds: simulated [s].
    """

    key: str
    level: int
    successes: tuple[int, ...] = ()
    seconds: float = 0.0


@dataclass(frozen=True)
class FreshTrials:
    """Fresh trials of the fittest bodies, as far as they are tried.

    Attributes:
        count: largest number of candidates.
        rules: rounds of trials, the share of successes needed to go on, and the start.
        tried: a retrial for each candidate, the fittest first.
    """

    count: int
    rules: Validation = field(default_factory=Validation)
    tried: tuple[Retrial, ...] = ()

    def begin(self, results: Sequence[LevelResult]) -> FreshTrials:
        """Return the fresh trials of the candidates among results, those that are known already included."""
        known = {(each.key, each.level): each for each in self.tried}
        keys = [(result.body.canonical_text, result.level) for result in find_candidates(results, self.count)]
        return replace(self, tried=tuple(known.get(key, Retrial(*key)) for key in keys))

    def has_rules(self, rules: Validation) -> bool:
        """Return whether these trials follow some rules."""
        return _list_rules(self.rules) == _list_rules(rules)

    def count_trials(self, retrial: Retrial) -> int:
        """Return how many trials a candidate has had."""
        return sum(self.rules.rounds[: len(retrial.successes)])

    def find_due(self, number: int) -> list[int]:
        """Return the indices of the candidates that go on with a round and have not had it."""
        return [
            index
            for index, each in enumerate(self.tried)
            if len(each.successes) == number
            and sum(each.successes) >= self.rules.continue_share * self.count_trials(each)
        ]

    @property
    def is_complete(self) -> bool:
        """Whether each candidate has had all rounds or has dropped out."""
        return bool(self.tried) and not any(self.find_due(number) for number in range(len(self.rules.rounds)))

    def find_best(self) -> int:
        """Return the index of the candidate of the highest expected success rate; of equal ones the fittest."""
        rates = [expect_success(sum(each.successes), self.count_trials(each)) for each in self.tried]
        return int(np.argmax(rates))

    def add_round(self, index: int, successes: int, seconds: float) -> FreshTrials:
        """Return these trials and a further round of a candidate."""
        each = self.tried[index]
        more = each._replace(successes=(*each.successes, successes), seconds=each.seconds + seconds)
        return replace(self, tried=(*self.tried[:index], more, *self.tried[index + 1 :]))

    def to_bytes(self, digest: str) -> bytes:
        """Return the content of the file; equal trials give equal bytes."""
        content = {"format": FORMAT, "digest": digest, "candidates": self.count}
        content |= _list_rules(self.rules) | {"tried": [each._asdict() for each in self.tried]}
        return (json.dumps(content, indent=1) + "\n").encode()

    @classmethod
    def from_bytes(cls, content: bytes, digest: str, source: str) -> FreshTrials:
        """Read the content of the file."""
        try:
            read = json.loads(content)
            if (read["format"], read["digest"]) != (FORMAT, digest):
                raise RunError(
                    f"{source} belongs to another configuration or release; remove it, and resume the run"
                )
            rules = Validation(**{name: read[name] for name in _list_rules(Validation())})
            return cls(int(read["candidates"]), rules, tuple(_read_retrial(each) for each in read["tried"]))
        except RunError:
            raise
        except Exception as error:  # a damaged or foreign file can be wrong in any way
            raise RunError(f"{source} is damaged ({error}); remove it, and resume the run") from error


def find_candidates(results: Sequence[LevelResult], count: int) -> list[LevelResult]:
    """Return the fittest result of each of the fittest bodies, among results with an exam if there are such."""
    examined = [result for result in results if result.trials] or list(results)
    order = sorted(examined, key=lambda each: (-each.fitness, -each.level, each.body.canonical_text))
    fittest: dict[str, LevelResult] = {}
    for result in order:
        fittest.setdefault(result.body.canonical_text, result)
    return list(fittest.values())[:count]


def _list_rules(rules: Validation) -> dict[str, Any]:
    """Return those rules that decide fresh trials."""
    return {"rounds": list(rules.rounds), "continue_share": rules.continue_share, "start": rules.start}


def _read_retrial(content: dict[str, Any]) -> Retrial:
    successes = tuple(int(each) for each in content["successes"])
    return Retrial(str(content["key"]), int(content["level"]), successes, float(content["seconds"]))
