"""Commands that make many files: their steps, who may write in their folders, what shows that the files are theirs."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from evolution._src.errors import RunError
from evolution._src.search.cmaes import Run
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve, resume
from evolution._src.search.run import RunFolder
from reconstruction._src.base.progress import Progress
from reconstruction._src.base.typed_json import JsonError, read_json, write_json

Track = Callable[[str], AbstractContextManager[Any]]  # Starts a step with a title, which has a `progress`


def claim_folder(folder: Path, marker: str, options: dict[str, Any], outputs: Iterable[str]) -> None:
    """Write the options into a new folder, or refuse one with others, or with files of somebody else."""
    path, options = folder / marker, json.loads(json.dumps(options))
    refuse_foreign_files(folder, marker, outputs)
    if not path.is_file():
        write_json(path, options)
    try:
        found = read_json(path)
    except JsonError as error:
        raise RunError(f"{path}: {error}; name another folder, or remove this one") from error
    if found != options:
        names = [name for name in options if not isinstance(found, dict) or found.get(name) != options[name]]
        raise RunError(
            f"{path} describes other options ({', '.join(names)}); name another folder, or remove this one"
        )


def refuse_foreign_files(folder: Path, marker: str, names: Iterable[str]) -> None:
    """Refuse a folder in which a command would overwrite files that it did not write."""
    links = [name for name in (marker, *names) if (folder / name).is_symlink()]
    if links:
        raise RunError(f"{folder / links[0]} is a link to elsewhere; name another folder, or move the link")
    if (folder / marker).is_file():
        return
    existing = [name for name in (marker, *names) if os.path.lexists(folder / name)]
    if existing:
        raise RunError(
            f"{folder} contains {', '.join(existing)}, which would be overwritten, but no {marker} to show that this "
            "command wrote them; name another folder, or move them"
        )


def evolve_or_resume(config: EvolutionConfig, progress: Progress) -> Run:
    """Evolve, or go on where an evolution was interrupted."""
    folder = RunFolder(Path(config.folder or ""))
    if not folder.has_run():
        return evolve(config, progress=progress)
    differences = folder.read_config().differences(config)
    if differences:
        raise RunError(f"{folder.path} is another run ({'; '.join(differences)}); name another folder")
    return resume(folder.path, workers=config.workers, progress=progress)
