"""Files unpack to no more than is allowed, headers that lie are refused, and damage has one error."""

import bz2
import gzip
import io
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from damage import flip_bits, make_npy, make_npz

from reconstruction._src.base.bounded_read import UnreadableFileError, find_npz_names, open_bounded, read_npz
from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.cloud_file import load_points

ARRAYS = {
    "grid": np.arange(12.0).reshape(3, 4),
    "turned": np.asfortranarray(np.arange(6, dtype=">i2").reshape(2, 3)),
    "words": np.array(["one", "three"]),
    "single": np.array(7),
    "nothing": np.zeros((0, 3)),
    "rows": np.array([(1, 2.5)], dtype=[("a", "<i4"), ("b", "<f8")]),
}
PACKINGS = {"": bytes, ".gz": gzip.compress, ".bz2": bz2.compress}
MEGABYTE = 1_000_000


def pack(**arrays: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


@pytest.mark.parametrize("packing", PACKINGS)
def test_a_file_is_measured_and_read(tmp_path: Path, packing: str) -> None:
    path = tmp_path / f"a.TXT{packing}"
    path.write_bytes(PACKINGS[packing](b"one\ntwo\r\nthree\rfour"))
    with open_bounded(path) as file:
        assert (file.suffix, file.size, file.num_lines) == (".txt", 19, 4)
        assert file.read_exactly(3) == b"one"
        assert file.num_left == 16
        with pytest.raises(UnreadableFileError, match="17 bytes are promised where 16 are left"):
            file.read_exactly(17)


@pytest.mark.parametrize("packing", PACKINGS)
def test_the_limit_is_the_last_byte(tmp_path: Path, packing: str) -> None:
    path = tmp_path / f"a.txt{packing}"
    path.write_bytes(PACKINGS[packing](bytes(MEGABYTE)))
    with open_bounded(path, max_bytes=MEGABYTE) as file:
        assert file.size == MEGABYTE
    with pytest.raises(UnreadableFileError, match=r"limit of 0\.000999 GB.*max_bytes=.*--max-gigabytes"):  # noqa: SIM117
        with open_bounded(path, max_bytes=MEGABYTE - 1000):
            pass


def test_arrays_come_back_as_they_were() -> None:
    found = read_npz(io.BytesIO(pack(**ARRAYS)))
    assert list(found) == list(ARRAYS)
    for name, array in ARRAYS.items():
        assert found[name].dtype == array.dtype
        np.testing.assert_array_equal(found[name], array)
    assert find_npz_names(io.BytesIO(pack(**ARRAYS))) == list(ARRAYS)


def test_only_what_is_wanted_counts() -> None:
    content = pack(small=np.ones(3), large=np.zeros(MEGABYTE))
    assert list(read_npz(io.BytesIO(content), ["small"], max_bytes=1000)) == ["small"]
    with pytest.raises(UnreadableFileError, match="limit of 1e-06 GB"):
        read_npz(io.BytesIO(content), max_bytes=1000)
    with pytest.raises(UnreadableFileError, match="lacks middle; it holds small, large"):
        read_npz(io.BytesIO(content), ["middle"])


def understate_size(content: bytes) -> bytes:
    """Let the zip's directory say that the first member unpacks to 200 bytes."""
    at = content.rindex(b"PK\x01\x02")
    return content[: at + 24] + (200).to_bytes(4, "little") + content[at + 28 :]


BODY = bytes(64)
LIES = {
    "more than there is": make_npz(a=make_npy((10**6,), "<f8", BODY)),
    "more than there can be": make_npz(a=make_npy((10**9, 10**9, 10**9), "<f8", BODY)),
    "negative": make_npz(a=make_npy((-8,), "<f8", BODY)),
    "twice negative": make_npz(a=make_npy((-2, -4), "<f8", BODY)),
    "less than there is": make_npz(a=make_npy((7,), "<f8", BODY)),
    "rows of nothing": make_npz(a=make_npy((10**15,), "|V0", b"")),
    "a large item": make_npz(a=make_npy((1,), "|V2000000000", BODY)),
    "objects": make_npz(a=make_npy((8,), "|O", BODY)),
    "a deep header": make_npz(a=b"\x93NUMPY\x01\x00\x00\x20" + b"(" * 8192),
    "another version": make_npz(a=b"\x93NUMPY\x09\x00" + BODY),
    "packed by bzip2": make_npz(zipfile.ZIP_BZIP2, a=make_npy((8,), "<f8", BODY)),
    "understated size": understate_size(pack(a=np.zeros(MEGABYTE))),
    "a name that is no array's": make_npz(a=make_npy((8,), "<f8", BODY)).replace(b"a.npy", b"a.npx"),
    "no archive": b"PK\x03\x04" + bytes(200),
}


@pytest.mark.parametrize("name", LIES)
def test_archives_that_lie_are_refused(name: str) -> None:
    with pytest.raises(UnreadableFileError):
        read_npz(io.BytesIO(LIES[name]))


def test_absent_files_and_folders_are_refused(tmp_path: Path) -> None:
    for read in (read_npz, find_npz_names):
        with pytest.raises(UnreadableFileError, match="no such file"):
            read(tmp_path / "absent.npz")
        with pytest.raises(UnreadableFileError, match="folder"):
            read(tmp_path)


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_a_flipped_bit_gives_the_same_or_the_error(save) -> None:
    file = io.BytesIO()
    save(file, **ARRAYS)
    num_refused = 0
    for damaged in flip_bits(file.getvalue(), 800):
        try:
            found = read_npz(io.BytesIO(damaged), ARRAYS)
        except UnreadableFileError:
            num_refused += 1
            continue
        for name, array in ARRAYS.items():
            np.testing.assert_array_equal(found[name], array)
    assert num_refused > 300


PROGRAM = """
import sys
from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.cloud_file import load_points

def peak():  # getrusage would begin with the peak of the process that started this one
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) for line in file if line.startswith("VmHWM")) * 1024

limit, most, *paths = sys.argv[1:]
for path in paths:
    before = peak()
    try:
        assert len(load_points(path, max_bytes=float(limit))) == 100
    except ScanError as error:
        assert "limit of 0.03 GB" in str(error), error
    assert peak() - before < float(most), (path, peak() - before)
"""


def read_apart(folder: Path, contents: dict[str, bytes], limit: float, most: float) -> None:
    """Read files in a process of its own, which may take so many bytes of memory at the most."""
    for name, content in contents.items():
        (folder / name).write_bytes(content)
    words = [str(limit), str(most), *(str(folder / name) for name in contents)]
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *words], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_refusing_takes_little_memory(tmp_path: Path) -> None:
    """Files of some kilobytes that would take 60 MB and more, each refused within 20 MB."""
    zeros, rows = bytes(2_500_000 * 24), b"1 2 3\n"
    bombs = {
        "text.xyz.gz": gzip.compress(rows * 10_000_000, 1),
        "short_text.xyz.gz": gzip.compress(rows * 2_500_000, 1),  # fits, but its numbers do not
        "lines.txt.gz": gzip.compress(b"\n" * 5_000_000, 1),
        "array.npy.gz": gzip.compress(make_npy((2_500_000, 3), "<f8", zeros), 1),
        "array.npz": make_npz(points=make_npy((2_500_000, 3), "<f8", zeros)),
        "bytes.npz": make_npz(points=make_npy((2_500_000, 3), "|u1", zeros[:7_500_000])),
        "log.npz": make_npz(
            ranges=make_npy((1, 2_500_000), "<f2", zeros[:5_000_000]),
            angles=make_npy((2_500_000,), "<f2", zeros[:5_000_000]),
            poses=make_npy((1, 4, 4), "<f8", np.eye(4).tobytes()),
        ),
    }
    read_apart(tmp_path, bombs, 30e6, 20e6)


@pytest.mark.slow
def test_long_lines_are_read_a_few_at_a_time(tmp_path: Path) -> None:
    """100 lines of a megabyte each take four megabytes each in memory, once they hold an emoji."""
    row = f"1 2 3 # \N{GRINNING FACE}{'a' * 1_000_000}\n".encode() * 100
    numbers = (f"{'12 ' * 300}" + " " * 1_000_000 + "\n").encode() * 100
    head = b"# vtk DataFile Version 3.0\ntitle\nASCII\nPOINTS 100 float\n"
    contents = {"a.xyz.gz": gzip.compress(row, 1), "a.vtk.gz": gzip.compress(head + numbers, 1)}
    read_apart(tmp_path, contents, 2e9, 120e6)


PLY = "ply\nformat binary_little_endian 1.0\n{}element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "start", "line"),
    [("a.ply", PLY.format(""), "element a 0\n"), ("a.pcd", "# .PCD v0.7\n", "{:x} 0\n")],
)
def test_a_header_has_an_end(tmp_path: Path, name: str, start: str, line: str) -> None:
    path = tmp_path / f"{name}.gz"
    many = "".join(line.format(index) for index in range(2_200_000 // len(line)))
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
