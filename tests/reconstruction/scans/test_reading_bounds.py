"""Small packed files that would take hours or many gigabytes are refused, or read a piece at a time."""

import gzip
import subprocess
import sys
from pathlib import Path

import pytest

from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.cloud_file import load_points

MEGABYTE = 1 << 20
PLY = "ply\nformat binary_little_endian 1.0\n{}element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
VTK = "# vtk DataFile Version 3.0\ntitle\nASCII\n"


@pytest.mark.parametrize(
    ("name", "start", "line"),
    [
        ("a.ply", PLY.format(""), "element a 0\n"),
        ("a.pcd", "# .PCD v0.7\n", "{:x} 0\n"),
    ],
)
def test_a_header_has_an_end(tmp_path: Path, name: str, start: str, line: str) -> None:
    path = tmp_path / f"{name}.gz"
    many = "".join(line.format(index) for index in range(2 * MEGABYTE // len(line)))
    path.write_bytes(gzip.compress((start + many).encode(), 1))
    with pytest.raises(ScanError, match=r"header is longer than 1048576 bytes"):
        load_points(path)


def test_rows_with_lists_are_not_read_for_hours(tmp_path: Path) -> None:
    count = 10**17
    grid = f"element range_grid {count}\nproperty list uchar int vertex_indices\n"
    path = tmp_path / "a.ply.gz"
    path.write_bytes(gzip.compress((PLY.format(grid) + "end_header\n").encode(), 1))
    with pytest.raises(ScanError, match=rf"{count} values in rows with lists.*write the vertices first"):
        load_points(path)


PROGRAM = """
import sys
from reconstruction._src.scans.cloud_file import load_points

def peak():  # getrusage would begin with the peak of the process that started this one
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("VmHWM")) / 1024

for path in sys.argv[1:]:
    before = peak()
    assert len(load_points(path)) == 100, path
    assert peak() - before < 120, (path, peak() - before)
"""


def test_long_lines_are_read_a_few_at_a_time(tmp_path: Path) -> None:
    """100 lines of a megabyte each take four megabytes each in memory, once they hold an emoji."""
    row = f"1 2 3 # \N{GRINNING FACE}{'a' * (MEGABYTE - 100)}\n".encode() * 100
    numbers = (f"{'12 ' * 300}" + " " * (MEGABYTE - 1000) + "\n").encode() * 100
    contents = {
        "a.xyz.gz": row,
        "a.vtk.gz": f"{VTK}POINTS 100 float\n".encode() + b"9 " * 300 + b"\n" + numbers,
    }
    for name, content in contents.items():
        (tmp_path / name).write_bytes(gzip.compress(content, 1))
    paths = [str(tmp_path / name) for name in contents]
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *paths], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
