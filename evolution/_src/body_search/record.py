"""Everything that bodies have learned, as JSON: the checkpoint of a search for bodies.

The search is a function of the lessons. To resume it, it begins anew and takes from the record what was tried before,
so that nothing but numbers and text is stored.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from evolution._src.bodies.genome import parse_genome
from evolution._src.body_search.learning import Lesson, Pupil
from evolution._src.errors import RunError

FORMAT = "symbrion bodies 1"


class BodyRecord:
    """Lessons of bodies, and the fitness of all genotypes that they tried, in order."""

    def __init__(self) -> None:
        self._lessons: dict[tuple[str, int], Lesson] = {}
        self._generations: dict[str, list[list[float]]] = {}

    @property
    def lessons(self) -> list[Lesson]:
        """All lessons, in the order in which they were learned."""
        return list(self._lessons.values())

    @property
    def num_lessons(self) -> int:
        """Number of lessons."""
        return len(self._lessons)

    @property
    def seconds(self) -> float:
        """Simulated time of all lessons [s]."""
        return sum(lesson.seconds for lesson in self._lessons.values())

    def find(self, key: str, rung: int) -> Lesson | None:
        """Return what a pupil knew at the end of a rung; None if it never came there."""
        return self._lessons.get((key, rung))

    def find_until(self, lesson: Lesson) -> list[Lesson]:
        """Return what a pupil knew at the end of each rung, up to that of a lesson."""
        found = (self.find(lesson.pupil.key, rung) for rung in range(lesson.rung + 1))
        return [each for each in found if each is not None]

    def find_generations(self, key: str) -> Iterator[list[float]]:
        """Yield the fitness of each generation of a pupil."""
        yield from self._generations.get(key, [])

    def add_generation(self, key: str, fitness: list[float]) -> None:
        """Add the fitness of a generation of a pupil."""
        self._generations.setdefault(key, []).append(fitness)

    def add_lesson(self, lesson: Lesson) -> None:
        """Add what a pupil knows at the end of a rung."""
        self._lessons[lesson.pupil.key, lesson.rung] = lesson

    def to_bytes(self, digest: str) -> bytes:
        """Return the content of the file; equal records give equal bytes."""
        content = {
            "format": FORMAT,
            "digest": digest,
            "lessons": [_lesson_to_json(lesson) for lesson in self.lessons],
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
            for each in read["lessons"]:
                record.add_lesson(_lesson_from_json(each))
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


def _lesson_to_json(lesson: Lesson) -> dict[str, Any]:
    content = lesson._asdict() | {"body": lesson.pupil.body.text, "inherited": lesson.pupil.genes}
    del content["pupil"]
    return content


def _lesson_from_json(content: dict[str, Any]) -> Lesson:
    inherited = tuple((str(name), float(value)) for name, value in content["inherited"])
    return Lesson(
        pupil=Pupil(parse_genome(content["body"]), inherited),
        rung=int(content["rung"]),
        fitness=float(content["fitness"]),
        successes=int(content["successes"]),
        trials=int(content["trials"]),
        effort=float(content["effort"]),
        genotype=tuple(float(value) for value in content["genotype"]),
        names=tuple(str(name) for name in content["names"]),
        curve=tuple(float(value) for value in content["curve"]),
        seconds=float(content["seconds"]),
    )
