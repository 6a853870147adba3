"""Contact geometry in the user's cache: one file an entry, named by the hash of all that went in."""

import hashlib
import json
import logging
from collections.abc import Callable
from dataclasses import asdict
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np
import trimesh
from filelock import FileLock
from jaxtyping import Bool

from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.bounded_read import read_npz
from reconstruction._src.base.cache import find_cache_folder
from symbrion_gym._src.contact.kinds import Contact, ContactOptions, HeightField
from symbrion_gym._src.contact.quality import ArenaQuality

_CODE = ("symbrion_gym/_src/contact", "reconstruction/_src/geometry", "reconstruction/_src/surfaces")
"""Folders whose code shapes the pieces: entries that another version of it has made are left alone."""
_LIBRARIES = ("coacd", "libigl", "mujoco", "numpy", "scipy", "trimesh", "fast-simplification", "manifold3d")

_logger = logging.getLogger(__name__)


def hash_arena(
    mesh: trimesh.Trimesh, options: ContactOptions, is_two_sided: Bool[np.ndarray, " F"] | None = None
) -> str:
    """Return the key of a surface, options and library versions."""
    digest = hashlib.sha256()
    two_sided = np.zeros(0, dtype=bool) if is_two_sided is None else is_two_sided
    for array, kind in ((mesh.vertices, "<f8"), (mesh.faces, "<i8"), (two_sided, "?")):
        digest.update(repr(np.shape(array)).encode())
        digest.update(np.ascontiguousarray(array, dtype=kind).tobytes())
    digest.update(json.dumps([_hash_code(), asdict(options), find_versions()], sort_keys=True).encode())
    return digest.hexdigest()[:32]


@cache
def _hash_code() -> str:
    """Return the hash of the code that makes and keeps pieces."""
    root = Path(__file__).parents[3]
    paths = [Path(__file__), *sorted(path for folder in _CODE for path in (root / folder).rglob("*.py"))]
    return hashlib.sha256(b"".join(path.read_bytes() for path in paths)).hexdigest()


def find_versions() -> dict[str, str]:
    """Return the versions of the libraries that shape the pieces."""
    versions = {}
    for name in _LIBRARIES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "absent"
    return versions


def get_or_make(
    mesh: trimesh.Trimesh,
    options: ContactOptions,
    make: Callable[[], Contact],
    folder: Path | None = None,
    is_two_sided: Bool[np.ndarray, " F"] | None = None,
) -> Contact:
    """Return the cached contact of a surface, or make it and keep it.

    Two processes that want one entry at the same time make it once: the second waits. An entry that cannot be
    read is made again. A cache that cannot be written costs a warning, not the arena.
    """
    folder = find_cache_folder("arenas") if folder is None else folder
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{hash_arena(mesh, options, is_two_sided)}.npz"
    with FileLock(f"{path}.lock"):
        kept = read_entry(path)
        if kept is not None:
            return kept
        contact = make()
        try:
            write_entry(path, contact)
        except OSError as error:
            _logger.warning("the arena cannot be kept in %s: %s", path, error)
        return contact


def write_entry(path: Path, contact: Contact) -> None:
    """Write an entry; it appears whole or not at all."""
    arrays = {
        "vertices": np.concatenate([p.vertices for p in contact.pieces] or [np.zeros((0, 3))]),
        "faces": np.concatenate([p.faces for p in contact.pieces] or [np.zeros((0, 3), dtype=np.int64)]),
        "num_vertices": np.array([len(p.vertices) for p in contact.pieces], dtype=np.int64),
        "num_faces": np.array([len(p.faces) for p in contact.pieces], dtype=np.int64),
        "about": np.array(json.dumps({"quality": contact.quality.as_dict(), "notes": contact.notes})),
    }
    if contact.height_field is not None:
        arrays |= {f"field_{name}": value for name, value in contact.height_field._asdict().items()}
    with write_atomically(path) as temporary:
        np.savez_compressed(temporary, **arrays)


def read_entry(path: Path) -> Contact | None:
    """Return an entry; None where there is none, or a damaged one, which is logged as a warning."""
    if not path.is_file():
        return None
    try:
        arrays = read_npz(path)
        vertices = np.split(arrays["vertices"], np.cumsum(arrays["num_vertices"]))[:-1]
        faces = np.split(arrays["faces"], np.cumsum(arrays["num_faces"]))[:-1]
        about = json.loads(str(arrays["about"]))
        height_field = None
        if "field_heights" in arrays:
            height_field = HeightField(*(arrays[f"field_{name}"] for name in HeightField._fields))
        pieces = [trimesh.Trimesh(v, f, process=False) for v, f in zip(vertices, faces, strict=True)]
        return Contact(pieces, ArenaQuality.from_dict(about["quality"]), height_field, about["notes"])
    except Exception as error:  # whatever is wrong with an entry, it can be made again
        _logger.warning("the cache entry %s cannot be used (%s); it is made again", path, error)
        return None
