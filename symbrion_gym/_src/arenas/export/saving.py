"""The folder of an export: of what is there, only the files of a former export are replaced.

`export.json` lists the export's own files. It is written twice: before all others, with the old names and the new ones,
and after them. So after a kill at any moment the next export still knows which files are its own.
"""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any

from reconstruction._src.base.atomic_write import find_leftovers, write_atomically
from reconstruction._src.base.typed_json import read_json
from symbrion_gym._src.errors import ArenaError

MANIFEST = "export.json"
FORMAT = 1
_OWN = re.compile(
    r"arena\.(?:xml|urdf|usda)|contact\.(?:xml|obj)|objects\.json|surface\.(?:obj|mtl|png)|pieces/\d{3,}\.obj"
    r"|heights\.npz|height_field\.npz"
    rf"|README\.md|NOTICE\.txt|load_(?:mjlab|playground|isaaclab)\.py|{re.escape(MANIFEST)}"
)
"""Every name that a file of an export may have; whatever a manifest says, no other is touched."""


def save_export(folder: Path, files: dict[str, bytes], about: dict[str, Any]) -> None:
    """Write the files of an export, and remove those of the former one that it no longer has."""
    own = find_own_files(folder)
    wanted = {*files, MANIFEST}
    for name in sorted(wanted):
        _refuse_foreign(folder, name, own)
    about = {"format": FORMAT, **about}
    _write(folder / MANIFEST, _to_json({**about, "complete": False, "files": sorted(own | wanted)}))
    for name, content in files.items():
        _write(folder / name, content)
    _remove(folder, own - wanted)
    _write(folder / MANIFEST, _to_json({**about, "complete": True, "files": sorted(wanted)}))


def find_own_files(folder: Path) -> frozenset[str]:
    """Return which files in a folder are an export's; none where there is no folder, or nothing in it."""
    if folder.exists() and not folder.is_dir():
        raise ArenaError(f"{folder} is a file; choose another folder")
    if not (folder / MANIFEST).exists():
        entries = set(folder.iterdir()) if folder.exists() else set()
        if entries - find_leftovers(folder).keys():
            raise ArenaError(f"{folder} is not empty and holds no export; choose another folder")
        return frozenset()
    try:
        about = read_json(folder / MANIFEST)
        version, names = about["format"], about["files"]
        if not isinstance(version, int) or not isinstance(names, list):
            raise ValueError("not an export's")
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise ArenaError(
            f"{folder / MANIFEST} is damaged or of another program, so that nobody knows which files beside it "
            "are an export's; choose another folder"
        ) from error
    if version > FORMAT:
        raise ArenaError(f"{folder / MANIFEST}: written by a newer version; choose another folder")
    return frozenset(name for name in names if isinstance(name, str) and _OWN.fullmatch(name)) | {MANIFEST}


def _refuse_foreign(folder: Path, name: str, own: frozenset[str]) -> None:
    """Refuse to write where something lies that is no file of the export: a file, a folder, a link."""
    path = folder / name
    is_free = not os.path.lexists(path) and (path.parent.is_dir() or not os.path.lexists(path.parent))
    if not _is_inside(folder, name) or not (is_free or (name in own and path.is_file())):
        raise ArenaError(
            f"{path} is in the way and no file of the export in {folder}; move it, or choose another folder"
        )


def _is_inside(folder: Path, name: str) -> bool:
    """Return whether a name leads to that place in the folder, and by no link elsewhere."""
    return (folder / name).resolve() == folder.resolve() / name


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with write_atomically(path) as temporary:
        temporary.write_bytes(content)


def _remove(folder: Path, names: frozenset[str]) -> None:
    """Remove own files, and the folder of pieces that is empty then."""
    for name in names:
        if _is_inside(folder, name) and (folder / name).is_file():
            (folder / name).unlink()
    pieces = folder / "pieces"
    if names and _is_inside(folder, "pieces") and pieces.is_dir() and not any(pieces.iterdir()):
        pieces.rmdir()


def _to_json(about: dict[str, Any]) -> bytes:
    return (json.dumps(about, indent=2, allow_nan=False) + "\n").encode()
