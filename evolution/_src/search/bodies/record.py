"""Everything that bodies have learned, as JSON: the checkpoint of a search for bodies.

The search is a function of the results. To resume it, it begins again and takes from the record what was tried before,
so that nothing but numbers and text is stored.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from evolution._src.errors import RunError
from evolution._src.search.bodies.genome import parse_genome
from evolution._src.search.bodies.learning import LevelResult

FORMAT = "symbrion bodies 1"


class BodyRecord:
    """Results of bodies, and the fitness of all genotypes that they tried, in order."""

    def __init__(self) -> None:
        self._results: dict[tuple[str, int], LevelResult] = {}
        self._generations: dict[str, list[list[float]]] = {}

    @property
    def results(self) -> list[LevelResult]:
        """All results, in the order in which they were learned."""
        return list(self._results.values())

    @property
    def num_results(self) -> int:
        """Number of results."""
        return len(self._results)

    @property
    def seconds(self) -> float:
        """Simulated time of all results [s]."""
        return sum(result.seconds for result in self._results.values())

    def find(self, key: str, level: int) -> LevelResult | None:
        """Return what a body knew at the end of a level; None if it never came there."""
        return self._results.get((key, level))

    def find_until(self, result: LevelResult) -> list[LevelResult]:
        """Return what a body knew at the end of each level, up to that of a result."""
        found = (self.find(result.body.canonical_text, level) for level in range(result.level + 1))
        return [each for each in found if each is not None]

    def find_generations(self, key: str) -> Iterator[list[float]]:
        """Yield the fitness of each generation of a body."""
        yield from self._generations.get(key, [])

    def add_generation(self, key: str, fitness: list[float]) -> None:
        """Add the fitness of a generation of a body."""
        self._generations.setdefault(key, []).append(fitness)

    def add_result(self, result: LevelResult) -> None:
        """Add what a body knows at the end of a level."""
        self._results[result.body.canonical_text, result.level] = result

    def to_bytes(self, digest: str) -> bytes:
        """Return the content of the file; equal records give equal bytes."""
        content = {
            "format": FORMAT,
            "digest": digest,
            "results": [_result_to_json(result) for result in self.results],
            "generations": self._generations,
        }
        return json.dumps(content, separators=(",", ":")).encode()

    @classmethod
    def from_bytes(cls, content: bytes, digest: str, source: str) -> BodyRecord:
        """Read the content of the file."""
        try:
            read = json.loads(content)
            if read["format"] != FORMAT:
                raise RunError(f"{source} has format {read['format']!r}, not {FORMAT!r}; resume it with the release "
                               "that began it, or start again in another folder")  # fmt: skip
            if read["digest"] != digest:
                raise RunError(f"{source} belongs to another configuration; restore config.json from a copy")
            record = cls()
            for each in read["results"]:
                record.add_result(_result_from_json(each))
            for key, history in read["generations"].items():
                for fitness in history:
                    record.add_generation(str(key), [float(value) for value in fitness])
        except RunError:
            raise
        except Exception as error:  # a damaged or foreign file can be wrong in any way
            raise RunError(
                f"{source} is damaged or not a record of bodies ({error}); restore it from a copy, or start again in "
                "another folder"
            ) from error
        return record


def _result_to_json(result: LevelResult) -> dict[str, Any]:
    return result._asdict() | {"body": result.body.text}


def _result_from_json(content: dict[str, Any]) -> LevelResult:
    return LevelResult(
        body=parse_genome(content["body"]),
        level=int(content["level"]),
        fitness=float(content["fitness"]),
        successes=int(content["successes"]),
        trials=int(content["trials"]),
        effort=float(content["effort"]),
        genotype=tuple(float(value) for value in content["genotype"]),
        names=tuple(str(name) for name in content["names"]),
        curve=tuple(float(value) for value in content["curve"]),
        seconds=float(content["seconds"]),
    )
