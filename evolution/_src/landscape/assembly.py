"""From the runs of all tasks and their judgments to the table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from evolution._src.body_search.learning import Lesson
from evolution._src.body_search.run import BodyRun
from evolution._src.errors import RunError
from evolution._src.landscape.config import LandscapeConfig
from evolution._src.landscape.judging import Judgment, find_learned
from evolution._src.landscape.making import list_bodies
from evolution._src.landscape.table import Landscape

UNKNOWN = {"fitness": np.nan, "successes": -1}
"""Values of what was not judged at all."""


def assemble(
    config: LandscapeConfig,
    runs: Mapping[str, BodyRun],
    judged: Mapping[str, Mapping[str, Sequence[Judgment]]],
    provenance: Mapping[str, Any],
) -> Landscape:
    """Return the landscape.

    Args:
        config: of the landscape.
        runs: what bodies have learned, by task.
        judged: how that fared again and in the truth, by task and kind.
        provenance: versions and commands.

    Raises:
        RunError: some body has not learned, or has not been judged.
    """
    bodies = list_bodies(config.largest)
    tables = {name: _sort(bodies, run) for name, run in runs.items()}
    lessons = list(tables.values())
    width = max(len(lesson.genotype) for row in lessons for lesson in row)
    places = {
        name: {lesson.pupil.key: place for place, lesson in enumerate(find_learned(run))}
        for name, run in runs.items()
    }

    def judge(kind: str, quantity: str) -> np.ndarray:
        rows = []
        for name, row in tables.items():
            values = judged[name].get(kind)
            if values is None:
                rows.append([UNKNOWN[quantity]] * len(row))
                continue
            if len(values) < len(places[name]):
                raise RunError(
                    f"{len(values)} of {len(places[name])} bodies are judged in {name!r}; let it go on"
                )
            rows.append([getattr(values[places[name][each.pupil.key]], quantity) for each in row])
        return np.array(rows)

    def take(quantity: str) -> np.ndarray:
        return np.array([[getattr(lesson, quantity) for lesson in row] for row in lessons])

    genotypes = [
        [np.pad(each.genotype, (0, width - len(each.genotype)), constant_values=np.nan) for each in row]
        for row in lessons
    ]
    return Landscape(
        tasks=tuple(runs),
        bodies=tuple(bodies),
        gene_names=tuple(lesson.names for lesson in lessons[0]),
        fitness=take("fitness"),
        successes=take("successes"),
        seconds=take("seconds"),
        effort=take("effort"),
        curve=take("curve"),
        genotypes=np.array(genotypes),
        again_fitness=judge("again", "fitness"),
        again_successes=judge("again", "successes"),
        truth_fitness=judge("truth", "fitness"),
        truth_successes=judge("truth", "successes"),
        config=config,
        provenance=provenance,
    )


def _sort(bodies: Sequence[Any], run: BodyRun) -> list[Lesson]:
    """Return the lesson of each body.

    Raises:
        RunError: some body has not learned.
    """
    known = {lesson.pupil.key: lesson for lesson in find_learned(run)}
    missing = [body.text for body in bodies if body.canonical_text not in known]
    if missing:
        raise RunError(f"{len(missing)} of {len(bodies)} bodies have not learned; let the computation go on")
    return [known[body.canonical_text] for body in bodies]
