"""Public scans, by the name of their file, and clouds of one's own; nothing of them is part of this repository.

Files are searched in the folders given by `--data`, in those of the environment variable `SYMBRION_SCANS` (separated
as in `PATH`) and in `../shared/data`. A scan whose file is absent or cannot be read is skipped, with the reason.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from benchmarks.evidence.row import DATA
from benchmarks.material.array_files import load_arrays
from benchmarks.material.made_scenes import SCENES, MadeScan

AIRBORNE_HEIGHT = 100.0
"""Beams of an airborne scan are taken as vertical, from this height above each reading [m]."""


class MissingScanError(Exception):
    """A scan cannot be had here; the message names it, why, and where it comes from."""


@dataclass(frozen=True)
class ScanCase:
    """A cloud as the benchmark uses it.

    Attributes:
        name: what it is called in tables.
        points: `[N, 3]` [m], z up.
        viewpoints: `[K, 3]` places of the scanner that are told to the reconstruction, or None.
        seen_from: `[N]` row of the viewpoint of each reading, or None.
        origins: `[N, 3]` where each beam is taken to begin, or None where nothing is known; for the judge alone.
        truth: the solid body, or None for a real scan.
    """

    name: str
    points: np.ndarray
    viewpoints: np.ndarray | None = None
    seen_from: np.ndarray | None = None
    origins: np.ndarray | None = None
    truth: trimesh.Trimesh | None = None


@dataclass(frozen=True)
class PublicScan:
    """Where a scan comes from, and how it is read.

    Attributes:
        file: name in the folder of the data.
        source: repository and path.
        viewpoint: place of the scanner in the file's frame, or None. Where the file does not tell it, it is the place
            from which readings that follow each other are a whole number of the scanner's steps apart.
        is_airborne: whether it was scanned from the air: no viewpoint is told, the beams are taken as vertical.
        frame: rows of a rotation from the file's frame to z up, or None.
        scale: factor to meters, or to the size of a robot's arena.
        reach: readings nearer or farther than these ranges are no echoes, or None [m].
        crop: low and high corner in the file's frame, after `scale`, from the lowest corner if `is_airborne` [m].
    """

    file: str
    source: str
    viewpoint: tuple[float, float, float] | None = (0.0, 0.0, 0.0)
    is_airborne: bool = False
    frame: tuple[tuple[float, float, float], ...] | None = None
    scale: float = 1.0
    reach: tuple[float, float] | None = None
    crop: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None


_CAMERA = ((0.0, 0.0, 1.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0))
"""From a camera's frame (x right, y down, z ahead) to x ahead, y left, z up."""
_PCL = "PointCloudLibrary/data"

PUBLIC: dict[str, PublicScan] = {
    "apartment": PublicScan(
        "libpointmatcher_apartment_cloud_0.vtk",
        "norlab-ulaval/libpointmatcher, examples/icp_tutorial/cloud_0.vtk",
        (0.0, 0.0, 0.22),
    ),
    "lobby": PublicScan(
        "octomap_stairs_scan.dat.bz2", "OctoMap/octomap, octomap/share/data/scan.dat.bz2", (0.03, 0.0, 0.37)
    ),
    "stairs": PublicScan(
        "octomap_stairs_scan.dat.bz2",
        "OctoMap/octomap, octomap/share/data/scan.dat.bz2",
        (0.03, 0.0, 0.37),
        crop=((0.4, -4.3, -10.0), (9.6, 1.4, 2.0)),
    ),
    "corridor": PublicScan("3dtk_scan000.3d", "3DTK/3DTK, dat/scan000.3d", reach=(0.2, 32.0)),
    "camera room": PublicScan(
        "pcl_depth_camera_room.pcd", f"{_PCL}, tutorials/pairwise/capture0001.pcd", frame=_CAMERA
    ),
    "aerial /50": PublicScan(
        "pcl_aerial_samp11_utm.pcd", f"{_PCL}, terrain/samp11-utm.pcd", None, is_airborne=True, scale=0.02
    ),
    "aerial": PublicScan(
        "pcl_aerial_samp11_utm.pcd", f"{_PCL}, terrain/samp11-utm.pcd", None, is_airborne=True
    ),
    "town": PublicScan(
        "pcl_building_site_utm.pcd",
        f"{_PCL}, terrain/CSite1_red2-utm.pcd",
        None,
        is_airborne=True,
        crop=((300.0, 300.0, -1e9), (700.0, 700.0, 1e9)),
    ),
    "rocky hill": PublicScan(
        "pdal_lone_star.laz", "PDAL/PDAL, test/data/ept/source/lone-star.laz", None, is_airborne=True
    ),
    "bunny x10": PublicScan("stanford-bunny.obj", "Stanford 3D Scanning Repository", None, scale=10.0),
    "street": PublicScan("small_gicp_street.ply", "koide3/small_gicp, data/target.ply", reach=(1.0, 100.0)),
    "campus": PublicScan(
        "libpointmatcher_cloud_00000.vtk",
        "norlab-ulaval/libpointmatcher, examples/data/cloud.00000.vtk",
        (0.5, 0.0, 1.0),
    ),
    "table with mug": PublicScan(
        "pcl_table_scene_mug.pcd", f"{_PCL}, tutorials/table_scene_mug_stereo_textured.pcd", frame=_CAMERA
    ),
    "wooded hills": PublicScan(
        "pcl_forest_site_utm.pcd", f"{_PCL}, terrain/FSite8_red2-utm.pcd", None, is_airborne=True, scale=0.02
    ),
}


def load_case(name: str, folders: list[Path]) -> ScanCase:
    """Return a made scene, a public scan, or the cloud of a file in one of the folders.

    Raises:
        MissingScanError: it is absent, or there is no reader for it here.
    """
    if name in SCENES:
        return _as_case(name, SCENES[name]())
    if name in PUBLIC:
        return _load_public(name, PUBLIC[name], folders)
    return load_file(_find(name, name, "a file of one's own", folders))


def load_file(path: Path) -> ScanCase:
    """Return the cloud of any file that is read here; an .npz may hold viewpoints, seen_from, origins and the truth.

    Raises:
        MissingScanError: there is no reader for it here.
    """
    if path.suffix != ".npz":
        return ScanCase(path.stem, _read_points(path))
    held = load_arrays(path)
    if "truth_vertices" in held:
        truth = trimesh.Trimesh(held["truth_vertices"], held["truth_faces"], process=False)
        return _as_case(path.stem, MadeScan(truth, held["points"], held["viewpoints"], held["seen_from"]))
    viewpoints, seen_from = held.get("viewpoints"), held.get("seen_from")
    origins = held.get("origins")
    if origins is None and viewpoints is not None and seen_from is not None:
        origins = viewpoints[seen_from]
    return ScanCase(path.stem, held["points"], viewpoints, seen_from, origins)


def find_folders(given: list[Path]) -> list[Path]:
    """Return the folders where scans are searched, those given first."""
    named = [Path(part) for part in os.environ.get("SYMBRION_SCANS", "").split(os.pathsep) if part]
    return [*given, *named, DATA]


def _as_case(name: str, made: MadeScan) -> ScanCase:
    return ScanCase(
        name, made.points, made.viewpoints, made.seen_from, made.viewpoints[made.seen_from], made.truth
    )


def _load_public(name: str, scan: PublicScan, folders: list[Path]) -> ScanCase:
    points = scan.scale * _read_points(_find(name, scan.file, scan.source, folders))
    origin = None if scan.viewpoint is None else np.array(scan.viewpoint)
    if scan.reach is not None:
        ranges = np.linalg.norm(points - (0.0 if origin is None else origin), axis=1)
        points = points[(ranges > scan.reach[0]) & (ranges < scan.reach[1])]
    if scan.crop is not None:
        corner = points.min(axis=0) if scan.is_airborne else 0.0
        low, high = np.asarray(scan.crop)
        points = points[((points - corner > low) & (points - corner < high)).all(axis=1)]
    if scan.frame is not None:
        points = points @ np.asarray(scan.frame).T
    if scan.is_airborne:
        return ScanCase(name, points, origins=points + np.array([0.0, 0.0, AIRBORNE_HEIGHT]))
    if origin is None:
        return ScanCase(name, points)
    return ScanCase(
        name, points, origin[None], np.zeros(len(points), int), np.broadcast_to(origin, points.shape)
    )


def _find(name: str, file: str, source: str, folders: list[Path]) -> Path:
    for folder in folders:
        if (folder / file).is_file():
            return folder / file
    raise MissingScanError(f"{name}: {file} ({source}) is in none of {', '.join(map(str, folders))}")


def _read_points(path: Path) -> np.ndarray:
    """Return the finite points of a file, in its own frame.

    Raises:
        MissingScanError: there is no reader for it here.
    """
    import reconstruction as rc

    try:
        if not hasattr(rc, "load_cloud"):
            return np.asarray(rc.load_points(path), float)
        cloud = rc.load_cloud(path)
    except rc.ReconstructionPackageError as error:
        raise MissingScanError(f"{path.name} cannot be read: {error}") from error
    return np.asarray(cloud.points, float) + cloud.offset
