"""What all subcommands share: common options, checks of values and paths, and the writing of results."""

import abc
import contextlib
import dataclasses
import math
import os
import sys
import zipfile
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any

import symbrion_gym as sg
from evolution._src.cli.console import Console
from evolution._src.errors import EvolutionError
from reconstruction._src.base.errors import ReconstructionPackageError
from symbrion_gym._src.assets import NAMED_ARENAS
from symbrion_gym._src.errors import SymbrionGymError

EXPECTED_ERRORS = (ReconstructionPackageError, SymbrionGymError, EvolutionError, OSError, MemoryError)
"""What bad input and a full disk raise; anything else is a defect of ours."""


class UsageError(EvolutionError):
    """A command line cannot be executed; the message names the value and a remedy."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Command(abc.ABC):
    """A subcommand: its fields are its options, `run` does the work."""

    json: bool = False
    """Print a summary as JSON on standard output, and nothing else."""
    quiet: bool = False
    """Show no progress."""

    def __post_init__(self) -> None:
        try:
            self.check()
        except EXPECTED_ERRORS as error:  # of the library, too: before the work begins they are wrong usage
            raise UsageError(str(error)) from error

    def check(self) -> None:
        """Refuse options that cannot be executed, before anything is written."""
        self.require_least(seed=0, workers=1)

    def require_least(self, **least: float) -> None:
        """Refuse options below the smallest value that makes sense; None is no value."""
        for name, value in least.items():
            given = getattr(self, name, None)
            if given is not None and not given >= value:
                raise UsageError(f"--{name.replace('_', '-')} {given} is too few; give {value} or more")

    def require_positive(self, *names: str) -> None:
        """Refuse options that are not finite numbers above 0; None is no value."""
        for name in names:
            given = getattr(self, name)
            if given is not None and not 0 < given < math.inf:
                raise UsageError(f"--{name.replace('_', '-')} {given} must be a finite number above 0")

    def explain_interruption(self) -> str:
        """Return in a line how the work goes on after an interruption by the keyboard; empty where it does not."""
        return ""

    @abc.abstractmethod
    def run(self, console: Console) -> dict[str, Any]:
        """Do the work and return a summary; with `ok: False` in it the exit code is 1, or else its `exit_code`."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class TrustingCommand(Command):
    """A subcommand that reads files in which code of a user may be named."""

    allow_code: tuple[str, ...] = ()
    """Modules or packages of yours that the files name and that may be imported; no other code of a file is run."""

    def check(self) -> None:
        super().check()
        find_modules_here(*(each.partition(".")[0] for each in self.allow_code))


@dataclasses.dataclass(frozen=True, kw_only=True)
class SeededCommand(Command):
    """A subcommand that uses random numbers."""

    seed: int = 0
    """Seed of all random numbers; equal seeds give equal results."""


def find_modules_here(*names: str | None) -> None:
    """Let the command line name modules in the working folder, after all others; no other code there is found."""
    with contextlib.suppress(OSError):  # the folder has been removed
        here = os.getcwd()
        tops = [name.partition(":")[0].partition(".")[0] for name in names if name]
        if here not in sys.path and any(PathFinder.find_spec(top, [here]) for top in tops):
            sys.path.append(here)


def require_file(path: Path, option: str) -> None:
    """Refuse a path that is not a readable file."""
    if not path.exists():
        raise UsageError(f"{option} {path}: no such file")
    if path.is_dir():
        raise UsageError(f"{option} {path} is a folder; give a file")
    if not os.access(path, os.R_OK):
        raise UsageError(f"{option} {path} cannot be read; change its permissions")


def require_writable_file(path: Path | None, option: str, endings: tuple[str, ...]) -> None:
    """Refuse a file that cannot be written, or whose ending is not one of `endings`; None is no file."""
    if path is None:
        return
    if not path.name.lower().endswith(endings):
        raise UsageError(f"{option} {path} has an unknown ending; use one of {', '.join(endings)}")
    if path.is_dir():
        raise UsageError(f"{option} {path} is a folder; give a file name")
    if path.exists() and not (path.is_file() and os.access(path, os.W_OK)):
        raise UsageError(f"{option} {path} is write-protected or not a regular file; give another name")
    require_writable_folder(path.parent, option)


def require_own_archive(path: Path, option: str, member: str) -> None:
    """Refuse to replace a file at the default place that this command did not write."""
    if not path.exists():
        return
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            if f"{member}.npy" in archive.namelist():
                return
    raise UsageError(f"{path} exists and was not written by this command; name another file with {option}")


def require_writable_folder(path: Path, option: str) -> None:
    """Refuse a folder that cannot be created or written to."""
    if path.exists() and not path.is_dir():
        raise UsageError(f"{option} {path} is a file; give a folder")
    # the root may be absent, too: a drive on Windows
    existing = next((each for each in (path, *path.parents) if each.exists()), path)
    if not existing.is_dir() or not os.access(existing, os.W_OK | os.X_OK):
        raise UsageError(f"{option} {path} cannot be written; give another folder")


def check_arena(arena: str) -> None:
    """Refuse an arena that is neither the name of a ready-made one nor an existing file or arena folder."""
    if arena not in NAMED_ARENAS and not Path(arena).exists():
        names = ", ".join(NAMED_ARENAS)
        raise UsageError(f"no arena '{arena}'; give one of {names}, an arena folder or a mesh file")
    is_folder = arena not in NAMED_ARENAS and Path(arena).is_dir()
    if is_folder and {"arena.json", "tiles.json"}.isdisjoint(os.listdir(arena)):
        sg.load_arena(arena)  # which says what is missing
