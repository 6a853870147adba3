"""Reading files from outside within a limit: no file unpacks to more, and every header is checked.

`open_bounded` opens a plain, gzip or bzip2 file; `read_npz` reads NumPy's archives. Both find out what a file
holds before anything of its size is allocated, and both raise one error, `UnreadableFileError`, for
everything that can be wrong: zlib, zipfile, NumPy and the file system each raise their own.
"""

import bz2
import gzip
import math
import os
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from functools import cached_property
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from reconstruction._src.base.errors import ReconstructionPackageError, ScanError

MAX_BYTES = 2_000_000_000
"""Most bytes that a file may hold once unpacked, and its points once read. A point takes 24, so this is room for
83 million points; a scan of 100 million needs `max_bytes=3e9`. Reading takes about three times as much memory."""
PACKINGS = (".gz", ".bz2")
_CHUNK = 1 << 20  # Bytes unpacked at once
_NPY_HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
_NPZ_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""What NumPy writes; the others unpack a small block into gigabytes at once."""
_ZIP_END = 22  # Bytes of a zip archive's last record, before its comment


class UnreadableFileError(ReconstructionPackageError, ValueError):
    """A file is missing, damaged, of another size than it says, or larger than allowed; the message says which."""


class DamagedError(UnreadableFileError):
    """A file holds something else than it promises."""

    def __str__(self) -> str:
        return f"{super().__str__()}; it is damaged or cut short: copy or export it again"


class BoundedFile:
    """A binary file, unpacked on the way, whose size is known and within the limit.

    Attributes:
        stream: stream of the unpacked bytes.
        suffix: lower case, without that of the packing.
        max_bytes: the limit.
        size: bytes in the stream.
    """

    def __init__(self, stream: BinaryIO, suffix: str, is_packed: bool, max_bytes: float):
        """Measure a stream: a packed one by unpacking it once, piece by piece."""
        self.stream, self.suffix, self.max_bytes = stream, suffix, max_bytes
        if is_packed:
            self.size, self.num_lines = self._measure()
        else:
            self.size = os.fstat(stream.fileno()).st_size
        check_size(self.size, max_bytes)

    @cached_property
    def num_lines(self) -> int:
        """Number of lines, or a little more."""
        return self._measure()[1]

    @property
    def num_left(self) -> int:
        """Bytes that are still to come."""
        return self.size - self.stream.tell()

    def read_exactly(self, num_bytes: int) -> bytes:
        """Return the next bytes."""
        if not 0 <= num_bytes <= self.num_left:
            raise DamagedError(f"{num_bytes} bytes are promised where {self.num_left} are left")
        data = self.stream.read(num_bytes)
        if len(data) != num_bytes:
            raise UnreadableFileError("the file has changed while it was read")
        return data

    def _measure(self) -> tuple[int, int]:
        """Return bytes and lines of the whole stream, up to the limit."""
        position, size, num_lines = self.stream.tell(), 0, 1
        self.stream.seek(0)
        while chunk := self.stream.read(_CHUNK):
            size += len(chunk)
            check_size(size, self.max_bytes)
            num_lines += chunk.count(b"\n") + chunk.count(b"\r") - chunk.count(b"\r\n")
        self.stream.seek(position)
        return size, num_lines


def check_size(num_bytes: float, max_bytes: float) -> None:
    """Refuse what is larger than the limit."""
    if not max_bytes > 0:
        raise UnreadableFileError(f"max_bytes must be above 0, got {max_bytes!r}")
    if num_bytes > max_bytes:
        raise UnreadableFileError(
            f"takes more than the limit of {max_bytes / 1e9:g} GB once unpacked; if that is right, raise it by "
            "max_bytes= (symbrion reconstruct: --max-gigabytes)"
        )


def find_kind(path: Path) -> str:
    """Return the ending that says what a file holds, in lower case: that before .gz or .bz2."""
    return (path.with_suffix("") if path.suffix.lower() in PACKINGS else path).suffix.lower()


@contextmanager
def open_bounded(path: str | os.PathLike[str], max_bytes: float = MAX_BYTES) -> Iterator[BoundedFile]:
    """Open a file whose last suffix may be .gz or .bz2, and close it at the end."""
    path = Path(path)
    packing = path.suffix.lower() if path.suffix.lower() in PACKINGS else ""
    with ExitStack() as stack:
        with _one_error():
            plain = stack.enter_context(path.open("rb"))
            if not os.fstat(plain.fileno()).st_size:
                raise UnreadableFileError("is empty")
            stream = stack.enter_context(_unpack(plain, packing))
            file = BoundedFile(stream, find_kind(path), bool(packing), max_bytes)
            if not file.size:
                raise UnreadableFileError("is empty once unpacked")
        yield file


def read_npz(
    source: str | os.PathLike[str] | BinaryIO,
    names: Iterable[str] | None = None,
    max_bytes: float = MAX_BYTES,
) -> dict[str, NDArray]:
    """Read arrays of an .npz; none may hold Python objects."""
    with _one_error(), zipfile.ZipFile(source) as archive:
        members = _find_members(archive)
        names = list(members if names is None else names)
        missing = [name for name in names if name not in members]
        if missing:
            raise UnreadableFileError(
                f"lacks {', '.join(missing)}; it holds {', '.join(members) or 'nothing'}"
            )
        check_size(sum(members[name].file_size for name in names), max_bytes)
        return {name: _read_member(archive, members[name]) for name in names}


def find_npz_names(source: str | os.PathLike[str] | BinaryIO) -> list[str]:
    """Return the names of the arrays in an .npz."""
    with _one_error(), zipfile.ZipFile(source) as archive:
        return list(_find_members(archive))


def read_array(stream: BinaryIO, num_left: int) -> NDArray:
    """Read one array in the form of .npy."""
    start = stream.tell()
    version = np.lib.format.read_magic(stream)
    if version not in _NPY_HEADERS:
        raise UnreadableFileError(f".npy version {version} is not read; name the fields in ASCII")
    shape, is_fortran, dtype = _NPY_HEADERS[version](stream)
    if dtype.hasobject:
        raise UnreadableFileError("holds Python objects, which are not read; save plain numbers")
    size, num_left = math.prod(shape) * dtype.itemsize, num_left - (stream.tell() - start)
    if min(shape, default=0) < 0 or size > num_left or (0 not in shape and not dtype.itemsize):
        raise DamagedError(f"promises {dtype} of shape {shape}, but {num_left} bytes follow")
    data = np.empty(size, dtype=np.uint8)
    at = 0
    while at < size:
        num_read = stream.readinto(data[at : at + _CHUNK])  # type: ignore[attr-defined]
        if not num_read:
            raise DamagedError("ends in the middle of an array")
        at += num_read
    return data.view(dtype).reshape(shape, order="F" if is_fortran else "C")


def _find_members(archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """Return the arrays of an archive; refuse one whose directory is incomplete, as arrays would be missing."""
    found = archive.infolist()
    assert archive.fp is not None
    archive.fp.seek(-_ZIP_END - len(archive.comment), os.SEEK_END)
    count = int.from_bytes(archive.fp.read(_ZIP_END)[10:12], "little")  # zipfile does not compare it
    if count != min(len(found), 0xFFFF):
        raise UnreadableFileError(f"counts {count} arrays, but names {len(found)}")
    odd = [info.filename for info in found if not info.filename.endswith(".npy")]
    if odd:
        raise UnreadableFileError(f"holds {', '.join(odd)}, which is no .npy")
    return {info.filename.removesuffix(".npy"): info for info in found}


def _read_member(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> NDArray:
    if info.compress_type not in _NPZ_METHODS:
        raise UnreadableFileError(f"{info.filename} is packed in another way than .npz files are")
    with archive.open(info) as stream:
        array = read_array(stream, info.file_size)  # type: ignore[arg-type]
        if stream.read(1):  # at the end the checksum is compared
            raise UnreadableFileError(f"{info.filename} goes on after its array")
    return array


def _unpack(plain: BinaryIO, packing: str) -> BinaryIO:
    if packing == ".gz":
        return gzip.GzipFile(fileobj=plain)  # type: ignore[return-value]
    return bz2.BZ2File(plain) if packing else plain  # type: ignore[return-value]


@contextmanager
def name_file(path: str | os.PathLike[str]) -> Iterator[None]:
    """Raise a `ScanError` that names the file for what is wrong with its content."""
    try:
        yield
    except (ScanError, UnreadableFileError) as error:
        raise ScanError(f"{path}: {error}") from error


@contextmanager
def _one_error() -> Iterator[None]:
    """Raise `UnreadableFileError` for whatever goes wrong inside."""
    try:
        yield
    except UnreadableFileError:
        raise
    except FileNotFoundError as error:
        raise UnreadableFileError("there is no such file") from error
    except IsADirectoryError as error:
        raise UnreadableFileError("is a folder, not a file") from error
    except OSError as error:
        raise UnreadableFileError(f"cannot be read: {error}") from error
    except Exception as error:  # damaged bytes make the libraries raise every kind of error
        raise UnreadableFileError(f"is damaged: {error or type(error).__name__}") from error
