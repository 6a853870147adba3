"""From a cloud to an arena in a process of its own, as a user would with no option set.

`python -m benchmarks.material.cloud_to_arena CLOUD.npz FOLDER` writes FOLDER/arena and FOLDER/made.npz with the
reconstructed surface, and prints what was reached as JSON. `make` runs it and adds processor time and peak memory.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh

from benchmarks.material.array_files import load_arrays, save_arrays
from benchmarks.material.scan_sources import ScanCase
from reconstruction._src.base.atomic_write import write_atomically
from symbrion_gym._src.arenas.arena import Arena

LONGEST = 1800.0
"""A process that takes longer is ended [s]."""


class Made(NamedTuple):
    """What a cloud became.

    Attributes:
        surface: the reconstructed surface, in the frame of the cloud [m].
        arena: the arena.
        offset: `[3]` what is to be added to coordinates of the arena to get those of the cloud [m].
        figures: what the process reports, with cpu_s, wall_s and memory_gb.
    """

    surface: trimesh.Trimesh
    arena: Arena
    offset: np.ndarray
    figures: dict[str, Any]


class ArenaFailedError(Exception):
    """No arena came of a cloud; the message is the last line that the process said."""


def make(case: ScanCase, folder: Path) -> Made:
    """Make an arena of a cloud in a new process, and measure its processor time and memory.

    Raises:
        ArenaFailedError: the process ended without an arena.
    """
    folder.mkdir(parents=True, exist_ok=True)
    arrays = {"points": case.points, "viewpoints": case.viewpoints, "seen_from": case.seen_from}
    save_arrays(folder / "cloud.npz", arrays)
    words = [
        sys.executable,
        "-m",
        "benchmarks.material.cloud_to_arena",
        str(folder / "cloud.npz"),
        str(folder),
    ]
    begin = time.perf_counter()
    log = folder / "log.txt"
    with write_atomically(log) as temporary, temporary.open("w") as file:
        process = subprocess.Popen(
            ["timeout", f"{LONGEST:.0f}", *words], stdout=file, stderr=subprocess.STDOUT
        )
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    said = log.read_text()
    if process.returncode:
        last = (said.strip().splitlines() or [f"exit code {process.returncode}"])[-1]
        raise ArenaFailedError(last)
    figures = json.loads(said.splitlines()[-1])
    figures |= {
        "cpu_s": usage.ru_utime + usage.ru_stime,
        "wall_s": time.perf_counter() - begin,
        "memory_gb": usage.ru_maxrss * 1024 / 1e9,
        "warnings": [line for line in said.splitlines()[:-1] if line.strip()][-5:],
    }
    held = load_arrays(folder / "made.npz")
    surface = trimesh.Trimesh(held["vertices"], held["faces"], process=False)
    return Made(surface, Arena.load(folder / "arena"), held["offset"], figures)


def hash_pieces(arena: Arena) -> str:
    """Return a hash of the contact geometry, equal for equal bits."""
    digest = hashlib.sha256()
    for piece in arena.pieces:
        digest.update(np.ascontiguousarray(piece.vertices).tobytes())
    if arena.height_field is not None:
        digest.update(np.ascontiguousarray(arena.height_field.heights).tobytes())
    return digest.hexdigest()


def main() -> None:
    """Read the cloud, make the arena, write both and print the figures."""
    import reconstruction as rc
    import symbrion_gym as sg

    cloud, folder = Path(sys.argv[1]), Path(sys.argv[2])
    held = load_arrays(cloud)
    begin = time.perf_counter()
    result = _reconstruct(rc, held)
    middle = time.perf_counter()
    knows_result = "surface" in inspect.signature(sg.make_arena).parameters
    arena = sg.make_arena(result if knows_result else result.mesh, cache=False)
    end = time.perf_counter()
    arena.save(folder / "arena")
    offset = np.asarray(getattr(arena, "offset", np.zeros(3)), float)
    frame = np.asarray(getattr(result, "offset", offset), float)
    vertices = np.asarray(result.mesh.vertices, float) + frame
    save_arrays(folder / "made.npz", {"vertices": vertices, "faces": result.mesh.faces, "offset": offset})
    about = arena.provenance
    print(
        json.dumps(
            {
                "accuracy": about.get("accuracy") or about["options"]["accuracy"],
                "pieces": len(arena.pieces),
                "kind": arena.kind,
                "triangles": len(result.mesh.faces),
                "reconstruct_s": middle - begin,
                "arena_s": end - middle,
                "hash": hash_pieces(arena),
                "own_quality": arena.quality.as_dict(),
                "is_reached": about.get("is_reached"),
            }
        )
    )


def _reconstruct(rc: Any, held: dict[str, Any]) -> Any:
    """Pre-process and reconstruct as `symbrion reconstruct` does, with viewpoints where the code takes them."""
    if not hasattr(rc, "preprocess_cloud"):
        return rc.reconstruct(rc.preprocess(held["points"]), viewpoint=held.get("viewpoints"))
    readings = rc.recenter(rc.Cloud(**held))
    return rc.reconstruct(rc.preprocess_cloud(readings), readings=readings)


if __name__ == "__main__":
    main()
