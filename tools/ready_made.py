"""The ready-made arenas that ship with the package, and how they are made: survey, networks, convex pieces."""

from dataclasses import replace
from pathlib import Path

from evolution._src.suite.exam import make_exam_scan
from evolution._src.suite.tasks import COURSES
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.reconstruct import reconstruct
from reconstruction._src.scans.preprocess import preprocess
from reconstruction._src.scans.selection import thin
from symbrion_gym._src.arenas.arena import Arena
from symbrion_gym._src.arenas.making import load_arena, make_arena
from symbrion_gym._src.arenas.saving import find_own_files
from symbrion_gym._src.sensing.survey import SPACING, survey

_UNITS = {"gsrm": 2200, "gg": 7000}  # Network -> its resolution
_EXACT = ("truth", "simple")  # Arenas that need no scan


def make_ready_made(folder: str | Path, seed: int = 0, progress: Progress = silent) -> dict[str, Arena]:
    """Make the ready-made arenas and save each in a folder of its name.

    The course is looked at by the scanner of the survey alone; the arenas made of its points know nothing of it.
    """
    folder = Path(folder)
    for name in (*_EXACT, *_UNITS):
        find_own_files(folder / name)  # refuses now what saving would refuse in the end
    arenas = {name: load_arena(name) for name in _EXACT}
    progress("survey", 0.0)
    points = thin(preprocess(survey(arenas["truth"], seed=seed)), SPACING)
    for index, (method, units) in enumerate(_UNITS.items(), 1):
        progress(f"{method}: network and pieces", index / (1 + len(_UNITS)))
        mesh = reconstruct(points, method=method, units=units, seed=seed).mesh
        made = make_arena(mesh, name=method, seed=seed)
        # Equal seeds make equal files: the time it took is left out.
        arenas[method] = replace(made, quality=replace(made.quality, seconds=0.0))
    for name, arena in arenas.items():
        arena.save(folder / name)
    progress("done", 1.0)
    return arenas


if __name__ == "__main__":
    make_ready_made("assets/arenas")
    for place in COURSES:
        scan = make_exam_scan(place, seed=0)
        scan = replace(scan, quality=replace(scan.quality, seconds=0.0))
        scan.save(Path("assets/suite/arenas") / place)
