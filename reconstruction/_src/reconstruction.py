"""A surface as a network that learns on: its mesh, its quality, its file."""

from __future__ import annotations

import os
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from numpy.typing import ArrayLike

from reconstruction._src.base.bounded_read import MAX_BYTES
from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.input_cloud import (
    check_free_rays,
    check_origins,
    check_scale,
    join_clouds,
    make_cloud_of_rays,
)
from reconstruction._src.knowledge.slip.drags import join_slip
from reconstruction._src.methods import find_method
from reconstruction._src.networks.som.compilation import keep_compiled_programs
from reconstruction._src.saved_file import read_saved, write_saved
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.point_rows import check_points, check_seed
from reconstruction._src.scans.scan import ScanLog

if TYPE_CHECKING:
    import trimesh

    from reconstruction._src.knowledge.slip.drags import FrictionReadings
    from reconstruction._src.knowledge.slip.patches import FrictionEstimate
    from reconstruction._src.methods import NetworkConfig, State
    from reconstruction._src.scans.slip_readings import SlipReadings
    from reconstruction._src.surfaces.quality import Quality


class Reconstruction:
    """A network that has learned a surface: its mesh, its quality, and all that it needs to learn on.

    Positions are in the frame of the points given minus `offset`.

    Attributes:
        method: "gsrm" or "gg".
        config: the network's configuration.
        state: the network itself, plain arrays.
        cloud: the points that it was grown over, with their colors and viewpoints.
        points: `[N, 3]` those points [m].
        viewpoints: `[K, 3]` positions of the sensor [m], or None.
        seen_from: `[N]` index of the viewpoint of every point, or None.
        colors: `[N, 3]` red, green and blue of every point, or None.
        offset: `[3]` what was subtracted from the coordinates given [m].
        readings: all points of the scan, also those that pre-processing dropped; `cloud` where they were not given.
        mesh: the surface; consistently wound, each component looks to where it was seen from; without viewpoints up,
            or outwards where it is closed. Of colored points it has vertex colors.
        notes: what a reader of the result should know, by subject; texts and numbers.
        slip: friction by place, from the slip of robots, or None; `friction` groups it into patches.
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
        slip: FrictionReadings | None = None,
    ):
        """Wrap a network; `reconstruct` and `load` are the ways to get one."""
        self.method = method
        self.config = config
        self.state = state
        self.cloud = cloud
        self.points, self.viewpoints, self.seen_from = cloud.points, cloud.viewpoints, cloud.seen_from
        self.colors, self.offset = cloud.colors, cloud.offset
        self.readings = cloud if readings is None else readings
        self.notes = dict(notes or {})
        if self.readings.up:
            self.notes["up"] = self.readings.up
        self.slip = slip
        self.mesh = self._make_mesh()
        if cloud.offset.any():
            self.notes["offset"] = (
                f"{', '.join(f'{value:.15g}' for value in cloud.offset)} m were subtracted from the coordinates"
            )

    def __repr__(self) -> str:
        vertices = self.mesh.vertices
        size = " x ".join(f"{side:.3g}" for side in np.ptp(vertices, axis=0)) if len(vertices) else "empty"
        return (
            f"Reconstruction({self.method}: {len(vertices)} vertices, {len(self.mesh.faces)} faces, {size} m, "
            f"of {self.readings.num_points} readings)"
        )

    @cached_property
    def dropped(self) -> float | None:
        """Share of the readings that pre-processing left no point for; None where the readings are the points."""
        from reconstruction._src.scans.preprocess import measure_dropped

        return None if self.readings is self.cloud else measure_dropped(self.readings.points, self.points)

    @property
    def vertex_colors(self) -> UInt8[np.ndarray, "V 3"] | None:
        """Red, green and blue of every vertex of the mesh, or None where the points have no colors."""
        from reconstruction._src.surfaces.color import find_vertex_colors

        return find_vertex_colors(self.mesh)

    @property
    def colored_readings(self) -> Cloud | None:
        """All readings with colors, else the points that it was grown over with theirs; None where neither has any."""
        return next((cloud for cloud in (self.readings, self.cloud) if cloud.colors is not None), None)

    def quality(self, truth: trimesh.Trimesh | None = None) -> Quality:
        """Measure the mesh against all readings, and against the true surface where it is known.

        Args:
            truth: the true surface, in the frame of the points given: `offset` is subtracted.
        """
        from reconstruction._src.surfaces.quality import measure_quality

        if truth is not None and self.offset.any():
            truth = truth.copy().apply_translation(-self.offset)
        return measure_quality(self.mesh, self.readings.points, truth)

    def refine(
        self,
        new_points: ArrayLike | ScanLog | Cloud | None = None,
        seed: int = 0,
        progress: Progress = silent,
        *,
        origins: ArrayLike | None = None,
        free_rays: ArrayLike | None = None,
        slip: SlipReadings | None = None,
    ) -> Reconstruction:
        """Return the same network trained on the readings that still hold and the new ones; this one stays as it is.

        Moved parts move, new parts grow, parts that are no longer there are removed; units elsewhere stay. New readings
        without colors take those of the colored readings around them (`match_colors`, a note).

        Args:
            new_points: `[N, 3]` readings made since [m], in the frame and unit of those given first: `offset` is
                subtracted; or a cloud; or a scan log, which is levelled, filtered and smoothed. Clouds and logs
                know their origins themselves.
            seed: seed of the order of the signals.
            progress: called with each step and the fraction done.
            origins: `[N, 3]` sensor position of each reading, or `[3]` one for all, in the same frame [m]: surface
                that their rays pass through is removed. Without them a part is removed where it is not read again
                but all around it is.
            free_rays: `[K, 2, 3]` rays that met nothing: where they began, and how far they surely went, in the same
                frame [m]: surface that they pass through is removed.
            slip: what a robot read that dragged its tracks over the ground, in the same frame; None for that of a scan
                log, where it holds some. Alone, without points, it leaves the surface as it is.

        Raises:
            ReconstructionError: the points or origins are no points, or in another unit; or there is nothing new.
        """
        if isinstance(new_points, ScanLog) and slip is None:
            slip = new_points.slip
        felt = join_slip(self.slip, slip, self.offset)
        if new_points is None:
            return self._with_slip(felt, slip, origins)
        if isinstance(new_points, ScanLog | Cloud) and origins is not None:
            raise ReconstructionError("a scan log or cloud holds its own origins; leave out origins")
        colors = None
        if isinstance(new_points, ScanLog):
            from reconstruction._src.scans.preprocess import preprocess_cloud

            new_points = preprocess_cloud(new_points)
        if isinstance(new_points, Cloud):
            colors = new_points.colors
            origins = None if new_points.origins is None else new_points.origins + new_points.offset
            new_points = new_points.points + new_points.offset
        new = check_points(new_points) - self.offset
        check_scale(new, self.points)
        free = None if free_rays is None else check_free_rays(free_rays) - self.offset
        seen_from = None if origins is None else check_origins(origins, len(new)) - self.offset
        seed = check_seed(seed)
        keep_compiled_programs()
        state, is_valid = self._train_again(new, seed, progress, seen_from, free)
        valid, added = self.cloud.select(is_valid), make_cloud_of_rays(new, seen_from, self.offset)
        notes = {name: self.notes[name] for name in ("up",) if name in self.notes}
        if colors is not None or self.colors is not None:
            from reconstruction._src.surfaces.color import match_colors

            added, note = match_colors(valid, added.replace(colors=colors))
            notes |= {"colors": note} if note else {}
        cloud = join_clouds(valid, added)
        return Reconstruction(self.method, self.config, state, cloud, notes=notes, slip=felt)

    def _train_again(
        self,
        new: Float[np.ndarray, "M 3"],
        seed: int,
        progress: Progress,
        origins: Float[np.ndarray, "M 3"] | None,
        free_rays: Float[np.ndarray, "K 2 3"] | None,
    ) -> tuple[State, Bool[np.ndarray, " N"]]:
        """Return the network that has learned from new readings, and which of the old points are still valid."""
        from reconstruction._src.geometry.manifold import widen
        from reconstruction._src.knowledge.changes import compare, detect_changes
        from reconstruction._src.networks.surface_fit import mean_edge_length

        vertices, faces = self.state.units.reshape(-1, 3), self.state.faces.astype(np.int64)
        spacing = mean_edge_length(vertices, faces)
        change = detect_changes(vertices, faces, self.points, new, spacing, origins, free_rays)
        is_changed, is_valid = compare(vertices, faces, change, self.points, new, spacing)
        if not is_changed.any():
            progress("refine", 1.0)
            return self.state, is_valid
        points = np.concatenate([self.points[is_valid], new])
        network, _ = find_method(self.method)
        is_free = widen(faces, is_changed, network.FREE_RINGS)
        return network.train_again(self.state, is_free, points, self.config, seed, progress), is_valid

    def _with_slip(
        self, felt: FrictionReadings | None, slip: SlipReadings | None, origins: ArrayLike | None
    ) -> Reconstruction:
        """Return the same surface with other friction."""
        if slip is None or origins is not None:
            raise ReconstructionError("there is nothing new to learn from: give new_points, slip, or both")
        network = (self.method, self.config, self.state, self.cloud)
        return Reconstruction(*network, readings=self.readings, notes=self.notes, slip=felt)

    @cached_property
    def friction(self) -> FrictionEstimate | None:
        """Friction of the ground in patches; None where no robot felt it, or too little of it."""
        from reconstruction._src.knowledge.slip.patches import estimate_friction_patches

        return None if self.slip is None else estimate_friction_patches(self.slip)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the network as plain arrays (.npz, no pickle), atomically.

        Raises:
            OSError: the file cannot be written.
        """
        write_saved(Path(path), self)

    @classmethod
    def load(cls, path: str | os.PathLike[str], max_bytes: float = MAX_BYTES) -> Reconstruction:
        """Read a file that `save` wrote.

        Args:
            path: .npz.
            max_bytes: the most that the file may hold once unpacked.

        Raises:
            ReconstructionError: missing, damaged, not such a file, or of a newer version.
        """
        return cls(**read_saved(path, max_bytes))

    def _make_mesh(self) -> trimesh.Trimesh:
        """Return the oriented mesh of the units that have a face, and note what its orientation rests on."""
        import trimesh

        from reconstruction._src.geometry.orientation import orient_outwards, orient_to_viewpoints

        vertices, faces = self._cut_far_faces()
        if self.viewpoints is None:
            faces = orient_outwards(vertices, faces)
            note = "no viewpoint: open surfaces look up, closed ones and rooms outwards; give the sensor's position"
        else:
            (vertices, faces), share = orient_to_viewpoints(
                vertices, faces, self.points, self.viewpoints, self.seen_from
            )
            note = f"{100 * share:.1f} % of the area looks to where it was seen from"
        self.notes["orientation"] = note
        mesh = trimesh.Trimesh(vertices, faces, process=False)
        colored = self.colored_readings
        if colored is not None and colored.num_points and len(vertices):
            from reconstruction._src.surfaces.color import paint_mesh

            paint_mesh(mesh, colored)
        return mesh

    def _cut_far_faces(self) -> tuple[Float[np.ndarray, "V 3"], Int[np.ndarray, "F 3"]]:
        """Return vertices and faces of the network without faces far from every reading, and note what was cut."""
        from reconstruction._src.geometry.rows import drop_unused
        from reconstruction._src.surfaces.far_faces import cut_far_faces

        vertices, faces = drop_unused(self.state.units.reshape(-1, 3), self.state.faces.astype(np.int64))
        cut = cut_far_faces(vertices, faces, self.points, self.viewpoints, self.seen_from)
        if cut.num_faces:
            self.notes["cut"] = (
                f"{cut.area:.3g} m² of the surface ({100 * cut.share:.1f} %, {cut.num_faces} faces) were far from "
                "every reading and were cut off"
            )
        else:
            self.notes.pop("cut", None)
        return cut.vertices, cut.faces
