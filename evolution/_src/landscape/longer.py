"""The fittest bodies of the landscape again, with a longer time to learn: does the order of bodies depend on it?"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import ceil
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from evolution._src.backends.making import Backend, make_backend
from evolution._src.backends.simulation import Simulate
from evolution._src.body_search.config import BodyEvolutionConfig
from evolution._src.body_search.learner import EXAM, Assignment, Learner
from evolution._src.body_search.learning import Lesson, Pupil
from evolution._src.body_search.record import BodyRecord
from evolution._src.errors import RunError
from evolution._src.landscape.config import LandscapeConfig, make_search
from evolution._src.landscape.judging import Judgment, try_again
from evolution._src.landscape.reliability import correlate_ranks
from evolution._src.landscape.table import Landscape
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.base.typed_json import JsonError, read_json

FORMAT = "symbrion landscape, longer 1"
FILE = "longer.json"
COUNT = 20
TIMES = 10
COMMAND = "python -m benchmarks.landscape --only longer"
_CHUNK = 10
"""Bodies that learn side by side, and after which the state is stored."""


class Longer(NamedTuple):
    """A body that learned longer.

    Attributes:
        place: of the body in the landscape.
        lesson: what it learned.
        truth: how that fared in the truth, under the conditions of the exam.
    """

    place: int
    lesson: Lesson
    truth: Judgment


def lengthen(config: LandscapeConfig, times: int = TIMES) -> LandscapeConfig:
    """Return the configuration with at least so many times the genotypes for each body; the first ones are the same.

    Raises:
        RunError: `times` is below 1.
    """
    if times < 1:
        raise RunError(f"times is {times}; learn at least once as long")
    learning = config.learning
    short = learning.count_trials(0) - learning.exam_trials
    generations = 1 + ceil((times * short - 1) / learning.population_size)
    return replace(config, generations=(generations,))


def find_fittest(table: Landscape, task: str, count: int = COUNT) -> list[int]:
    """Return the places of the fittest bodies of a task, the fittest first; equals in the order of the table."""
    order = np.argsort(-table.fitness[table.find_task(task)], kind="stable")
    return [int(place) for place in order[:count]]


def learn_longer(
    table: Landscape,
    arenas: Mapping[str, Path],
    truths: Mapping[str, Path],
    folder: Path,
    times: int = TIMES,
    count: int = COUNT,
    workers: int = 1,
    simulate: Simulate | None = None,
    progress: Progress = silent,
) -> dict[str, list[Longer]]:
    """Let the fittest bodies of each task learn longer, and judge them in the truth; what is stored is not tried again.

    Args:
        table: the landscape.
        arenas: folder of the arena of each task.
        truths: folder of the exact arena of each task.
        folder: where lessons are kept.
        times: how many times as many genotypes each body tries.
        count: number of bodies of each task.
        workers: number of threads; they change nothing but the time.
        simulate: the function that tries jobs; None means physics.
        progress: called with what is being done and the share done.

    Raises:
        RunError: the folder has lessons of another configuration.
    """
    config = lengthen(table.config, times)
    backend = make_backend("batch", workers, simulate=simulate)
    found = {}
    try:
        for number, (name, arena) in enumerate(arenas.items()):
            search = make_search(config, name, arena)
            places = find_fittest(table, name, count)
            lessons: list[Lesson] = []
            for chunk in _learn(search, [table.bodies[place] for place in places], folder / name, backend):
                lessons += chunk
                progress(f"{name}: {len(lessons)} of {len(places)} learned longer", number / len(arenas))
            in_truth = make_search(config, name, truths[name])
            judged = try_again(backend, in_truth, lessons, (EXAM, 0), config.exam_trials)
            found[name] = [Longer(*each) for each in zip(places, lessons, judged, strict=True)]
    finally:
        backend.close()
    return found


def _learn(
    search: BodyEvolutionConfig, bodies: Sequence[Any], path: Path, backend: Backend
) -> Iterator[list[Lesson]]:
    """Yield the lessons of chunks of bodies; the record is stored after each."""
    path = path.with_suffix(".json")
    path.parent.mkdir(parents=True, exist_ok=True)
    record = BodyRecord()
    if path.is_file():
        record = BodyRecord.from_bytes(path.read_bytes(), search.digest(), str(path))
    learner = Learner(search, record, backend)
    for begin in range(0, len(bodies), _CHUNK):
        known = record.num_lessons
        lessons = learner.learn([Assignment(Pupil(body), 0) for body in bodies[begin : begin + _CHUNK]])
        if record.num_lessons > known:
            with write_atomically(path) as temporary:
                temporary.write_bytes(record.to_bytes(search.digest()))
        yield lessons


def save_longer(found: Mapping[str, Sequence[Longer]], table: Landscape, times: int, folder: Path) -> None:
    """Write what bodies learned longer beside the landscape."""
    tasks = {
        name: [
            {
                "body": table.bodies[each.place].canonical_text,
                "fitness": each.lesson.fitness,
                "successes": each.lesson.successes,
                "truth_fitness": each.truth.fitness,
                "truth_successes": each.truth.successes,
                "seconds": each.lesson.seconds,
                "genotype": each.lesson.genotype,
            }
            for each in rows
        ]
        for name, rows in found.items()
    }
    content = {
        "format": FORMAT,
        "times": times,
        "generations": lengthen(table.config, times).generations[0],
        "tasks": tasks,
    }
    folder.mkdir(parents=True, exist_ok=True)
    with write_atomically(folder / FILE) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def load_longer(folder: Path) -> dict[str, Any]:
    """Return what `save_longer` wrote: times, generations, and for each task a row for each body, the fittest first.

    Raises:
        RunError: the file is missing, damaged or of another format.
    """
    path = folder / FILE
    try:
        content: Any = read_json(path)
        if content["format"] != FORMAT:
            raise RunError(f"{path} has format {content['format']!r}, not {FORMAT!r}; make it again")
    except (OSError, JsonError, KeyError, TypeError) as error:
        raise RunError(f"{path} cannot be read ({error}); `{COMMAND}` makes it") from error
    return content


def describe_longer(found: Mapping[str, Sequence[Longer]], table: Landscape) -> dict[str, dict[str, Any]]:
    """Return, for each task, what changes with the time to learn.

    Returns:
        Number of bodies, the best body and its fitness on the scan and in the truth after the short and the long time,
        the place (1 is the first) of the short time's best after the long time and of the long time's best before,
        bodies that succeed in all trials before and after, the mean gain, and rank correlations of short and long
        ("rank") and of scan and truth ("truth_rank"), of these bodies alone.
    """
    rows = {}
    for name, each in found.items():
        task, places = table.find_task(name), [one.place for one in each]
        short = table.fitness[task, places]
        long = np.array([one.lesson.fitness for one in each])
        truth = np.array([one.truth.fitness for one in each])
        best = int(np.argmax(long))
        trials = table.config.exam_trials
        rows[name] = {
            "bodies": len(each),
            "best_before": table.bodies[places[0]].text,
            "best_fitness_before": float(short[0]),
            "best": table.bodies[places[best]].text,
            "best_fitness": float(long[best]),
            "best_truth": float(truth[best]),
            "first_is_now": int(1 + np.sum(long > long[0])),
            "best_was": 1 + best,
            "solved_before": int(np.sum(table.successes[task, places] == trials)),
            "solved": sum(one.lesson.successes == trials for one in each),
            "gain": float(np.mean(long - short)),
            "rank": correlate_ranks(short, long),
            "truth_rank": correlate_ranks(long, truth),
            "seconds": float(sum(one.lesson.seconds for one in each)),
        }
    return rows
