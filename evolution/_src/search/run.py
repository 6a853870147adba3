"""The run folder: its files, who may write it, and how it survives crashes.

    config.json     the configuration; versions, commit and machine the run began with
    record.npz      every genotype tried and its outcome: the checkpoint
    history.csv     one row per generation
    champion.json   the best validated genotype

An empty `record.npz` is written before `config.json`, so a run without one has lost it. It is replaced
atomically after each generation; the two other files are derived from it. Reading a folder runs no code from it.
"""

import csv
import io
import json
import os
import platform
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import filelock
import numpy as np
from jaxtyping import Shaped

from evolution._src.backends.settings import BodyConfig, EpisodeConfig, take_fields
from evolution._src.errors import RunError
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.record import HISTORY, VALIDATION, Record
from evolution._src.search.validation import Champion, select_champion
from reconstruction._src.base.atomic_write import find_leftovers, write_atomically
from reconstruction._src.base.typed_json import JsonError, read_json


def find_champion(config: EvolutionConfig, record: Record, names: Sequence[str]) -> Champion | None:
    """Return the champion; None before the first generation."""
    entry = select_champion(record)
    if entry is None:
        return None
    is_validated = entry.kind == VALIDATION
    return Champion(
        genotype=tuple(entry.genotype.tolist()),
        names=tuple(names),
        **take_fields(config, EpisodeConfig),
        **take_fields(config, BodyConfig),
        generation=entry.generation,
        fitness=entry.fitness,
        successes=entry.outcome.successes if is_validated else 0,
        trials=entry.outcome.trials if is_validated else 0,
    )


def is_solved(config: EvolutionConfig, champion: Champion | None) -> bool:
    """Return whether a champion solves a run."""
    return champion is not None and config.validation.is_solved(champion.successes, champion.trials)


CONFIG, RECORD, HISTORY_FILE, CHAMPION = "config.json", "record.npz", "history.csv", "champion.json"
LOCK = ".lock"
BODIES = "bodies"
"""The kind of a folder of a search for bodies, which `evolution._src.search.bodies.run` reads."""
IN_DISTRIBUTION = (
    "equal in distribution only: samples were tried on a GPU in single precision (backend 'warp')"
)
"""What `config.json` says of a run of which no other process repeats the same bits."""
PACKAGES = ("symbrion-gym", "numpy", "cma", "mujoco", "gymnasium", "coacd")


@dataclass(frozen=True)
class Run:
    """The state of a run.

    Attributes:
        config: configuration of the run.
        record: every genotype and its outcome.
        champion: its best validated genotype; None before the first generation.
        is_solved: whether a champion was confirmed.
        folder: folder of the run; None if it is in memory only.
    """

    config: EvolutionConfig
    record: Record
    champion: Champion | None
    is_solved: bool
    folder: Path | None = None

    @property
    def history(self) -> Shaped[np.ndarray, " generations"]:
        """Structured array, one row per generation; `history["best"]` and so on, see `record.HISTORY`."""
        return self.record.history


class RunFolder:
    """Reader and writer of the folder of a run.

    Args:
        path: path of the folder.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Lock the folder against other writers; the lock ends with its process."""
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            lock = filelock.FileLock(self.path / LOCK)
            lock.acquire(timeout=0)
        except filelock.Timeout as error:
            raise RunError(
                f"{self.path} is being written by another run; wait for it or name another folder"
            ) from error
        except OSError as error:
            raise RunError(f"{self.path} cannot be written ({error}); name another folder") from error
        try:
            self._refuse_links()
            self._remove_leftovers()
            yield
        finally:
            lock.release()

    def has_run(self) -> bool:
        """Return whether a run has begun here."""
        return (self.path / CONFIG).exists() or (self.path / RECORD).exists()

    def begin(self, config: EvolutionConfig) -> None:
        """Write an empty record, then `config.json`."""
        if (self.path / CONFIG).exists():
            differences = self.read_config().differences(config)
            what = f"another run ({'; '.join(differences)})" if differences else "this run already"
            raise RunError(f"{self.path} contains {what}; resume it, or name another folder")
        taken = [name for name in (RECORD, HISTORY_FILE, CHAMPION) if os.path.lexists(self.path / name)]
        if taken and not (taken == [RECORD] and self._is_empty_record()):
            raise RunError(
                f"{self.path} contains {', '.join(taken)} but no {CONFIG}; restore that from a copy, "
                "or name another folder"
            )
        self._replace(RECORD, Record().to_bytes(config.digest()))
        self.write_config(config)

    def write_config(self, config: EvolutionConfig) -> None:
        """Write `config.json`; the versions are those that the run began with."""
        began = self._read_json(CONFIG) if (self.path / CONFIG).exists() else describe_origin()
        # what is said of backend "warp" stays when the run goes on elsewhere
        more = {"resumes": IN_DISTRIBUTION} if config.backend == "warp" else {}
        self._replace(CONFIG, _to_json(began | more | {"config": config.to_json()}))

    def remove(self) -> None:
        """Remove the files of a run, and nothing else. Call it only with the lock."""
        for name in (CHAMPION, HISTORY_FILE, RECORD, CONFIG):
            (self.path / name).unlink(missing_ok=True)
        self._remove_leftovers()

    def read_config(self) -> EvolutionConfig:
        """Read `config.json`."""
        if not (self.path / CONFIG).exists():
            raise RunError(f"{self.path} contains no run: {CONFIG} is missing")
        content = self._read_json(CONFIG)
        if content.get("kind") == BODIES:
            raise RunError(
                f"{self.path} contains a search for bodies; read it by ev.load_bodies, continue it by ev.resume_bodies"
            )
        try:
            return EvolutionConfig.from_json(content.get("config"))
        except RunError as error:
            raise RunError(
                f"{self.path / CONFIG}: {error}; undo the change, or restore it from a copy"
            ) from error

    def write(self, run: Run) -> None:
        """Write the record, then the files derived from it."""
        self._replace(RECORD, run.record.to_bytes(run.config.digest()))
        self._replace(HISTORY_FILE, format_history(run.history).encode())
        if run.champion is not None:
            self._replace(CHAMPION, _to_json(run.champion.as_dict()))

    def read_record(self, config: EvolutionConfig) -> Record:
        """Read `record.npz`."""
        path = self.path / RECORD
        if path.exists() and not path.is_file():
            raise RunError(f"{path} is no regular file; restore it from a copy")
        try:
            content = path.read_bytes()
        except FileNotFoundError:
            raise RunError(
                f"{path} is missing, though the run has begun; restore it from a copy, or start again in another folder"
            ) from None
        except OSError as error:
            raise RunError(f"{path} cannot be read ({error})") from error
        record, digest = Record.from_bytes(content, str(path))
        if digest != config.digest():
            raise RunError(
                f"{path} belongs to another configuration than {CONFIG} in the same folder; "
                "undo the change, or start again in another folder"
            )
        return record

    def read_run(self, config: EvolutionConfig) -> Run:
        """Return the run as its record says, without replaying it: no controller is needed, nor imported."""
        record = self.read_record(config)
        names = load_champion(self.path).names if record.num_generations else ()
        champion = find_champion(config, record, names)
        return Run(config, record, champion, is_solved(config, champion), self.path)

    def _refuse_links(self) -> None:
        """Refuse to write through links: a folder of unknown origin may contain links to anything."""
        for name in (CONFIG, RECORD, HISTORY_FILE, CHAMPION):
            if (self.path / name).is_symlink():
                raise RunError(f"{self.path / name} is a link; put the file itself there")

    def _is_empty_record(self) -> bool:
        """Return whether the record is that of a run which was killed before it had a `config.json`."""
        record, _ = Record.from_bytes((self.path / RECORD).read_bytes(), str(self.path / RECORD))
        return record.num_generations == 0

    def _remove_leftovers(self) -> None:
        for path, name in find_leftovers(self.path).items():
            if name in (CONFIG, RECORD, HISTORY_FILE, CHAMPION):
                path.unlink(missing_ok=True)

    def _read_json(self, name: str) -> dict[str, Any]:
        try:
            content = read_json(self.path / name)
        except JsonError as error:
            raise RunError(f"{self.path / name}: {error}; restore it from a copy") from error
        if not isinstance(content, dict):
            raise RunError(f"{self.path / name} is no description of a run")
        return content

    def _replace(self, name: str, content: bytes) -> None:
        try:
            with write_atomically(self.path / name) as temporary:
                temporary.write_bytes(content)
        except OSError as error:
            raise RunError(
                f"{self.path / name} cannot be written ({error}); the last checkpoint is kept, "
                "free some space and resume"
            ) from error


def load_champion(path: str | Path) -> Champion:
    """Read a champion from `champion.json` or from the folder of a run.

    Raises:
        RunError: missing or damaged.
    """
    path = Path(path)
    path = path / CHAMPION if path.is_dir() else path
    try:
        return Champion.from_dict(read_json(path))
    except (JsonError, RunError) as error:
        raise RunError(f"{path}: {error}; a run writes it after each generation") from error


def format_history(history: Shaped[np.ndarray, " generations"]) -> str:
    """Return `history.csv`: numbers in their shortest exact form."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(HISTORY.names or ())
    writer.writerows([value.item() for value in row] for row in history)
    return buffer.getvalue()


def _to_json(content: dict[str, Any]) -> bytes:
    return (json.dumps(content, indent=2) + "\n").encode()


def describe_origin() -> dict[str, Any]:
    """Return versions and machine that a run begins with."""
    versions = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            continue
    return {
        "versions": versions,
        "machine": platform.platform(),
    }
