"""Encode the frames of a recording as a video."""

import tempfile
import warnings
from collections.abc import Sequence
from pathlib import Path

import imageio.v2 as imageio
import numpy as np
from jaxtyping import UInt8


def encode_video(frames: Sequence[UInt8[np.ndarray, "H W 3"]], fps: int = 25) -> bytes:
    """Encode frames as H.264 in MP4, which every browser plays."""
    if len(frames) == 0:
        raise ValueError("no frame to encode; film at least one")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        # The encoder is another process; JAX warns of every fork, though this one executes another program.
        with warnings.catch_warnings(action="ignore", category=RuntimeWarning), imageio.get_writer(
            path, fps=fps, codec="libx264", quality=None, macro_block_size=2,
            output_params=["-crf", "27", "-preset", "veryfast", "-movflags", "+faststart"],
        ) as writer:  # fmt: skip
            for frame in frames:
                writer.append_data(frame)
        return path.read_bytes()
