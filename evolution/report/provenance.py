"""Machine and versions, for the foot of a page and for the files beside it."""

import os
import platform
from importlib.metadata import version

PACKAGES = ("symbrion-gym", "mujoco", "jax", "numpy", "coacd", "cma")


def describe_machine() -> str:
    """Return processor, cores, Python and package versions in one line."""
    packages = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    return f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, {packages}"
