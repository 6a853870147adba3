"""The folder of files that ship with the package, and the names of arenas."""

from pathlib import Path

from symbrion_gym._src.errors import ArenaError

SCANNED_PITS = {"gsrm": (0.45, 0.40), "gg": (0.45, 0.40)}
"""Widths of the pit [m] with which each scanned arena comes with the package, the default first."""
NAMED_ARENAS = ("truth", "simple", "stairs", *SCANNED_PITS)


def find_assets() -> Path:
    """Return the folder `assets`: inside the package in a wheel, next to it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "assets", package.parent / "assets"):
        if folder.is_dir():
            return folder
    raise ArenaError(f"the folder 'assets' is neither in {package} nor next to it; install the package again")
