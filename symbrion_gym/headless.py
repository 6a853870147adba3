"""Render without a display: on Linux, choose EGL for MuJoCo where there is none.

MuJoCo reads the choice when it is first imported, so this module is imported before it.
"""

import os
import sys

GL_VARIABLE = "MUJOCO_GL"


def prefer_egl() -> None:
    """Choose EGL where there is no display and the user has chosen nothing."""
    has_display = bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    if sys.platform == "linux" and not has_display:
        os.environ.setdefault(GL_VARIABLE, "egl")


prefer_egl()
