"""Submissions to the benchmark suite: one JSON file with what was learned, its scores and its provenance.

A file is filled entry by entry, so that a run that was stopped goes on; every score can be computed again.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from evolution._src.backends.cluster import Backend, make_backend
from evolution._src.backends.scoring import Scoring
from evolution._src.backends.settings import read_organism
from evolution._src.backends.trials import Job
from evolution._src.errors import RunError
from evolution._src.references import check_allowed
from evolution._src.suite.tasks import (
    BUDGET,
    EXAM_SEED,
    EXAM_TRIALS,
    LARGEST,
    VERSION,
    SuiteTask,
    find_suite_task,
)
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.base.typed_json import JsonError, as_type, read_json

FORMAT = "symbrion suite submission 1"
SCORING = Scoring(module=0.0)
"""The fitness of a score: progress [m], 1 for a success rate of 1, less the effort."""
TOLERANCE = 1e-6  # Difference of fitness that other processors and versions of libraries may make [m]


@dataclass(frozen=True)
class Score:
    """How a genotype fared in the trials of the suite."""

    fitness: float  # mean over trials, see `evolution._src.backends.scoring`
    successes: int  # successful trials of `EXAM_TRIALS`


@dataclass(frozen=True)
class Entry:
    """What a method has found for a task with a seed."""

    task: str  # name of the task
    seed: int  # seed of the method
    body: str  # body plan
    controller: str  # name of a law of ours, or "module:name"
    genotype: tuple[float, ...]  # genes of the controller
    seconds: float  # simulated time that was spent [s], at most the budget and one generation
    scan: Score  # score in the arena
    truth: Score  # score in the exact arena


@dataclass(frozen=True)
class Submission:
    """A submission.

    Raises:
        RunError: it is of another suite, or an entry cannot be one of its tasks.
    """

    name: str  # name of the method
    entries: tuple[Entry, ...]  # what it has found
    provenance: Mapping[str, Any] = field(default_factory=dict)  # versions, commit, command
    version: str = VERSION  # of the suite

    def __post_init__(self) -> None:
        if self.version != VERSION:
            raise RunError(
                f"the submission is of suite {self.version!r}, this is suite {VERSION!r}, whose tasks and budget are "
                "others; run the method again"
            )
        for entry in self.entries:
            _check_entry(entry)

    def save(self, path: Path) -> None:
        """Write the file."""
        content = {"format": FORMAT} | asdict(self)
        with write_atomically(path) as temporary:
            temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def load_submission(path: Path) -> Submission:
    """Read a submission; this runs nothing from it."""
    try:
        content: Any = read_json(path)
        if not isinstance(content, dict) or content.pop("format", None) != FORMAT:
            raise RunError(
                f"{path} is no submission of the format {FORMAT!r}; `symbrion bench-suite run` writes one"
            )
        entries = tuple(as_type(each, Entry, "entries") for each in content["entries"])
        return Submission(str(content["name"]), entries, dict(content["provenance"]), str(content["version"]))
    except (OSError, JsonError, KeyError, TypeError, ValueError) as error:
        if isinstance(error, RunError):
            raise
        raise RunError(f"{path} cannot be read as a submission: {error}") from error


def _check_entry(entry: Entry) -> None:
    """Refuse what cannot have been found under the rules of its task."""
    from symbrion_gym._src.robot.body_plans import organism_to_text

    task, organism = find_suite_task(entry.task), read_organism(entry.body)
    if task.body is not None and organism_to_text(read_organism(task.body)) != organism_to_text(organism):
        raise RunError(f"{entry.task}: the body is {entry.body!r}, and the task gives {task.body!r}")
    if task.body is None and organism.num_modules > LARGEST:
        raise RunError(
            f"{entry.task}: the body has {organism.num_modules} modules; at most {LARGEST} are allowed"
        )
    if not all(isfinite(value) for value in entry.genotype):
        raise RunError(f"{entry.task}: the genotype is not finite")
    if not 0.0 <= entry.seconds <= 2 * BUDGET:
        raise RunError(f"{entry.task}: {entry.seconds:.0f} s were spent, of a budget of {BUDGET:.0f} s")


def compute_score(
    task: SuiteTask, body: Any, controller: str, genotype: Any, in_truth: bool, backend: Backend | None = None
) -> Score:
    """Return the score of a genotype; equal genotypes have equal scores."""
    trials = task.make_trials(body, controller, EXAM_TRIALS, EXAM_SEED, in_truth)
    own = backend or make_backend("batch", 1)
    outcome = own.run([Job(np.asarray(genotype, dtype=float), trials)])[0]
    if outcome.error:
        raise RunError(f"{task.name}: the genotype cannot be tried: {outcome.error}")
    return Score(SCORING.score(outcome, 0), outcome.successes)


def fill_submission(
    name: str,
    find_entry: Callable[[SuiteTask, int], Entry],
    pairs: Sequence[tuple[SuiteTask, int]],
    provenance: Mapping[str, Any],
    out: Path | None = None,
    progress: Progress = silent,
) -> Submission:
    """Return a submission with an entry for each task and seed, as a function of both finds it; those that the file
    has are kept."""
    submission = Submission(name, (), provenance)
    if out is not None and out.exists():
        known = load_submission(out)
        keys = {**known.provenance, **provenance}
        differing = [key for key in keys if known.provenance.get(key) != provenance.get(key)]
        if known.name != name or differing:
            what = ", ".join(differing) or "name"
            raise RunError(f"{out} is a submission of another run (it differs in: {what}); name another file")
        submission = known
    for number, (task, seed) in enumerate(pairs):
        if any(entry.task == task.name and entry.seed == seed for entry in submission.entries):
            continue
        progress(f"{task.name}, seed {seed}", number / len(pairs))
        submission = Submission(name, (*submission.entries, find_entry(task, seed)), provenance)
        if out is not None:
            submission.save(out)
    return submission


class Check(NamedTuple):
    """An entry whose score was computed again."""

    entry: Entry  # as submitted
    scan: Score  # score in the arena, computed again
    truth: Score  # score in the exact arena, computed again

    @property
    def holds(self) -> bool:
        """Whether both scores are those of the submission."""
        pairs = (self.entry.scan, self.scan), (self.entry.truth, self.truth)
        return all(
            told.successes == found.successes and abs(told.fitness - found.fitness) <= TOLERANCE
            for told, found in pairs
        )


def verify(
    submission: Submission,
    progress: Progress = silent,
    tasks: Sequence[str] = (),
    allow: Collection[str] = (),
) -> list[Check]:
    """Run every genotype of a submission again, on the scan and in the truth."""
    names = {find_suite_task(name).name for name in tasks}
    entries = [entry for entry in submission.entries if not names or entry.task in names]
    for entry in entries:
        if ":" in entry.controller:
            check_allowed(entry.controller, "controller", allow)
    checks = []
    for number, entry in enumerate(entries):
        progress(entry.task, number / len(entries))
        task = find_suite_task(entry.task)
        scan, truth = (
            compute_score(task, entry.body, entry.controller, entry.genotype, in_truth)
            for in_truth in (False, True)
        )
        checks.append(Check(entry, scan, truth))
    return checks
