"""Folders in which only the files that a manifest names are replaced or removed: those of others stay."""

import io
import json
import os
import re
from collections.abc import Iterable, Set
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from reconstruction._src.base.atomic_write import find_leftovers, write_atomically
from reconstruction._src.base.typed_json import read_json
from symbrion_gym._src.errors import ArenaError


class FileOwner(NamedTuple):
    """What owns the files of a folder that its manifest lists under `files`."""

    what: str  # what it is, in messages
    manifest: str  # name of the manifest
    newest: int  # largest format that this version reads
    pattern: re.Pattern[str]  # names that its files may have: whatever a manifest says, no other is touched

    def read_manifest(self, folder: Path, ignored: str = "") -> dict[str, Any]:
        """Return the manifest; without a folder, or anything in it but the ignored name, an empty one."""
        if folder.exists() and not folder.is_dir():
            raise ArenaError(f"{folder} is a file; choose another folder")
        path = folder / self.manifest
        if not path.exists():
            entries = set(folder.iterdir()) if folder.exists() else set()
            if entries - find_leftovers(folder).keys() - {folder / ignored}:
                raise ArenaError(f"{folder} is not empty and holds no {self.what}; choose another folder")
            return {}
        try:
            about = read_json(path)
            if not isinstance(about["format"], int) or not isinstance(about["files"], list):
                raise ValueError(f"no manifest of an {self.what}")
        except (OSError, ValueError, TypeError, KeyError) as error:
            raise ArenaError(
                f"{path} is damaged or of another program, so that nobody knows which files beside it are an "
                f"{self.what}'s; choose another folder"
            ) from error
        if about["format"] > self.newest:
            raise ArenaError(f"{path}: written by a newer version; choose another folder")
        return about

    def list_files(self, about: dict[str, Any]) -> frozenset[str]:
        """Return the files that a manifest lists, and itself."""
        named = {name for name in about.get("files", ()) if isinstance(name, str)}
        own = {name for name in named if self.pattern.fullmatch(name)}
        return frozenset(own | {self.manifest}) if about else frozenset()

    def refuse_foreign(self, folder: Path, wanted: Iterable[str], own: Set[str]) -> None:
        """Refuse to write where something else lies: a file, a folder, a link."""
        for name in sorted(wanted):
            path = folder / name
            is_free = not os.path.lexists(path) and (path.parent.is_dir() or not os.path.lexists(path.parent))
            if not _is_inside(folder, name) or not (is_free or (name in own and path.is_file())):
                raise ArenaError(
                    f"{path} is in the way and no file of the {self.what} in {folder}; move it, or choose another "
                    "folder"
                )


def _is_inside(folder: Path, name: str) -> bool:
    """Return whether a name leads to that place in the folder, and by no link elsewhere."""
    return (folder / name).resolve() == folder.resolve() / name


def write_file(path: Path, content: bytes) -> None:
    """Write a file, and the folder that it lies in."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with write_atomically(path) as temporary:
        temporary.write_bytes(content)


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write a file of strict JSON."""
    write_file(path, format_json(content))


def format_json(content: dict[str, Any]) -> bytes:
    """Return strict JSON."""
    return (json.dumps(content, indent=2, allow_nan=False) + "\n").encode()


def format_arrays(arrays: dict[str, np.ndarray]) -> bytes:
    """Return arrays as the content of an `.npz`."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def remove_files(folder: Path, names: Set[str], places: Iterable[str], keep: Set[str]) -> None:
    """Remove own files but some, the temporary files of killed writers, and the places that are empty then."""
    for name in names - keep:
        if _is_inside(folder, name) and (folder / name).is_file():
            (folder / name).unlink()
    for place in (*places, ""):
        for path, name in find_leftovers(folder / place).items():
            if f"{place}{name}" in names and _is_inside(folder, f"{place}{path.name}"):
                path.unlink(missing_ok=True)
        is_emptied = any(name.startswith(place) for name in names) and (folder / place).is_dir()
        if (
            place
            and is_emptied
            and _is_inside(folder, place.rstrip("/"))
            and not any((folder / place).iterdir())
        ):
            (folder / place).rmdir()
