"""Where the files lie that the package ships, and the arenas that have a name."""

from pathlib import Path

from symbrion_gym.errors import ArenaError

SCANNED_PITS = {"gsrm": (0.45, 0.40), "gg": (0.45, 0.40)}
"""Widths of the pit [m] with which each scanned arena comes with the package, the default first."""
NAMED_ARENAS = ("truth", "simple", "stairs", *SCANNED_PITS)


def find_assets() -> Path:
    """Return the folder `assets`: inside the package in a wheel, beside it in a checkout.

    Raises:
        ArenaError: neither is there.
    """
    package = Path(__file__).resolve().parent
    for folder in (package / "assets", package.parent / "assets"):
        if folder.is_dir():
            return folder
    raise ArenaError(f"the folder 'assets' is neither in {package} nor beside it; install the package again")
