"""What survives kills, damaged files, and files that name code?"""

from __future__ import annotations

import json
import random
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import evolution as ev
import reconstruction as rc
import symbrion_gym as sg
from benchmarks.evidence.row import Figures, row

GROUP = "What survives?"
_KILLS = 10
_MUTANTS = 40
_RUN = [
    "evolve",
    "--arena",
    "truth",
    "--modules",
    "4",
    "--generations",
    "8",
    "--trials",
    "1",
    "--workers",
    "2",
]
_RUN += ["--seed", "3", "--quiet"]


@row(GROUP, f"Runs killed (SIGKILL) at {_KILLS} random moments after they had begun, and resumed: history and champion "
     "equal to an uninterrupted run", f"{_KILLS} of {_KILLS}", lambda found: found["equal"] == _KILLS)  # fmt: skip
def measure_kills() -> Figures:
    """Kill runs, resume them, compare."""
    rng = random.Random(0)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        begin = time.perf_counter()
        _command([*_RUN, "--folder", str(folder / "whole")])
        seconds, whole = time.perf_counter() - begin, _read(folder / "whole")
        equal, interrupted = 0, 0
        for number in range(_KILLS):
            path = folder / f"run{number}"
            process = subprocess.Popen([sys.executable, "-m", "evolution", *_RUN, "--folder", str(path)])
            while not (path / "config.json").exists():
                time.sleep(0.02)
            time.sleep(rng.uniform(0.0, 0.7 * seconds))
            interrupted += process.poll() is None
            process.kill()
            process.wait()
            _command(["resume", str(path), "--workers", "2", "--quiet"])
            equal += _read(path) == whole
    return {"equal": equal, "interrupted": interrupted, "of": _KILLS,
            "said": f"{equal} of {_KILLS} ({interrupted} while they worked)"}  # fmt: skip


def _command(words: list[str]) -> None:
    subprocess.run([sys.executable, "-m", "evolution", *words], check=True, capture_output=True)


def _read(folder: Path) -> Any:
    run = ev.load_run(folder)
    names = [name for name in run.history.dtype.names or () if "seconds" not in name]
    return json.loads((folder / "champion.json").read_text()), run.history[names].tolist()


@row(GROUP, "Damaged files (bytes flipped, cut, zeroed) of nine kinds: read whole, or refused by an error of ours; "
     "other errors", "0 other errors", lambda found: not found["others"])  # fmt: skip
def measure_damage() -> Figures:
    """Damage files and read them."""
    rng = np.random.default_rng(0)
    expected = (rc.ScanError, rc.ReconstructionError, sg.ArenaError, ev.RunError, sg.OrganismError)
    found = {"read": 0, "refused": 0, "others": []}
    with tempfile.TemporaryDirectory() as name:
        for path, load in _make_files(Path(name)):
            whole = path.read_bytes()
            for _ in range(_MUTANTS):
                path.write_bytes(_damage(whole, rng))
                try:
                    load()
                    found["read"] += 1
                except expected:
                    found["refused"] += 1
                except Exception as error:
                    found["others"].append(f"{path.name}: {type(error).__name__}: {error}"[:200])
            path.write_bytes(whole)
    said = f"{found['read']} read, {found['refused']} refused, {len(found['others'])} other errors"
    return found | {"said": said}


def _make_files(folder: Path) -> list[tuple[Path, Callable[[], Any]]]:
    """Return files of many kinds, each with what reads it."""
    points = np.random.default_rng(1).uniform(-1.0, 1.0, (400, 3)) * (1.0, 1.0, 0.02)
    files: list[tuple[Path, Callable[[], Any]]] = []
    for ending in ("ply", "xyz", "npz", "npy"):
        path = folder / f"cloud.{ending}"
        rc.save_points(path, points)
        files.append((path, lambda path=path: rc.load_points(path)))
    surface = rc.reconstruct(points, units=60)
    surface.save(folder / "surface.npz")
    files.append((folder / "surface.npz", lambda: rc.Reconstruction.load(folder / "surface.npz")))
    sg.load_arena("simple").save(folder / "arena")
    for part in ("arena.json", "surface.obj"):
        if (folder / "arena" / part).exists():
            files.append((folder / "arena" / part, lambda: sg.Arena.load(folder / "arena")))
    run = folder / "run"
    ev.evolve(
        ev.EvolutionConfig(
            arena="truth", modules=3, generations=1, population_size=4, trials=1, folder=str(run)
        )
    )
    for part in ("config.json", "record.npz"):
        files.append((run / part, lambda: ev.load_run(run)))
    files.append((run / "champion.json", lambda: ev.load_champion(run)))
    return files


def _damage(content: bytes, rng: np.random.Generator) -> bytes:
    kind, damaged = rng.integers(4), bytearray(content)
    if kind == 0:
        return bytes(damaged[: rng.integers(len(damaged))])
    if kind == 1:
        begin = int(rng.integers(len(damaged)))
        damaged[begin : begin + 16] = bytes(len(damaged[begin : begin + 16]))
    else:
        for place in rng.integers(len(damaged), size=1 if kind == 2 else 20):
            damaged[place] ^= 1 << int(rng.integers(8))
    return bytes(damaged)


@row(GROUP, "Files that name code (runs, tasks, controllers, submissions): tests of attacks that pass", "all",
     lambda found: found["code"] == 0)  # fmt: skip
def measure_attacks() -> Figures:
    """Run the tests of attacks."""
    found = _run_tests("tests/evolution/test_attacks.py")
    return {"code": found["code"], "said": found["said"]}


@row(
    GROUP,
    "Tests that are too long for CI, or of extras that it lacks (Warp on its CPU device, Ray, PPO)",
    "all",
    lambda found: found["code"] == 0 and not found.get("skipped"),
)
def measure_long_tests() -> Figures:
    """Run the long tests, each file in a process of its own: PyTorch cannot be loaded where pictures were drawn."""
    listed = _run_tests("-m", "long", "--collect-only", "-q")["lines"]
    parts = [_run_tests("-m", "long", line.split(":")[0]) for line in listed if line.startswith("tests/")]
    counts = {
        word: sum(int(found[1]) for part in parts if (found := re.search(rf"(\d+) {word}", part["said"])))
        for word in ("passed", "failed", "skipped")
    }
    said = ", ".join(f"{count} {word}" for word, count in counts.items() if count)
    return {**counts, "code": max(part["code"] for part in parts), "said": said}


def _run_tests(*words: str) -> Figures:
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *words], capture_output=True, text=True, check=False
    )
    lines = done.stdout.strip().splitlines()
    return {"code": done.returncode, "said": lines[-1].strip("= "), "lines": lines}
