"""The file of a reconstruction: plain arrays and a header in JSON, no pickle."""

import dataclasses
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from reconstruction._src.base.atomic_write import write_atomically
from reconstruction._src.base.bounded_read import read_npz
from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.knowledge.slip.drags import read_slip_arrays
from reconstruction._src.methods import find_method, make_config
from reconstruction._src.scans.cloud import Cloud

if TYPE_CHECKING:
    from reconstruction._src.methods import State

FORMAT = "symbrion reconstruction"
VERSION = 1


def write_saved(path: Path, saved: Any) -> None:
    """Write a `Reconstruction`, atomically."""
    header = {
        "format": FORMAT,
        "version": VERSION,
        "method": saved.method,
        "config": dataclasses.asdict(saved.config),
        "notes": saved.notes,
    }
    arrays = {f"state_{name}": np.asarray(value) for name, value in saved.state._asdict().items()}
    arrays |= _list_arrays(saved.cloud)
    if saved.readings is not saved.cloud:
        arrays |= {f"readings_{name}": array for name, array in _list_arrays(saved.readings).items()}
    if saved.slip is not None:
        arrays |= {f"slip_{name}": array for name, array in saved.slip._asdict().items()}
    with write_atomically(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, header=np.array(json.dumps(header)), **arrays)  # pyright: ignore[reportArgumentType]


def read_saved(path: str | os.PathLike[str], max_bytes: float) -> dict[str, Any]:
    """Read what `write_saved` wrote, as arguments of `Reconstruction`."""
    try:
        arrays = read_npz(path, max_bytes=max_bytes)
        header = json.loads(str(arrays.pop("header")))
        is_known = header["format"] == FORMAT and header["version"] <= VERSION
    except Exception as error:  # a file from outside can be wrong in any way
        raise ReconstructionError(f"{path} is not a saved reconstruction: {error}") from error
    if not is_known:
        raise ReconstructionError(
            f"{path} is {header['format']!r} of version {header['version']}; "
            f"this program reads {FORMAT!r} up to version {VERSION}"
        )
    try:
        network, config_type = find_method(header["method"])
        header["config"].pop("insertion", None)  # older files name the rule of the growing grid
        config = make_config(config_type, header["config"])
        state = network.State(**{name: arrays[f"state_{name}"] for name in network.State._fields})
        _check_state(state)
        return {
            "method": header["method"],
            "config": config,
            "state": state,
            "cloud": _make_cloud(arrays, ""),
            "readings": _make_cloud(arrays, "readings_") if "readings_points" in arrays else None,
            "notes": dict(header.get("notes", {})),
            "slip": read_slip_arrays(arrays),
        }
    except ReconstructionError as error:
        raise ReconstructionError(f"{path}: {error}") from error
    except Exception as error:
        raise ReconstructionError(
            f"{path} is no complete reconstruction ({error!r}); was it written by another version?"
        ) from error


def _list_arrays(cloud: Cloud) -> dict[str, np.ndarray]:
    """Return the arrays of a cloud by name, without those that say nothing."""
    named = {
        "points": cloud.points,
        "colors": cloud.colors,
        "viewpoints": cloud.viewpoints,
        "seen_from": cloud.seen_from,
        "offset": cloud.offset if cloud.offset.any() else None,
    }
    return {name: array for name, array in named.items() if array is not None}


def _make_cloud(arrays: dict[str, np.ndarray], prefix: str) -> Cloud:
    _check_positions("points", arrays[f"{prefix}points"])
    return Cloud(
        arrays[f"{prefix}points"],
        colors=arrays.get(f"{prefix}colors"),
        viewpoints=arrays.get(f"{prefix}viewpoints"),
        seen_from=arrays.get(f"{prefix}seen_from"),
        offset=arrays.get(f"{prefix}offset", np.zeros(3)),
    )


def _check_state(state: "State") -> None:
    """Refuse arrays of a file that no network leaves behind."""
    _check_positions("units", state.units)
    faces, count = np.asarray(state.faces), state.units.size // 3
    if not len(faces) or faces.dtype.kind not in "iu" or faces.min() < 0 or faces.max() >= count:
        raise ReconstructionError(f"faces must name units, 0 to {count - 1}; restore the file from a copy")


def _check_positions(name: str, array: np.ndarray) -> None:
    is_right = array.dtype.kind == "f" and array.ndim > 1 and array.shape[-1] == 3
    if not is_right or not np.isfinite(array).all():
        raise ReconstructionError(f"{name} must be finite numbers [..., 3]; restore the file from a copy")
