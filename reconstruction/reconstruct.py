"""From points to a surface by one call, and the surface as a network that learns on."""

from __future__ import annotations

import dataclasses
import importlib
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, cast

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import ArrayLike

from reconstruction.errors import ReconstructionError
from reconstruction.files.atomic_write import write_atomically
from reconstruction.files.bounded_read import MAX_BYTES, read_npz
from reconstruction.networks.change.input_checks import check_origins, check_scale
from reconstruction.networks.som.compilation import keep_compiled_programs
from reconstruction.progress import Progress, silent
from reconstruction.scans.point_check import check_number, check_points
from reconstruction.scans.scan import ScanLog

if TYPE_CHECKING:
    import trimesh

    from reconstruction.networks.change.refinement import Learner
    from reconstruction.networks.growing_grid import growing_grid
    from reconstruction.networks.gsrm import gsrm
    from reconstruction.surfaces.quality import Quality

    NetworkConfig: TypeAlias = gsrm.GSRMConfig | growing_grid.GrowingGridConfig
    State: TypeAlias = gsrm.State | growing_grid.State

FORMAT = "symbrion reconstruction"
VERSION = 1
METHODS = {
    "gsrm": ("reconstruction.networks.gsrm.gsrm", "GSRMConfig"),
    "gg": ("reconstruction.networks.growing_grid.growing_grid", "GrowingGridConfig"),
}
"""Method -> the module of its network, which is loaded at first use, and the name of its configuration."""


class Network(Protocol):
    """What the module of a network offers."""

    @property
    def State(self) -> type[State]:
        """The network as plain arrays."""
        ...

    def train(
        self, points: Float[np.ndarray, "N 3"], config: NetworkConfig, seed: int, progress: Progress
    ) -> State:
        """Return a network that has grown over the points."""
        ...


def reconstruct(
    points: ArrayLike,
    method: str = "gsrm",
    units: int = 2200,
    seed: int = 0,
    mode: str = "batch",
    progress: Progress = silent,
    viewpoint: ArrayLike | None = None,
    **options: object,
) -> Reconstruction:
    """Grow a self-organizing network over a point cloud and return its surface.

    Args:
        points: `[N, 3]` positions [m], any real number type; 20 for each unit are a good number.
        method: "gsrm" (growing self-reconstruction map: any topology) or "gg" (growing grid: one sheet).
        units: number of neurons, the resolution.
        seed: equal seeds give equal meshes, byte for byte.
        mode: "batch" (fast) or "paper" (the literal sequential rules, slow).
        progress: called with each step and the fraction done.
        viewpoint: `[3]` or `[K, 3]` positions of the scanner; the normals point there. Without it they point up,
            or outwards on closed surfaces.
        options: further fields of `GSRMConfig` or `GrowingGridConfig`, such as `triangles=13860` for "gg".

    Raises:
        ReconstructionError: the points hold no surface, or an argument is out of its range.
    """
    cloud = check_points(points)
    network, config_type = _find_method(method)
    selected = options if mode == "batch" else {"mode": mode, **options}
    config = _make_config(config_type, {"units": units, **selected})
    check_number(cloud, getattr(config, "wanted_units", config.units))
    seed, seen_from = _check_seed(seed), _check_viewpoint(viewpoint)
    keep_compiled_programs()
    state = network.train(cloud, config, seed, progress)
    return Reconstruction(method, config, state, cloud, seen_from)


class Reconstruction:
    """A network that has learned a surface: its mesh, its quality, and all that it needs to learn on.

    Attributes:
        method: "gsrm" or "gg".
        config: the network's configuration.
        state: the network itself, plain arrays.
        points: `[N, 3]` the cloud that it was grown over [m].
        viewpoint: `[3]` or `[K, 3]` positions of the scanner [m], or None.
        mesh: the surface; consistently wound, normals up, outwards or towards the scanner.
    """

    def __init__(
        self,
        method: str,
        config: NetworkConfig,
        state: State,
        points: Float[np.ndarray, "N 3"],
        viewpoint: Float[np.ndarray, "*K 3"] | None,
    ):
        """Wrap a network; `reconstruct` and `load` are the ways to get one."""
        self.method = method
        self.config = config
        self.state = state
        self.points = points
        self.viewpoint = viewpoint
        self.mesh = _make_mesh(state.units.reshape(-1, 3), state.faces, viewpoint)

    def quality(self, truth: trimesh.Trimesh | None = None) -> Quality:
        """Measure the mesh against its cloud, and against the true surface where it is known."""
        from reconstruction.surfaces.quality import measure_quality

        return measure_quality(self.mesh, self.points, truth)

    def refine(
        self,
        new_points: ArrayLike | ScanLog,
        seed: int = 0,
        progress: Progress = silent,
        *,
        origins: ArrayLike | None = None,
    ) -> Reconstruction:
        """Return the same network after it has learned from new readings; this one stays as it is.

        Moved parts move, new parts grow, parts that are no longer there are removed; the rest stays.

        Args:
            new_points: `[N, 3]` readings made since [m], in the frame and unit of the first; or a scan log, which
                is levelled, filtered and smoothed, and knows its origins itself.
            seed: seed of the order of the signals.
            progress: called with each step and the fraction done.
            origins: `[N, 3]` sensor position of each reading, or `[3]` one for all [m]: surface that their rays pass
                through is removed. Without them a part is removed where it is not read again but all around it is.

        Raises:
            ReconstructionError: the points or origins are no points, or in another unit.
        """
        if isinstance(new_points, ScanLog):
            if origins is not None:
                raise ReconstructionError("a scan log holds its own origins; leave out origins")
            from reconstruction.scans.rays import read_rays

            new_points, origins = read_rays(new_points)
        cloud = check_points(new_points)
        check_scale(cloud, self.points)
        seen_from = None if origins is None else check_origins(origins, len(cloud))
        seed = _check_seed(seed)
        keep_compiled_programs()
        from reconstruction.networks.change.refinement import refine

        learner = _find_learner(self.method)(self.state, self.config)
        state, points = refine(learner, self.points, cloud, seed, progress, seen_from)
        return Reconstruction(self.method, self.config, state, points, self.viewpoint)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the network as plain arrays (.npz, no pickle), atomically.

        Raises:
            OSError: the file cannot be written.
        """
        path = Path(path)
        header = {
            "format": FORMAT,
            "version": VERSION,
            "method": self.method,
            "config": dataclasses.asdict(self.config),
        }
        arrays = {f"state_{name}": np.asarray(value) for name, value in self.state._asdict().items()}
        arrays["points"] = self.points
        if self.viewpoint is not None:
            arrays["viewpoint"] = self.viewpoint
        with write_atomically(path) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, header=np.array(json.dumps(header)), **arrays)  # pyright: ignore[reportArgumentType]

    @classmethod
    def load(cls, path: str | os.PathLike[str], max_bytes: float = MAX_BYTES) -> Reconstruction:
        """Read a file that `save` wrote.

        Args:
            path: .npz.
            max_bytes: the most that the file may hold once unpacked.

        Raises:
            ReconstructionError: missing, damaged, not such a file, or of a newer version.
        """
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
            network, config_type = _find_method(header["method"])
            config = _make_config(config_type, header["config"])
            state = network.State(**{name: arrays[f"state_{name}"] for name in network.State._fields})
            _check_saved(state, arrays["points"])
            return cls(header["method"], config, state, arrays["points"], arrays.get("viewpoint"))
        except ReconstructionError as error:
            raise ReconstructionError(f"{path}: {error}") from error
        except Exception as error:
            raise ReconstructionError(
                f"{path} is no complete reconstruction ({error!r}); was it written by another version?"
            ) from error


def _check_saved(state: State, points: np.ndarray) -> None:
    """Refuse arrays of a file that no network leaves behind.

    Raises:
        ReconstructionError: naming the array.
    """
    for name, array in (("points", points), ("units", state.units)):
        is_right = array.dtype.kind == "f" and array.ndim > 1 and array.shape[-1] == 3
        if not is_right or not np.isfinite(array).all():
            raise ReconstructionError(f"{name} must be finite numbers [..., 3]; restore the file from a copy")
    faces, count = np.asarray(state.faces), state.units.size // 3
    if not len(faces) or faces.dtype.kind not in "iu" or faces.min() < 0 or faces.max() >= count:
        raise ReconstructionError(f"faces must name units, 0 to {count - 1}; restore the file from a copy")


def _find_method(method: str) -> tuple[Network, type[NetworkConfig]]:
    """Return the network and the configuration of a method.

    Raises:
        ReconstructionError: there is no such method.
    """
    if method not in METHODS:
        raise ReconstructionError(f"method must be one of {', '.join(map(repr, METHODS))}, got {method!r}")
    module, config = METHODS[method]
    network = importlib.import_module(module)
    return cast("Network", network), getattr(network, config)


def _find_learner(method: str) -> Callable[[State, NetworkConfig], Learner[State, Any]]:
    """Return the class that lets a network of this method learn from new readings."""
    folder = METHODS[method][0].rpartition(".")[0]
    return importlib.import_module(f"{folder}.refinement").Learner


def _make_config(config_type: type[NetworkConfig], values: dict[str, object]) -> NetworkConfig:
    """Return the configuration, with lists from JSON as tuples; refuse names that it does not have."""
    known = {field.name for field in dataclasses.fields(config_type)}
    unknown = sorted(set(values) - known)
    if unknown:
        raise ReconstructionError(
            f"unknown option {', '.join(unknown)}; there are {', '.join(sorted(known))}"
        )
    units = values.get("units")
    if isinstance(units, bool) or not isinstance(units, int | np.integer):
        raise ReconstructionError(f"units must be a whole number, got {units!r}")
    return _restore(config_type(), values)


def _restore(default: Any, values: dict[str, Any]) -> Any:
    """Return a configuration with the values that JSON holds, those absent as in the default."""
    restored = {}
    for name, value in values.items():
        if isinstance(value, dict):
            restored[name] = _restore(getattr(default, name), value)
        else:
            restored[name] = _freeze(value)
    return dataclasses.replace(default, **restored)


def _freeze(value: Any) -> Any:
    return tuple(map(_freeze, value)) if isinstance(value, list) else value


def _check_seed(seed: int) -> int:
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise ReconstructionError(f"seed must be a whole number from 0 on, got {seed!r}")
    return int(seed)


def _check_viewpoint(viewpoint: ArrayLike | None) -> Float[np.ndarray, "*K 3"] | None:
    if viewpoint is None:
        return None
    array = np.asarray(viewpoint, dtype=np.float64)
    if array.shape[-1:] != (3,) or array.ndim > 2 or not np.isfinite(array).all():
        raise ReconstructionError(
            f"viewpoint must be one or more finite positions x, y, z, got {viewpoint!r}"
        )
    return array


def _make_mesh(
    units: Float[np.ndarray, "U 3"],
    faces: Int[np.ndarray, "F 3"],
    viewpoint: Float[np.ndarray, "*K 3"] | None,
) -> trimesh.Trimesh:
    """Return the oriented mesh of the units that have a face."""
    import trimesh

    from reconstruction.geometry.orientation import orient_outwards

    used, flat = np.unique(faces, return_inverse=True)
    vertices, faces = units[used], flat.reshape(-1, 3)
    return trimesh.Trimesh(vertices, orient_outwards(vertices, faces, viewpoint), process=False)
