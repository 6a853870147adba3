"""Settings that every test shares."""

import os
import sys
from pathlib import Path

import pytest
import shape_checks

ROOT = Path(__file__).parents[1]
SHARED_DATA = ROOT.parent / "shared" / "data"

if sys.platform == "linux":  # pictures without a window, also where there is a display
    os.environ.setdefault("MUJOCO_GL", "egl")
os.environ.setdefault("SYMBRION_CACHE", str(ROOT / ".pytest_cache" / "symbrion"))

shape_checks.install()


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real scans; the test is skipped where it is absent."""
    if not SHARED_DATA.is_dir():
        pytest.skip("the real scans of ../shared/data are not here")
    return SHARED_DATA
