"""The folder of the experiments: the result of each is kept as soon as it is there.

config.json           what is measured; another configuration is refused
experiments/NAME.json figures, seconds, date, machine and versions of one experiment
...                   what the experiments make: scan log, cloud, surfaces, arenas, runs, films
"""

import datetime
import json
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import filelock

from evolution.errors import RunError
from evolution.experiments.output_folder import refuse_foreign
from evolution.experiments.paper.config import PaperConfig
from evolution.report.provenance import describe_machine
from reconstruction.files.atomic_write import write_atomically
from reconstruction.files.printable import make_printable
from reconstruction.files.typed_json import JsonError, as_type, read_json

CONFIG = "config.json"
MADE = (
    "experiments", "survey.npz", "cloud.ply", "narrow_survey.npz", "narrow_cloud.ply", "surfaces", "arenas", "run",
    "runs", "films", "figures", "results.json", "report.html",
)  # fmt: skip
"""What the experiments and their page make in the folder."""
Figures = dict[str, Any]
"""What an experiment returns: plain JSON content."""


@dataclass(frozen=True)
class ExperimentRecord:
    """What is kept of an experiment.

    Attributes:
        figures: what the experiment returned.
        seconds: it took.
        date: when it was finished, ISO 8601.
        machine: where, and with which versions.
        cpu_seconds: of all threads and processes; not kept at first.
    """

    figures: dict[str, Any]
    seconds: float
    date: str
    machine: str
    cpu_seconds: float | None = None


class PaperFolder:
    """Keeps and finds the results of experiments.

    Args:
        path: the folder; made if need be.
        config: what is measured.

    Raises:
        RunError: it holds the experiments of another configuration, something damaged, or something else.
    """

    def __init__(self, path: Path, config: PaperConfig) -> None:
        self.path, self.config = path, config
        self._check_config()
        (path / "experiments").mkdir(exist_ok=True)

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Keep others from writing to the folder.

        Raises:
            RunError: someone else is writing to it.
        """
        lock = filelock.FileLock(self.path / ".lock")
        try:
            lock.acquire(timeout=0)
        except filelock.Timeout:
            raise RunError(
                f"{self.path} is being written by another run; wait, or name another folder"
            ) from None
        try:
            yield
        finally:
            lock.release()

    def find(self, name: str) -> Figures | None:
        """Return the record of an experiment, or None where it has not been finished.

        A record holds `figures` (what the experiment returned), `seconds`, `cpu_seconds` of all threads and
        processes, `date` and `machine`.
        """
        path = self._record(name)
        if not path.is_file():
            return None
        try:
            content = read_json(path)
            as_type(content, ExperimentRecord)
        except JsonError as error:
            raise RunError(f"{path} is damaged ({error}); remove it, and it is made anew") from error
        return content

    def keep(self, name: str, experiment: Callable[[], Figures]) -> Figures:
        """Return the record of an experiment; do it only where it is not there yet."""
        record = self.find(name)
        if record is not None:
            return record
        began, cpu_began = time.perf_counter(), _find_cpu_seconds()
        figures = experiment()
        record = {
            "figures": figures,
            "seconds": round(time.perf_counter() - began, 1),
            "cpu_seconds": round(_find_cpu_seconds() - cpu_began, 1),
            "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
            "machine": describe_machine(),
        }
        write_json(self._record(name), record)
        return json.loads(json.dumps(record))

    def _record(self, name: str) -> Path:
        return self.path / "experiments" / f"{name}.json"

    def _check_config(self) -> None:
        path, mine = self.path / CONFIG, self.config.to_json()
        if not path.is_file():
            refuse_foreign(self.path, CONFIG, MADE)
            self.path.mkdir(parents=True, exist_ok=True)
            write_json(path, mine)
            return
        try:
            theirs = PaperConfig.from_json(read_json(path)).to_json()
        except (JsonError, RunError) as error:
            raise RunError(f"{path}: {error}; name another folder, or remove this one") from error
        names = [name for name in mine if mine[name] != theirs[name]]
        if names:
            differences = "; ".join(f"{name} {theirs[name]}, not {mine[name]}" for name in names)
            raise RunError(
                f"{path} tells of another configuration ({make_printable(differences, 400)}); "
                "name another folder, or remove this one"
            )


def write_json(path: Path, content: Any) -> None:
    """Write JSON; the file appears whole or not at all."""
    with write_atomically(path) as beside:
        beside.write_text(json.dumps(content, indent=2) + "\n")


def _find_cpu_seconds() -> float:
    """Return the processor time of this process and of its children that have ended [s]."""
    return sum(os.times()[:4])
