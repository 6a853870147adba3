"""Damage that tests do to files, and headers that lie."""

import io
import zipfile
from collections.abc import Iterator

import numpy as np
from hypothesis import strategies as st


def flip_bits(content: bytes, number: int) -> Iterator[bytes]:
    """Yield copies with one flipped bit each: half spread evenly, half in the directory at an archive's end."""
    last, directory = 8 * len(content) - 1, 8 * max(len(content) - 300, 0)
    spread = np.linspace(0, last, number // 2, dtype=int)
    for bit in (*spread, *np.linspace(directory, last, number - number // 2, dtype=int)):
        damaged = bytearray(content)
        damaged[bit // 8] ^= 1 << (bit % 8)
        yield bytes(damaged)


def make_npy(shape: tuple[int, ...], descr: str, body: bytes) -> bytes:
    """Make an .npy whose header says what it likes."""
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(file, {"descr": descr, "fortran_order": False, "shape": shape})
    return file.getvalue() + body


def make_npz(method: int = zipfile.ZIP_DEFLATED, **members: bytes) -> bytes:
    """Make an .npz of members that need not be arrays."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", method) as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return file.getvalue()


def draw_damaged(data: st.DataObject, content: bytes) -> bytes:
    """Draw a copy with some other bytes, and cut somewhere."""
    damaged = bytearray(content)
    for _ in range(data.draw(st.integers(1, 6))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    return bytes(damaged[: data.draw(st.integers(0, len(damaged)))])
