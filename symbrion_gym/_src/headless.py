"""Render without a display: on Linux without one, MuJoCo uses EGL; elsewhere it finds the system's OpenGL itself.

MuJoCo reads the choice when it is first imported, so this module is imported before it.
"""

import os
import sys


def has_display() -> bool:
    """Return whether a window can be opened here: macOS and Windows always have a display, Linux may not."""
    return sys.platform != "linux" or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


def prefer_egl() -> None:
    """Select EGL where there is no display and the user has selected nothing; macOS and Windows refuse EGL."""
    if not has_display() and not os.environ.get("MUJOCO_GL"):
        os.environ["MUJOCO_GL"] = "egl"


prefer_egl()
