"""The folder of a search for bodies: its files, and how it survives crashes.

    config.json     the configuration; versions, commit and machine the run began with
    record.json     what every body has learned: the checkpoint
    bodies.csv      one row per result
    confirmation.json   the fresh trials of the champion, once it has been confirmed
    champion.json   the confirmed body and its controller; before, the fittest one

Reading a folder runs no code from it.
"""

from __future__ import annotations

import csv
import io
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from evolution._src.backends.settings import EpisodeConfig, take_fields
from evolution._src.errors import RunError
from evolution._src.search.bodies.config import BodyEvolutionConfig
from evolution._src.search.bodies.learning import LevelResult
from evolution._src.search.bodies.record import BodyRecord
from evolution._src.search.run import BODIES, describe_origin
from evolution._src.search.validation import Champion
from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.typed_json import JsonError, read_json

CONFIG, RECORD, TABLE, CHAMPION = "config.json", "record.json", "bodies.csv", "champion.json"
CONFIRMED = "confirmation.json"
KIND = BODIES  # What `config.json` says the folder is a run of
COLUMNS = ("body", "plan", "modules", "level", "fitness", "successes", "trials", "effort", "seconds")


class Confirmation(NamedTuple):
    """A champion that has been tried again."""

    champion: Champion  # the body and its controller, with the successes of these trials
    result: LevelResult  # what it had learned
    seconds: float  # simulated for all candidates [s]


@dataclass(frozen=True)
class BodyRun:
    """The state of a search for bodies."""

    config: BodyEvolutionConfig  # configuration of the run
    record: BodyRecord  # what every body has learned
    # after each iteration, the simulated time of the run so far [s] and the best fitness of a body that has
    # learned to the last level; -inf before there is one
    history: tuple[tuple[float, float], ...]
    folder: Path | None = None  # folder of the run; None if it is in memory only
    # the champion by fresh trials; None where the fittest bodies have not been tried again (`ev.confirm`)
    confirmation: Confirmation | None = None

    @property
    def best(self) -> LevelResult | None:
        """The result of the fittest body among those that have learned most; None before the first."""
        results = self.record.results
        return max(results, key=lambda each: (each.level, each.fitness), default=None)

    @property
    def champion(self) -> Champion | None:
        """The body and controller that `judge`, `play` and `symbrion replay` take.

        The confirmed one, with the successes of its fresh trials; before a confirmation the fittest, with those of its
        exam.
        """
        if self.confirmation is not None:
            return self.confirmation.champion
        best = self.best
        return None if best is None else self.make_champion(best)

    def make_champion(self, result: LevelResult) -> Champion:
        """Return what a body has learned, as `judge` and `play` take it."""
        return Champion(
            genotype=result.genotype,
            names=result.names,
            fitness=result.fitness,
            successes=result.successes,
            trials=result.trials,
            organism=self.config.make_organism(result.body),
            **take_fields(self.config, EpisodeConfig),
        )

    def list_fittest(self) -> list[LevelResult]:
        """Return the results of the bodies that have learned most, the fittest first, each body once."""
        most = max((result.level for result in self.record.results), default=0)
        last = sorted(
            (result for result in self.record.results if result.level == most), key=lambda each: -each.fitness
        )
        fittest: dict[str, LevelResult] = {}
        for result in last:
            fittest.setdefault(result.body.canonical_text, result)
        return list(fittest.values())

    @property
    def has_all_iterations(self) -> bool:
        """Whether all iterations that the run may take are done: resumed, it tries nothing more."""
        return len(self.history) >= self.config.iterations


def has_bodies(folder: str | Path) -> bool:
    """Return whether a folder contains a search for bodies."""
    path = Path(folder) / CONFIG
    try:
        content = read_json(path)
    except (JsonError, OSError):
        return False
    return isinstance(content, dict) and content.get("kind") == KIND


def begin_folder(folder: Path, config: BodyEvolutionConfig) -> None:
    """Write the configuration and an empty record into a folder without a run. Call it only with the lock."""
    taken = [name for name in (CONFIG, RECORD, TABLE, CHAMPION, CONFIRMED) if (folder / name).exists()]
    if taken:
        raise RunError(f"{folder} contains {', '.join(taken)}; resume the run there, or name another folder")
    _replace(folder / RECORD, BodyRecord().to_bytes(config.digest()))
    _write_config(folder, describe_origin(), config)


def change_folder(folder: Path, config: BodyEvolutionConfig) -> None:
    """Write the configuration of a run that is resumed with changes. Call it only with the lock."""
    _write_config(folder, read_json(folder / CONFIG), config)


def read_folder(folder: Path) -> tuple[BodyEvolutionConfig, BodyRecord]:
    """Read configuration and record."""
    if not (folder / CONFIG).exists():
        raise RunError(f"{folder} contains no run: {CONFIG} is missing")
    if not has_bodies(folder):
        raise RunError(f"{folder} contains no search for bodies; `resume` continues other runs")
    config = BodyEvolutionConfig.from_json(read_json(folder / CONFIG).get("config"))
    try:
        content = (folder / RECORD).read_bytes()
    except OSError as error:
        raise RunError(f"{folder / RECORD} cannot be read ({error}); restore it from a copy") from error
    source = str(folder / RECORD)
    return config, BodyRecord.from_bytes(content, config.digest(), source)


def write_run(folder: Path, run: BodyRun) -> None:
    """Write the record, then the files derived from it."""
    _replace(folder / RECORD, run.record.to_bytes(run.config.digest()))
    _replace(folder / TABLE, format_table(run.record).encode())
    write_champion(run)


def write_champion(run: BodyRun) -> None:
    """Write the champion, then how it was confirmed, into the folder of a run, if it has a folder and a champion."""
    if run.folder is None or run.champion is None:
        return
    _replace(run.folder / CHAMPION, (json.dumps(run.champion.as_dict(), indent=2) + "\n").encode())
    if run.confirmation is not None:
        champion, result, seconds = run.confirmation
        content = {
            "digest": run.config.digest(),
            "num_results": run.record.num_results,
            "result": run.record.results.index(result),
            "successes": champion.successes,
            "trials": champion.trials,
            "seconds": seconds,
        }
        _replace(run.folder / CONFIRMED, (json.dumps(content, indent=2) + "\n").encode())


def read_confirmation(run: BodyRun) -> Confirmation | None:
    """Return the confirmation in the folder of a run; None where there is none, or the run has gone on since."""
    if run.folder is None or not (run.folder / CONFIRMED).exists():
        return None
    path = run.folder / CONFIRMED
    try:
        content = read_json(path)
        if (content["digest"], content["num_results"]) != (run.config.digest(), run.record.num_results):
            return None
        result = run.record.results[int(content["result"])]
        champion = replace(
            run.make_champion(result), successes=int(content["successes"]), trials=int(content["trials"])
        )
        return Confirmation(champion, result, float(content["seconds"]))
    except Exception as error:  # a damaged or foreign file can be wrong in any way
        raise RunError(f"{path} is damaged ({error}); remove it, and resume the run") from error


def format_table(record: BodyRecord) -> str:
    """Return `bodies.csv`."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(COLUMNS)
    for result in record.results:
        body = result.body
        row: list[Any] = [body.text, body.to_plan(), body.num_modules]
        row += [getattr(result, name) for name in COLUMNS[3:]]
        writer.writerow(row)
    return buffer.getvalue()


def _write_config(folder: Path, origin: dict[str, Any], config: BodyEvolutionConfig) -> None:
    content = origin | {"kind": KIND, "config": config.to_json()}
    _replace(folder / CONFIG, (json.dumps(content, indent=2) + "\n").encode())


def _replace(path: Path, content: bytes) -> None:
    try:
        with write_atomically(path) as temporary:
            temporary.write_bytes(content)
    except OSError as error:
        raise RunError(
            f"{path} cannot be written ({error}); the last checkpoint is kept, free some space and resume"
        ) from error
