"""Submissions to the benchmark suite: one JSON file with what was learned and its provenance, and no score.

A file is filled entry by entry, so that a run that was stopped goes on. What it is worth the exam finds out.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from math import isfinite
from pathlib import Path
from typing import Any

from evolution._src.backends.settings import read_organism
from evolution._src.controllers.finding import check_genotype, find_controller
from evolution._src.errors import RunError
from evolution._src.suite.tasks import BUDGET, SEEDS, VERSION, SuiteTask, find_suite_task
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.base.typed_json import JsonError, as_type, read_json, write_json
from symbrion_gym._src.environment.config import count_tracks
from symbrion_gym._src.robot.body_plans import organism_to_text

FORMAT = "symbrion suite submission 2"
_NAME = re.compile(r"(?!.*  )[A-Za-z0-9](?:[A-Za-z0-9 ._,+-]{0,60}[A-Za-z0-9+])?")
_TOLERANCE = 1.1  # Time that may be spent over the budget, as a generation that has begun is finished


@dataclass(frozen=True)
class Entry:
    """What a method has found for a task with a seed."""

    task: str  # name of the task
    seed: int  # seed of the method
    body: str  # body plan
    controller: str  # name of a law of ours, or "module:name"
    genotype: tuple[float, ...]  # genes of the controller
    seconds: float  # simulated time that was spent [s], at most the budget and one generation


@dataclass(frozen=True)
class Submission:
    """A submission.

    Raises:
        RunError: it is of another suite, an entry cannot be one of its tasks, or a task and seed has two.
    """

    name: str  # name of the method
    entries: tuple[Entry, ...]  # what it has found
    provenance: Mapping[str, Any] = field(default_factory=dict)  # versions, machine, method, budget
    version: str = VERSION  # of the suite

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name):
            raise RunError(
                f"a name has 1 to 62 letters, digits, single spaces or ._,+-, got {self.name[:100]!r}"
            )
        if self.version != VERSION:
            raise RunError(
                f"the submission is of suite {self.version!r}, this is suite {VERSION!r}, whose tasks and budget are "
                "others; run the method again"
            )
        for entry in self.entries:
            _check_entry(entry)
        pairs = [(entry.task, entry.seed) for entry in self.entries]
        if len(set(pairs)) < len(pairs):
            twice = max(pairs, key=pairs.count)
            raise RunError(
                f"{twice[0]}, seed {twice[1]}, has more than one entry; leave one for each task and seed"
            )

    def save(self, path: Path) -> None:
        """Write the file."""
        write_json(path, {"format": FORMAT} | asdict(self))


def load_submission(path: Path) -> Submission:
    """Read a submission; this runs nothing from it."""
    try:
        content: Any = read_json(path)
        if not isinstance(content, dict) or content.pop("format", None) != FORMAT:
            raise RunError(
                f"{path} is no submission of the format {FORMAT!r}; `symbrion bench-suite run` writes one"
            )
        return as_type(content, Submission, str(path))
    except (OSError, JsonError, KeyError, TypeError, ValueError) as error:
        if isinstance(error, RunError):
            raise
        raise RunError(f"{path} cannot be read as a submission: {error}") from error


def _check_entry(entry: Entry) -> None:
    """Refuse what cannot have been found under the rules of its task."""

    task = find_suite_task(entry.task)
    organism = read_organism(task.body)
    plan = organism_to_text(organism)
    if entry.body != plan:  # a body is a plan, never a file to be read
        raise RunError(f"{entry.task}: the body is {entry.body!r}, and the task gives {plan!r}")
    if ":" not in entry.controller:
        tracks = count_tracks(task.make_options()["track_control"], organism.num_modules)
        check_genotype(entry.task, entry.genotype, find_controller(entry.controller, organism, tracks))
    if not all(isfinite(value) for value in entry.genotype):
        raise RunError(f"{entry.task}: the genotype is not finite")
    _check_seed(entry.seed)
    if not 0.0 <= entry.seconds <= _TOLERANCE * BUDGET:
        raise RunError(f"{entry.task}: {entry.seconds:.0f} s were spent, of a budget of {BUDGET:.0f} s")


def _check_seed(seed: int) -> None:
    if seed not in SEEDS:
        raise RunError(f"the seed is {seed}; those of the tasks are {', '.join(map(str, SEEDS))}")


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
    for _, seed in pairs:
        _check_seed(seed)
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
