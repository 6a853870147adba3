"""Reading a scan log from a file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from reconstruction._src.base.bounded_read import MAX_BYTES, UnreadableFileError, read_npz
from reconstruction._src.base.errors import ScanError
from reconstruction._src.scans.scan import HorizontalScans, ScanLog, ScanTruth
from reconstruction._src.scans.scan_3dtk import load_3dtk
from reconstruction._src.scans.slip_readings import SlipReadings


def load_scan_log(path: str | os.PathLike[str], max_bytes: float = MAX_BYTES) -> ScanLog:
    """Read a log written by `ScanLog.save`, or a raw one in the form of 3DTK (`scan000.3d` with `scan000.pose`).

    Args:
        path: .npz or .3d.
        max_bytes: most bytes that the file may hold once unpacked.

    Raises:
        ScanError: naming the file and the reason.
    """
    path = Path(path)
    if path.suffix == ".3d":
        return load_3dtk(path, max_bytes=max_bytes)
    try:
        arrays = read_npz(path, max_bytes=max_bytes)
    except UnreadableFileError as error:
        raise ScanError(f"{path}: {error}") from error
    try:
        horizontal, truth = _find_part(arrays, "horizontal"), _find_part(arrays, "truth")
        slip = _find_part(arrays, "slip")
        names, values = arrays["report_names"].tolist(), arrays["report_values"].tolist()
        return ScanLog(
            arrays["ranges"],
            arrays["angles"],
            arrays["poses"],
            arrays["mount"],
            arrays.get("box"),
            horizontal=HorizontalScans(**horizontal) if horizontal else None,
            truth=ScanTruth(**truth) if truth else None,
            report=dict(zip(names, values, strict=True)),
            colors=arrays.get("colors"),
            slip=SlipReadings(**slip) if slip else None,  # pyright: ignore[reportArgumentType]
        )
    except (KeyError, TypeError, ValueError) as error:
        raise ScanError(f"{path}: not a scan log: {error}") from error


def _find_part(arrays: Mapping[str, np.ndarray], part: str) -> dict[str, np.ndarray]:
    """Return the arrays whose names begin with that of the part and a dot, without it."""
    prefix = f"{part}."
    return {name.removeprefix(prefix): array for name, array in arrays.items() if name.startswith(prefix)}
