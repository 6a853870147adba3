"""The folder of files that ship with the package, and the names of arenas."""

from pathlib import Path

from symbrion_gym._src.errors import ArenaError

SCANNED = ("gsrm", "gg")  # The arenas that were made of a scan of the default course, one by each network
NAMED_ARENAS = ("truth", "simple", "stairs", *SCANNED)


def find_assets() -> Path:
    """Return the folder `assets`: inside the package in a wheel, next to it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "assets", package.parent / "assets"):
        if folder.is_dir():
            return folder
    raise ArenaError(f"the folder 'assets' is neither in {package} nor next to it; install the package again")
