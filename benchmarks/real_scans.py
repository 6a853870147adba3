"""Arenas of scans: made scenes with known truth and public scans, from the cloud to contact, side by side with others.

    python -m benchmarks.real_scans [--quick] [--only NAME ...] [--data FOLDER ...] [--peer-python PYTHON]

Each scene goes from cloud to arena in a process of its own, with no option set. A judge that shares no code with the
project measures surface and contact against all readings, and against the truth where it is known. Peers: Open3D's
Poisson surface (depth 9, decimated to equal triangles), coacd on the surface as it is, prisms of the decimated
surface, a height field. Open3D may be in another Python; without it its columns are left out.
"""

from __future__ import annotations

import argparse
import gc
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from benchmarks.material.array_files import load_arrays, save_arrays
from benchmarks.material.bars import format_bars, format_peers, summarise
from benchmarks.material.cloud_to_arena import ArenaFailedError, Made, make
from benchmarks.material.contact_judge import Judge, Solid
from benchmarks.material.goal_driving import drive_to_goal
from benchmarks.material.made_scenes import SCENES
from benchmarks.material.peer_contacts import PEERS, PeerFailedError, time_peer
from benchmarks.material.scan_sources import (
    PUBLIC,
    MissingScanError,
    ScanCase,
    find_folders,
    load_case,
    load_file,
)
from benchmarks.material.snake_steps import compare_steps
from benchmarks.report import load_record, write_results
from symbrion_gym._src.arenas.arena import Arena

_PEER = Path(__file__).parent / "material" / "open3d_peer.py"
_QUICK = ("table", "thin walls", "rough ground", "apartment", "stairs", "aerial /50")
"""Scenes of a quick run."""
_REPEATED = ("table", "rough ground", "apartment", "aerial /50")
"""Scenes that are made a second time while other processes keep every core busy."""
_SUMMARY = "summary"


def run(
    quick: bool = False,
    only: tuple[str, ...] = (),
    data: tuple[Path, ...] = (),
    peer_python: str | None = None,
    clouds: tuple[Path, ...] = (),
    peers: bool = True,
) -> dict:
    """Measure the scenes, print tables and return the results; scenes left out keep their last results.

    Args:
        quick: a few scenes, no coacd.
        only: names of scenes; all by default.
        data: folders of public scans, searched first.
        peer_python: a Python that has Open3D; this one by default.
        clouds: files of one's own in place of the scenes; nothing of them is written.
        peers: whether other ways to contact are measured too.
    """
    has_open3d, reason = _find_open3d(peer_python or sys.executable)
    if not has_open3d:
        print(f"without Open3D (Poisson, second judge): {reason}", flush=True)
    python = (peer_python or sys.executable) if has_open3d else None
    names = only or (_QUICK if quick else (*SCENES, *PUBLIC))
    contacts = [name for name in PEERS if peers and not (quick and name == "coacd")]
    rows = {}
    for case in _load(names, find_folders(list(data)), clouds):
        begin = time.perf_counter()
        rows[case.name] = measure(case, contacts, python)
        if case.name in _REPEATED and not quick and "failed" not in rows[case.name]:
            rows[case.name]["same_bits"] = float(_has_same_bits(case, rows[case.name]["made"]["hash"]))
        print(f"{case.name}: {time.perf_counter() - begin:.0f} s", flush=True)
        if not clouds:
            write_results("real_scans", {case.name: rows[case.name]})
        gc.collect()
    print("\n".join(["", *format_peers(rows), "", *format_bars(rows)]))
    if clouds:
        return rows
    scenes = {name: row for name, row in load_record("real_scans")["results"].items() if name != _SUMMARY}
    write_results("real_scans", {_SUMMARY: summarise(scenes)})
    return load_record("real_scans")["results"]


def measure(case: ScanCase, contacts: list[str], python: str | None) -> dict[str, Any]:
    """Return all figures of one scene.

    Args:
        case: the cloud.
        contacts: names of the peers.
        python: a Python with Open3D, or None.
    """
    row: dict[str, Any] = {"points": len(case.points)}
    with tempfile.TemporaryDirectory() as folder:
        try:
            made = make(case, Path(folder))
        except ArenaFailedError as error:
            return row | {"failed": str(error)}
    row["made"] = made.figures
    local, surface, offset = _recenter(case, made)
    judge = Judge(local)
    row["surface"] = judge.judge_surface(surface)
    arenas = {"ours": made.arena}
    found: dict[str, dict[str, Any]] = {"ours": {"pieces": len(made.arena.pieces)}}
    for name in contacts:
        try:
            arenas[name], found[name] = time_peer(name, local, surface)
        except PeerFailedError as error:
            found[name] = {"failed": str(error)}
    for name, arena in arenas.items():
        solid = _find_solid(arena, offset if name == "ours" else np.zeros(3))
        found[name] |= judge.judge_contact(surface, solid)
        if name == "ours" and python is not None:
            row["second_judge"] = _check(python, local, surface, solid)
    below = np.inf if local.viewpoints is None else float(local.viewpoints[:, 2].max())
    for name, times in compare_steps(arenas, below).items():
        found.setdefault(name, {}).update(times)
    row["contact"] = found
    if hasattr(made.arena, "find_route"):
        row["drive"] = _drive(judge, made.arena, surface, offset)
    if python is not None:
        row["poisson"] = _measure_poisson(python, judge, len(surface.faces))
    return row


def _drive(judge: Judge, arena: Arena, surface: trimesh.Trimesh, offset: np.ndarray) -> dict[str, Any]:
    """Drive to the goal of the arena's own route, and see whether the route's ends were seen by the scanner."""
    found = drive_to_goal(arena)
    if judge.case.origins is not None and "start" in found:
        ends = np.array([found["start"], found["goal"]]) + offset
        found["unseen_ends"] = judge.count_unseen(surface, ends)
    return found


def _has_same_bits(case: ScanCase, wanted: str) -> bool:
    """Return whether the arena is the same while every core is busy with other work."""
    burn = [sys.executable, "-c", "while True: pass"]
    others = [subprocess.Popen(burn) for _ in range(os.cpu_count() or 1)]
    try:
        with tempfile.TemporaryDirectory() as folder:
            return make(case, Path(folder)).figures["hash"] == wanted
    except ArenaFailedError:
        return False
    finally:
        for other in others:
            other.kill()
            other.wait()


def _load(names: Iterable[str], folders: list[Path], clouds: tuple[Path, ...]) -> Iterable[ScanCase]:
    """Yield the scenes that can be had; name the others with the reason."""
    for what in clouds or names:
        try:
            yield load_file(what) if isinstance(what, Path) else load_case(what, folders)
        except MissingScanError as error:
            print(f"skipped: {error}", flush=True)


def _recenter(case: ScanCase, made: Made) -> tuple[ScanCase, trimesh.Trimesh, np.ndarray]:
    """Return cloud and surface near the origin, and what is to be added to the arena's coordinates there."""
    center = np.round(case.points.mean(axis=0)) if np.abs(case.points).max() > 1e4 else np.zeros(3)
    surface = trimesh.Trimesh(made.surface.vertices - center, made.surface.faces, process=False)
    moved = [None if part is None else part - center for part in (case.viewpoints, case.origins)]
    local = ScanCase(case.name, case.points - center, moved[0], case.seen_from, moved[1], case.truth)
    return local, surface, made.offset - center


def _find_solid(arena: Arena, offset: np.ndarray) -> Solid:
    if arena.height_field is not None:
        return Solid.of_ground(arena.height_field.as_mesh().apply_translation(offset))
    return Solid.of_pieces([piece.copy().apply_translation(offset) for piece in arena.pieces])


def _find_open3d(python: str) -> tuple[bool, str]:
    found = subprocess.run([python, "-c", "import open3d"], capture_output=True, text=True, check=False)
    return found.returncode == 0, (found.stderr.strip().splitlines() or [""])[-1]


def _ask_peer(python: str, job: str, arrays: dict[str, Any]) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "in.npz", Path(folder) / "out.npz"
        save_arrays(source, arrays)
        subprocess.run([python, str(_PEER), job, str(source), str(target)], check=True, capture_output=True)
        return load_arrays(target)


def _measure_poisson(python: str, judge: Judge, num_triangles: int) -> dict[str, Any]:
    case = judge.case
    origins = case.origins if case.origins is not None else np.empty((0, 3))
    try:
        found = _ask_peer(
            python, "poisson", {"points": case.points, "origins": origins, "num_triangles": num_triangles}
        )
    except subprocess.CalledProcessError as error:
        return {"failed": error.stderr.decode()[-200:]}
    mesh = trimesh.Trimesh(found["vertices"], found["faces"], process=False)
    return judge.judge_surface(mesh) | {"triangles": len(mesh.faces), "cpu_s": float(found["cpu_s"])}


def _check(python: str, case: ScanCase, surface: trimesh.Trimesh, solid: Solid) -> dict[str, float]:
    """Measure error of the surface and beams on contact by Open3D."""
    meshes = {
        "vertices": surface.vertices,
        "faces": surface.faces,
        "solid_vertices": solid.casts.vertices,
        "solid_faces": solid.casts.faces,
    }
    has_beams = case.origins is not None and case.viewpoints is not None
    beams = {
        "origins": case.origins if has_beams else np.empty((0, 3)),
        "ends": case.points if has_beams else np.empty((0, 3)),
    }
    found = _ask_peer(python, "check", {"points": case.points, **meshes, **beams})
    return {name: float(value) for name, value in found.items()}


def main() -> None:
    """Read the command line and run."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="a few scenes, no coacd")
    parser.add_argument(
        "--only", nargs="+", default=[], choices=(*SCENES, *PUBLIC), metavar="NAME", help="scenes to run"
    )
    parser.add_argument("--data", nargs="+", type=Path, default=[], help="folders of public scans")
    parser.add_argument("--peer-python", help="a Python that has Open3D (default: this one)")
    parser.add_argument(
        "--clouds", nargs="+", type=Path, default=[], help="files of your own in place of the scenes"
    )
    parser.add_argument("--no-peers", action="store_true", help="measure only ours, and Poisson")
    options = parser.parse_args()
    run(
        options.quick,
        tuple(options.only),
        tuple(options.data),
        options.peer_python,
        tuple(options.clouds),
        not options.no_peers,
    )


if __name__ == "__main__":
    main()
