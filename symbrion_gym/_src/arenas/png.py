"""Pictures as files, without a library for pictures: a plain writer, and MuJoCo's reader."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import UInt8

from symbrion_gym._src.errors import ArenaError

_MOST = 8192
"""Largest edge of a picture that is read [pixel]."""
_HEADER = struct.Struct(">II5B")
"""Of a PNG: width, height, bits, kind of color, compression, filter, interlacing."""
_HEADER_AT = 16
"""Where it stands."""
_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_LEVEL = 6
"""Of the compression."""


def to_png(image: UInt8[np.ndarray, "H W 3"]) -> bytes:
    """Return a picture as the bytes of a PNG."""
    height, width = image.shape[:2]
    rows = np.concatenate([np.zeros((height, 1), np.uint8), image.reshape(height, -1)], axis=1)
    parts = [
        (b"IHDR", _HEADER.pack(width, height, 8, 2, 0, 0, 0)),
        (b"IDAT", zlib.compress(rows.tobytes(), _LEVEL)),
    ]
    return _SIGNATURE + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        for name, data in [*parts, (b"IEND", b"")]
    )


def load_png(path: Path) -> UInt8[np.ndarray, "H W 3"]:
    """Read a picture, by MuJoCo's reader."""
    try:
        content = path.read_bytes()
        width, height, *_ = _HEADER.unpack_from(content, _HEADER_AT)
        if not content.startswith(_SIGNATURE) or not (0 < width <= _MOST and 0 < height <= _MOST):
            raise ValueError(f"no PNG of up to {_MOST} x {_MOST} pixels")
        spec = mujoco.MjSpec()
        spec.add_texture(name="t", type=mujoco.mjtTexture.mjTEXTURE_2D, nchannel=3, file="t.png")
        spec.assets = {"t.png": content}
        model = spec.compile()
        return np.array(model.tex_data, dtype=np.uint8).reshape(height, width, 3)
    except (OSError, ValueError, struct.error) as error:
        raise ArenaError(f"{path}: not a picture ({error}); build the arena again with make_arena") from error
