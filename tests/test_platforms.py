"""Other platforms, faked: what cannot be run on this machine must at least take the right branch."""

import ast
import errno
import os
import sys
from pathlib import Path

import mujoco
import mujoco.viewer
import numpy as np
import pytest

from evolution._src.backends.cluster import make_backend
from evolution._src.cli.command import UsageError, require_writable_folder
from evolution._src.cli.console import is_unread
from evolution._src.errors import RunError
from evolution._src.report.body_page import describe_machine
from reconstruction._src.base.atomic_write import write_atomically
from symbrion_gym._src import headless
from symbrion_gym._src.environment.rendering import SceneRenderer

ROOT = Path(__file__).parents[1]
FILES = [
    path
    for folder in ("reconstruction", "symbrion_gym", "evolution", "tools")
    for path in sorted((ROOT / folder).rglob("*.py"))
]
POSIX_MODULES = {"resource", "fcntl", "pwd", "grp", "termios", "tty", "pty", "syslog", "posix"}
POSIX_NAMES = {
    "fork", "forkpty", "getuid", "geteuid", "getgid", "getpgid", "killpg", "setsid", "setpgid", "nice", "getloadavg",
    "sched_getaffinity", "sched_setaffinity", "sysconf", "statvfs", "mkfifo", "chown", "O_DIRECTORY", "O_NOFOLLOW",
    "SIGKILL", "SIGXCPU", "SIGHUP", "SIGALRM", "SIGUSR1", "SIGUSR2", "setitimer", "alarm", "pass_fds", "preexec_fn",
    "start_new_session", "clock_gettime", "pthread_kill", "wait4", "waitid",
}  # fmt: skip
"""Attributes of `os`, `signal` and `time`, and options of `subprocess`, that Windows lacks."""
EXAM = "evolution/_src/suite/exam.py"
GUARDED = {
    ("reconstruction/_src/base/cache.py", "getuid"),
    ("evolution/_src/backends/processes.py", "pass_fds"),
    *((EXAM, name) for name in ("killpg", "setsid", "SIGKILL")),
}
"""Behind hasattr, or a refusal of Windows."""


def find_posix(source: str) -> set[str]:
    """Return the modules and names in a source that Windows lacks."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Attribute):
            found |= {node.attr} & POSIX_NAMES
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names} & POSIX_MODULES
        elif isinstance(node, ast.ImportFrom):
            found |= {node.module or ""} & POSIX_MODULES
            found |= {alias.name for alias in node.names} & POSIX_NAMES
        elif isinstance(node, ast.keyword):
            found |= {node.arg or ""} & POSIX_NAMES
    return found


def test_nothing_is_used_that_windows_lacks() -> None:
    found = {
        (path.relative_to(ROOT).as_posix(), name)
        for path in FILES
        for name in find_posix(path.read_text(encoding="utf-8"))
    }
    assert not found - GUARDED


def test_the_search_for_posix_finds_it() -> None:
    source = "import fcntl\nos.fork()\nfrom signal import SIGKILL\nsubprocess.Popen(x, pass_fds=[1])\n"
    assert find_posix(source) == {"fcntl", "fork", "SIGKILL", "pass_fds"}


@pytest.mark.parametrize(
    ("platform", "variables", "expected"),
    [
        ("linux", {}, "egl"),
        ("linux", {"DISPLAY": ":0"}, None),
        ("linux", {"WAYLAND_DISPLAY": "wayland-0"}, None),
        ("linux", {"MUJOCO_GL": "osmesa"}, "osmesa"),
        ("linux", {"MUJOCO_GL": ""}, "egl"),
        ("darwin", {}, None),
        ("win32", {}, None),
    ],
)
def test_egl_is_for_linux_without_a_display(
    platform: str, variables: dict[str, str], expected: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setattr(os, "environ", dict(variables))
    headless.prefer_egl()
    assert os.environ.get("MUJOCO_GL") == expected


def test_only_the_package_selects_opengl() -> None:
    for name in ("Makefile", ".ci/run"):
        assert "MUJOCO_GL" not in (ROOT / name).read_text()


def test_a_window_that_needs_another_interpreter_is_left_out(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """On macOS `launch_passive` wants `mjpython`."""

    def refuse(*arguments: object, **options: object) -> None:
        raise RuntimeError("`launch_passive` requires mjpython on macOS")

    monkeypatch.setattr(sys, "platform", "darwin")
    monkeypatch.setattr(mujoco.viewer, "launch_passive", refuse)
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    pictures = SceneRenderer(model, mujoco.MjData(model), 64, 48, 1.0, 0.0)
    pictures.follow(np.zeros((1, 3)))
    assert pictures.render("human") is pictures.render("human") is None
    assert caplog.text.count("mjpython") == 1
    pictures.close()


def test_processes_are_refused_on_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "win32")
    with pytest.raises(RunError, match="'batch' gives equal results"):
        make_backend("processes", 2)


def test_a_file_is_flushed_and_replaced_as_windows_needs_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A descriptor must be writable to be flushed, and a file that somebody reads is replaced a little later."""
    path, replace, attempts = tmp_path / "a.txt", os.replace, []
    path.write_text("old")

    def refuse_twice(source: Path, target: Path) -> None:
        attempts.append(target)
        if len(attempts) < 3:
            raise PermissionError(errno.EACCES, "Access is denied", str(source))
        replace(source, target)

    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(os, "replace", refuse_twice)
    monkeypatch.setattr(os, "fsync", lambda descriptor: os.write(descriptor, b""))
    with write_atomically(path) as beside:
        beside.write_text("new")
    assert (path.read_text(), len(attempts)) == ("new", 3)


def test_elsewhere_a_refused_rename_is_refused_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    attempts = []

    def refuse(source: Path, target: Path) -> None:
        attempts.append(target)
        raise PermissionError(errno.EACCES, "Permission denied", str(source))

    monkeypatch.setattr(sys, "platform", "darwin")
    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(PermissionError), write_atomically(tmp_path / "a.txt") as beside:
        beside.write_text("new")
    assert len(attempts) == 1
    assert list(tmp_path.iterdir()) == []


def test_a_drive_that_does_not_exist_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "exists", lambda self: False)
    monkeypatch.setattr(Path, "is_dir", lambda self: False)
    with pytest.raises(UsageError, match="cannot be written"):
        require_writable_folder(Path("/z/runs/a"), "--out")


def test_a_pipe_that_nobody_reads_is_no_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    invalid = OSError(errno.EINVAL, "Invalid argument")
    assert is_unread(BrokenPipeError())
    assert not is_unread(invalid)
    monkeypatch.setattr(sys, "platform", "win32")  # where a closed pipe is an invalid argument
    assert is_unread(invalid)
    assert not is_unread(OSError(errno.ENOSPC, "No space left"))


def test_the_machine_has_a_name_without_proc(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(path: Path, *arguments: object, **options: object) -> str:
        raise FileNotFoundError(path)

    monkeypatch.setattr(Path, "read_text", refuse)
    monkeypatch.setattr("platform.machine", lambda: "arm64")
    assert describe_machine().startswith("arm64, ")
