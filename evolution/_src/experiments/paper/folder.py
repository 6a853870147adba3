"""The folder of the experiments: the result of each is saved as soon as it is finished.

config.json           the configuration; a folder with another one is refused
experiments/NAME.json figures, seconds, date, machine and versions of one experiment
...                   what the experiments make: scan log, points, surfaces, arenas, runs, videos
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

from evolution._src.errors import RunError
from evolution._src.experiments.output_folder import refuse_foreign_files
from evolution._src.experiments.paper.config import PaperConfig
from evolution._src.report.provenance import describe_machine
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.printable import make_printable
from reconstruction._src.base.typed_json import JsonError, as_type, read_json

CONFIG = "config.json"
OUTPUTS = (
    "experiments", "survey.npz", "cloud.ply", "narrow_survey.npz", "narrow_cloud.ply", "surfaces", "arenas", "run",
    "runs", "films", "figures", "results.json", "report.html",
)  # fmt: skip
"""Files and folders that the experiments and their page make."""
Figures = dict[str, Any] | list[dict[str, Any]]
"""What an experiment returns: plain JSON content."""
Record = dict[str, Any]
"""An `ExperimentRecord` as plain JSON content."""


@dataclass(frozen=True)
class ExperimentRecord:
    """The saved result of an experiment.

    Attributes:
        figures: the figures that the experiment returned.
        seconds: wall time of the experiment [s].
        date: day on which it was finished, ISO 8601.
        machine: processor and versions.
        cpu_seconds: processor time of all threads and processes [s]; absent in records of early versions.
    """

    figures: Any
    seconds: float
    date: str
    machine: str
    cpu_seconds: float | None = None


class PaperFolder:
    """Saves and reads the results of experiments.

    Args:
        path: the folder; it is created if it does not exist.
        config: configuration of the experiments.

    Raises:
        RunError: the folder belongs to another configuration, its `config.json` is damaged, or it contains files that
            the experiments would overwrite and did not write.
    """

    def __init__(self, path: Path, config: PaperConfig) -> None:
        self.path, self.config = path, config
        self._check_config()
        (path / "experiments").mkdir(exist_ok=True)

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Lock the folder against other writers.

        Raises:
            RunError: another process is writing to it.
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

    def find(self, name: str) -> Record | None:
        """Return the record of an experiment, or None where it has not been finished.

        Returns:
            The fields of `ExperimentRecord`.

        Raises:
            RunError: the record is damaged.
        """
        path = self._record(name)
        if not path.is_file():
            return None
        try:
            content = read_json(path)
            as_type(content, ExperimentRecord)
        except JsonError as error:
            raise RunError(
                f"{path} is damaged ({error}); remove it, and the experiment is repeated"
            ) from error
        return content

    def keep(self, name: str, experiment: Callable[[], Figures]) -> Record:
        """Return the record of an experiment, which is run and saved where there is none yet.

        Raises:
            RunError: the record is damaged.
        """
        record = self.find(name)
        if record is not None:
            return record
        start, cpu_start = time.perf_counter(), _read_cpu_seconds()
        figures = experiment()
        record = {
            "figures": figures,
            "seconds": round(time.perf_counter() - start, 1),
            "cpu_seconds": round(_read_cpu_seconds() - cpu_start, 1),
            "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
            "machine": describe_machine(),
        }
        write_json(self._record(name), record)
        return json.loads(json.dumps(record))

    def _record(self, name: str) -> Path:
        return self.path / "experiments" / f"{name}.json"

    def _check_config(self) -> None:
        path, wanted = self.path / CONFIG, self.config.to_json()
        if not path.is_file():
            refuse_foreign_files(self.path, CONFIG, OUTPUTS)
            self.path.mkdir(parents=True, exist_ok=True)
            write_json(path, wanted)
            return
        try:
            found = PaperConfig.from_json(read_json(path)).to_json()
        except (JsonError, RunError) as error:
            raise RunError(f"{path}: {error}; name another folder, or remove this one") from error
        names = [name for name in wanted if wanted[name] != found[name]]
        if names:
            differences = "; ".join(f"{name} {found[name]}, not {wanted[name]}" for name in names)
            raise RunError(
                f"{path} describes another configuration ({make_printable(differences, 400)}); "
                "name another folder, or remove this one"
            )


def write_json(path: Path, content: Any) -> None:
    """Write content as a JSON file, atomically."""
    with write_atomically(path) as beside:
        beside.write_text(json.dumps(content, indent=2) + "\n")


def _read_cpu_seconds() -> float:
    """Return the processor time of this process and of its ended child processes [s]; on Windows without these."""
    return sum(os.times()[:4])
