"""From points to a surface by one call, and the surface as a network that learns on."""

from __future__ import annotations

import logging
import os
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, Int, UInt8
from numpy.typing import ArrayLike

from reconstruction.errors import ReconstructionError
from reconstruction.files.bounded_read import MAX_BYTES
from reconstruction.input_cloud import align, join_clouds, make_cloud, make_cloud_of_rays
from reconstruction.methods import find_learner, find_method, make_config
from reconstruction.networks.change.input_checks import check_origins, check_scale
from reconstruction.networks.som.compilation import keep_compiled_programs
from reconstruction.progress import Progress, silent
from reconstruction.saved_file import Saved, read_saved, write_saved
from reconstruction.scans.cloud import Cloud
from reconstruction.scans.point_check import check_number, check_points
from reconstruction.scans.scan import ScanLog

if TYPE_CHECKING:
    import trimesh

    from reconstruction.methods import NetworkConfig, State
    from reconstruction.scans.dropped import Dropped
    from reconstruction.surfaces.far_faces import FarFaces
    from reconstruction.surfaces.far_updates import Sheet
    from reconstruction.surfaces.quality import Quality

logger = logging.getLogger(__name__)

DEFAULT_UNITS = 2200
"""Of the paper's mode: that of its experiments."""
_MOST_VOTES = 8192
"""Of the readings behind a refined surface, at most these vote for its sides where their viewpoints are guessed."""


def reconstruct(
    points: ArrayLike | Cloud,
    method: str = "gsrm",
    units: int | None = None,
    seed: int = 0,
    mode: str = "batch",
    progress: Progress = silent,
    viewpoint: ArrayLike | None = None,
    *,
    viewpoints: ArrayLike | None = None,
    seen_from: ArrayLike | None = None,
    colors: ArrayLike | None = None,
    readings: ArrayLike | Cloud | None = None,
    **options: object,
) -> Reconstruction:
    """Grow a self-organizing network over a point cloud and return its surface.

    A cloud far from the origin is recentered: the mesh and the points of the result are positions minus its
    `offset`, which are whole meters.

    Args:
        points: `[N, 3]` positions [m], any real number type, or a `Cloud` with its viewpoints and colors; 20 for each
            unit are a good number.
        method: "gsrm" (growing self-reconstruction map: any topology) or "gg" (growing grid: one sheet).
        units: number of neurons, the resolution; None: enough for the scan, 500 to 8,000 (`choose_units`), in paper
            mode 2200.
        seed: equal seeds give equal meshes, byte for byte.
        mode: "batch" (fast) or "paper" (the literal sequential rules, slow).
        progress: called with each step and the fraction done.
        viewpoint: deprecated name of `viewpoints`.
        viewpoints: `[3]` or `[K, 3]` positions of the sensor, in the frame of the points [m]: the surface looks to
            where it was seen from. Without them sheets look up (along z), closed surfaces outwards.
        seen_from: `[N]` index of the viewpoint that each point was seen from; without it, of several viewpoints the
            nearest one from which no other point hides it is taken.
        colors: `[N, 3]` red, green and blue of the points, 0 to 255.
        readings: all points of the scan, in the same frame, where `points` are those that pre-processing kept:
            `quality` is measured on these.
        options: further fields of `GSRMConfig` or `GrowingGridConfig`, such as `triangles=13860` for "gg".

    Raises:
        ReconstructionError: the points hold no surface, or an argument is out of its range.
    """
    if viewpoint is not None and viewpoints is not None:
        raise ReconstructionError("viewpoint is the deprecated name of viewpoints; give only viewpoints")
    viewpoints = viewpoint if viewpoints is None else viewpoints
    cloud = make_cloud(points, viewpoints=viewpoints, seen_from=seen_from, colors=colors)
    network, config_type = find_method(method)
    selected = options if mode == "batch" else {"mode": mode, **options}
    is_chosen = units is None and mode == "batch" and "triangles" not in options
    if is_chosen:
        from reconstruction.resolution import choose_units

        units = choose_units(cloud.points)
    elif units is None:
        units = DEFAULT_UNITS
    config = make_config(config_type, {"units": units, **selected})
    check_number(cloud.points, getattr(config, "wanted_units", config.units))
    seed = _check_seed(seed)
    everything = None if readings is None else align(make_cloud(readings), cloud)
    keep_compiled_programs()
    state = network.train(cloud.points, config, seed, progress)
    notes = {"units": f"{units}, chosen for the density of the points"} if is_chosen else {}
    result = Reconstruction(method, config, state, cloud, readings=everything, notes=notes)
    if result.dropped is not None:
        result.notes["dropped"] = f"pre-processing dropped {result.dropped}"
    return result


class Reconstruction:
    """A network that has learned a surface: its mesh, its quality, and all that it needs to learn on.

    Positions are in the frame of the points given minus `offset`.

    Attributes:
        method: "gsrm" or "gg".
        config: the network's configuration.
        state: the network itself, plain arrays.
        cloud: the points that it was grown over, with their colors and viewpoints.
        readings: all points of the scan, also those that pre-processing dropped; `cloud` where they were not given.
        mesh: the surface; consistently wound, each component looks to where it was seen from; without viewpoints up,
            or outwards where it is closed.
        notes: what a reader of the result should know, by subject; texts and numbers.
    """

    def __init__(
        self,
        method: str,
        config: NetworkConfig,
        state: State,
        cloud: Cloud,
        *,
        readings: Cloud | None = None,
        notes: dict[str, Any] | None = None,
        far: FarFaces | None = None,
    ):
        """Wrap a network; `reconstruct` and `load` are the ways to get one; `far` is known after `refine`."""
        self.method = method
        self.config = config
        self.state = state
        self.cloud = cloud
        self.readings = cloud if readings is None else readings
        self.notes = dict(notes or {})
        self._far = self._measure_far() if far is None else far
        self._is_updated = far is not None
        self.mesh = self._make_mesh()
        if cloud.offset.any():
            self.notes["offset"] = (
                f"{', '.join(f'{value:.15g}' for value in cloud.offset)} m were subtracted from the coordinates"
            )

    def __repr__(self) -> str:
        """Return method, size of the mesh and number of readings in one line."""
        vertices = self.mesh.vertices
        size = " x ".join(f"{side:.3g}" for side in np.ptp(vertices, axis=0)) if len(vertices) else "empty"
        return (
            f"Reconstruction({self.method}: {len(vertices)} vertices, {len(self.mesh.faces)} faces, {size} m, "
            f"of {self.readings.num_points} readings)"
        )

    @cached_property
    def dropped(self) -> Dropped | None:
        """The readings that pre-processing left no point for; None where the readings are the points."""
        from reconstruction.scans.dropped import measure_dropped

        return None if self.readings is self.cloud else measure_dropped(self.readings, self.points)

    @property
    def points(self) -> Float[np.ndarray, "N 3"]:
        """The points that it was grown over [m]."""
        return self.cloud.points

    @property
    def viewpoints(self) -> Float[np.ndarray, "K 3"] | None:
        """Positions of the sensor [m], or None."""
        return self.cloud.viewpoints

    @property
    def seen_from(self) -> Int[np.ndarray, " N"] | None:
        """Index of the viewpoint of every point, or None."""
        return self.cloud.seen_from

    @property
    def colors(self) -> UInt8[np.ndarray, "N 3"] | None:
        """Red, green and blue of every point, or None."""
        return self.cloud.colors

    @property
    def offset(self) -> Float[np.ndarray, " 3"]:
        """What was subtracted from the coordinates given [m]."""
        return self.cloud.offset

    @property
    def viewpoint(self) -> Float[np.ndarray, "*K 3"] | None:
        """Deprecated: `viewpoints`, of which a single one is `[3]`."""
        viewpoints = self.viewpoints
        return viewpoints[0] if viewpoints is not None and len(viewpoints) == 1 else viewpoints

    def quality(self, truth: trimesh.Trimesh | None = None) -> Quality:
        """Measure the mesh against all readings, and against the true surface where it is known.

        Args:
            truth: the true surface, in the frame of the points given: `offset` is subtracted.
        """
        from reconstruction.surfaces.quality import measure_quality

        if truth is not None and self.offset.any():
            truth = truth.copy().apply_translation(-self.offset)
        return measure_quality(self.mesh, self.readings.points, truth)

    def refine(
        self,
        new_points: ArrayLike | ScanLog | Cloud,
        seed: int = 0,
        progress: Progress = silent,
        *,
        origins: ArrayLike | None = None,
    ) -> Reconstruction:
        """Return the same network after it has learned from new readings; this one stays as it is.

        Moved parts move, new parts grow, parts that are no longer there are removed; the rest stays.

        Args:
            new_points: `[N, 3]` readings made since [m], in the frame and unit of those given first: `offset` is
                subtracted; or a cloud; or a scan log, which is levelled, filtered and smoothed. Clouds and logs
                know their origins themselves.
            seed: seed of the order of the signals.
            progress: called with each step and the fraction done.
            origins: `[N, 3]` sensor position of each reading, or `[3]` one for all, in the same frame [m]: surface
                that their rays pass through is removed. Without them a part is removed where it is not read again
                but all around it is.

        Raises:
            ReconstructionError: the points or origins are no points, or in another unit.
        """
        if isinstance(new_points, ScanLog | Cloud) and origins is not None:
            raise ReconstructionError("a scan log or cloud holds its own origins; leave out origins")
        if isinstance(new_points, ScanLog):
            from reconstruction.scans.rays import read_rays

            new_points, origins = read_rays(new_points)
        elif isinstance(new_points, Cloud):
            origins = None if new_points.origins is None else new_points.origins + new_points.offset
            new_points = new_points.points + new_points.offset
        new = check_points(new_points) - self.offset
        check_scale(new, self.points)
        seen_from = None if origins is None else check_origins(origins, len(new)) - self.offset
        seed = _check_seed(seed)
        keep_compiled_programs()
        from reconstruction.networks.change.refinement import learn_changes

        learner = find_learner(self.method)(self.state, self.config)
        state, is_valid = learn_changes(learner, self.points, new, seed, progress, seen_from)
        added = make_cloud_of_rays(new, seen_from, self.offset)
        cloud = join_clouds(self.cloud.select(is_valid), added)
        removed = self.points[~is_valid]
        return Reconstruction(
            self.method, self.config, state, cloud, far=self._update_far(state, removed, cloud)
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the network as plain arrays (.npz, no pickle), atomically.

        Raises:
            OSError: the file cannot be written.
        """
        readings = None if self.readings is self.cloud else self.readings
        far = self._far if self._is_updated else None
        write_saved(
            Path(path), Saved(self.method, self.config, self.state, self.cloud, readings, self.notes, far)
        )

    @classmethod
    def load(cls, path: str | os.PathLike[str], max_bytes: float = MAX_BYTES) -> Reconstruction:
        """Read a file that `save` wrote.

        Args:
            path: .npz.
            max_bytes: the most that the file may hold once unpacked.

        Raises:
            ReconstructionError: missing, damaged, not such a file, or of a newer version.
        """
        saved = read_saved(path, max_bytes)
        return cls(*saved[:4], readings=saved.readings, notes=saved.notes, far=saved.far)

    @cached_property
    def _sheet(self) -> Sheet:
        """The network's faces, before any is cut off."""
        from reconstruction.surfaces.far_updates import Sheet

        return Sheet(self.state.units.reshape(-1, 3), self.state.faces.astype(np.int64))

    def _measure_far(self) -> FarFaces:
        """Return which faces are far from every reading."""
        from reconstruction.surfaces.far_faces import SeenPoints, measure_far_faces

        return measure_far_faces(*self._sheet, SeenPoints(self.points, self.viewpoints, self.seen_from))

    def _update_far(self, state: State, removed: Float[np.ndarray, "D 3"], cloud: Cloud) -> FarFaces:
        """Return which faces of the network that has learned on are far from every reading."""
        from reconstruction.surfaces.far_faces import SeenPoints
        from reconstruction.surfaces.far_updates import Sheet, update_far_faces

        if state is self.state and not len(removed) and not self._far.is_far.any():
            return self._far
        sheet = Sheet(state.units.reshape(-1, 3), state.faces.astype(np.int64))
        seen = SeenPoints(cloud.points, cloud.viewpoints, cloud.seen_from)
        return update_far_faces(self._far, self._sheet, sheet, removed, seen)

    def _make_mesh(self) -> trimesh.Trimesh:
        """Return the oriented mesh of the units that have a face, and note what its orientation rests on."""
        import trimesh

        from reconstruction.geometry.orientation import orient_outwards, orient_to_viewpoints
        from reconstruction.networks.change.absence import thin

        vertices, faces = self._cut_far_faces()
        if self.viewpoints is None:
            faces = orient_outwards(vertices, faces)
            note = (
                "no viewpoint: open surfaces look up, closed ones outwards; give the position of the sensor"
            )
        else:
            points = self.points
            if self._is_updated and self.seen_from is None:
                points = thin(points, _MOST_VOTES)  # the old faces are wound already
            (vertices, faces), share = orient_to_viewpoints(
                vertices, faces, points, self.viewpoints, self.seen_from
            )
            note = f"{100 * share:.1f} % of the area looks to where it was seen from"
        self.notes["orientation"] = note
        logger.info("orientation: %s", note)
        return trimesh.Trimesh(vertices, faces, process=False)

    def _cut_far_faces(self) -> tuple[Float[np.ndarray, "V 3"], Int[np.ndarray, "F 3"]]:
        """Return vertices and faces of the network without faces far from every reading, and note what was cut."""
        from reconstruction.surfaces.far_faces import cut_faces

        used, flat = np.unique(self._sheet.faces, return_inverse=True)
        cut = cut_faces(self._sheet.vertices[used], flat.reshape(-1, 3), self._far.is_far)
        if cut.num_faces:
            note = (
                f"{cut.area:.3g} m² of the surface ({100 * cut.share:.1f} %, {cut.num_faces} faces) were far from "
                "every reading and were cut off"
            )
            self.notes["cut"] = note
            logger.info("cut: %s", note)
        else:
            self.notes.pop("cut", None)
        return cut.vertices, cut.faces


def _check_seed(seed: int) -> int:
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise ReconstructionError(f"seed must be a whole number from 0 on, got {seed!r}")
    return int(seed)
