"""Where results come from, for pages and result files: machine, versions, selection of the champion."""

import os
import platform
from importlib.metadata import version
from pathlib import Path

from evolution._src.search.provenance import find_revision

PACKAGES = ("symbrion-gym", "mujoco", "jax", "numpy", "coacd", "cma")


def describe_machine() -> str:
    """Return processor, cores, versions of Python and packages, and the commit of a checkout in one line."""
    packages = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    revision = find_revision()
    packages += f", commit {revision}" if revision else ""
    return f"{_find_processor()}, {os.cpu_count()} cores, Python {platform.python_version()}, {packages}"


def describe_selection(successes: int, trials: int) -> str:
    """Return a sentence on how a champion was selected, from its fresh trials in the arena of its run."""
    if not trials:
        return "No genotype crossed in all of its trials; the champion is the fittest one."
    return (
        f"The champion was selected by fresh randomized trials there; it crossed in {successes} of {trials}."
    )


def _find_processor() -> str:
    """Return the name of the processor, which Linux has in a file; on other systems its architecture."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, "") or platform.machine()
