"""The run folder: its files, who may write it, and how it survives crashes.

    config.json     the configuration; versions and machine the run began with
    record.npz      every genotype tried and its outcome: the checkpoint
    history.csv     one row per generation
    champion.json   the best validated genotype
    bodies.csv      of a search for bodies: one row for each level that a body has learned

An empty `record.npz` is written before `config.json`, so a run without one has lost it. It is replaced
atomically after each generation; the files below are derived from it. Reading a folder runs no code from it.
"""

import csv
import io
import os
import platform
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import filelock

from evolution._src.errors import RunError
from evolution._src.search.bodies.algorithms import LevelResult
from evolution._src.search.bodies.config import BodyEvolutionConfig
from evolution._src.search.bodies.run import BodyRun
from evolution._src.search.cmaes import Run
from evolution._src.search.config import EvolutionConfig, RunConfig
from evolution._src.search.record import HISTORY, Record
from evolution._src.search.validation import Champion
from reconstruction._src.base.atomic_write import find_leftovers, write_atomically
from reconstruction._src.base.typed_json import JsonError, format_json, read_json

CONFIG, RECORD, HISTORY_FILE, CHAMPION, TABLE = FILES = (
    "config.json",
    "record.npz",
    "history.csv",
    "champion.json",
    "bodies.csv",
)
LOCK = ".lock"
_BODIES = "bodies"  # The kind of a search for bodies in `config.json`
_TABLE_COLUMNS = ("body", "plan", "modules", "level", "fitness", "successes", "trials", "effort", "seconds")
_IN_DISTRIBUTION = (
    "equal in distribution only: samples were tried on a GPU in single precision (backend 'warp')"
)
"""What `config.json` says of a run of which no other process repeats the same bits."""
_PACKAGES = ("symbrion-gym", "numpy", "cma", "mujoco", "gymnasium", "coacd")


@contextmanager
def lock_folder(folder: Path) -> Iterator[None]:
    """Lock a folder, made where there is none, against other writers; the lock ends with its process."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = filelock.FileLock(folder / LOCK)
        lock.acquire(timeout=0)
    except filelock.Timeout as error:
        raise RunError(
            f"{folder} is being written by another run; wait for it or name another folder"
        ) from error
    except OSError as error:
        raise RunError(f"{folder} cannot be written ({error}); name another folder") from error
    try:
        yield
    finally:
        lock.release()


class RunFolder:
    """Reader and writer of the folder of a run."""

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Lock the folder against other writers; the lock ends with its process."""
        with lock_folder(self.path):
            for name in FILES:  # a folder of unknown origin may contain links to anything
                if (self.path / name).is_symlink():
                    raise RunError(f"{self.path / name} is a link; put the file itself there")
            self._remove_leftovers()
            yield

    def has_run(self) -> bool:
        """Return whether a run has begun here."""
        return (self.path / CONFIG).exists() or (self.path / RECORD).exists()

    def has_bodies(self) -> bool:
        """Return whether the run that has begun here is a search for bodies."""
        try:
            return self._read_json(CONFIG).get("kind") == _BODIES
        except RunError:
            return False

    def begin(self, config: RunConfig) -> None:
        """Write an empty record, then `config.json`."""
        if (self.path / CONFIG).exists():
            differences = self.read_config().differences(config)
            what = f"another run ({'; '.join(differences)})" if differences else "this run already"
            remedy = f"`symbrion resume {self.path}` goes on with it; or name another folder"
            raise RunError(f"{self.path} contains {what}; {remedy}")
        taken = [name for name in FILES if os.path.lexists(self.path / name)]
        if taken == [RECORD]:  # of a run that was killed before it had a `config.json`?
            record, _ = Record.from_bytes((self.path / RECORD).read_bytes(), str(self.path / RECORD))
            taken = taken if record.num_generations else []
        if taken:
            raise RunError(
                f"{self.path} contains {', '.join(taken)} but no {CONFIG}; restore that from a copy, "
                "or name another folder"
            )
        self._replace(RECORD, Record().to_bytes(config.digest()))
        self.write_config(config)

    def write_config(self, config: RunConfig) -> None:
        """Write `config.json`; the versions are those that the run began with."""
        content = self._read_json(CONFIG) if (self.path / CONFIG).exists() else describe_origin()
        if isinstance(config, BodyEvolutionConfig):
            content["kind"] = _BODIES
        if config.backend == "warp":  # this stays when the run goes on elsewhere
            content["resumes"] = _IN_DISTRIBUTION
        self._replace(CONFIG, format_json(content | {"config": config.to_json()}))

    def read_config(self) -> EvolutionConfig | BodyEvolutionConfig:
        """Read `config.json`."""
        if not (self.path / CONFIG).exists():
            raise RunError(f"{self.path} contains no run: {CONFIG} is missing")
        content = self._read_json(CONFIG)
        kind = BodyEvolutionConfig if content.get("kind") == _BODIES else EvolutionConfig
        try:
            return kind.from_json(content.get("config"))
        except RunError as error:
            raise RunError(
                f"{self.path / CONFIG}: {error}; undo the change, or restore it from a copy"
            ) from error

    def write(self, run: Run | BodyRun) -> None:
        """Write the record, then the files derived from it."""
        self._replace(RECORD, run.record.to_bytes(run.config.digest()))
        rows = ([value.item() for value in row] for row in run.history)
        self._replace(HISTORY_FILE, format_table(HISTORY.names or (), rows))
        if run.champion is not None:
            self._replace(CHAMPION, format_json(run.champion.to_json()))
        if isinstance(run, BodyRun):
            self._replace(TABLE, format_table(_TABLE_COLUMNS, map(_describe, run.results)))

    def read_record(self, config: RunConfig) -> Record:
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

    def _remove_leftovers(self) -> None:
        for path, name in find_leftovers(self.path).items():
            if name in FILES:
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
        return Champion.from_json(read_json(path))
    except (JsonError, RunError) as error:
        raise RunError(f"{path}: {error}; a run writes it after each generation") from error


def format_table(names: Iterable[str], rows: Iterable[Iterable[Any]]) -> bytes:
    """Return a CSV file: numbers in their shortest exact form."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(rows)
    return buffer.getvalue().encode()


def _describe(result: LevelResult) -> list[Any]:
    """Return the columns of `_TABLE_COLUMNS`."""
    body = result.body
    measures = (getattr(result, name) for name in _TABLE_COLUMNS[3:])
    return [body.text, body.to_plan(), body.num_modules, *measures]


def describe_origin() -> dict[str, Any]:
    """Return versions and machine that a run begins with."""
    versions = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            continue
    return {"versions": versions, "machine": platform.platform()}
