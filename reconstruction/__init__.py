"""Points in, surface out: read and clean laser scans, and reconstruct surfaces with self-organizing networks."""

from typing import TYPE_CHECKING

from reconstruction._src.base.lazy import export_lazily
from reconstruction._src.reconstruct import reconstruct  # the function has the name of its module
from reconstruction._src.reconstruction import Reconstruction

if TYPE_CHECKING:
    from reconstruction._src.base.errors import ReconstructionError, ReconstructionPackageError, ScanError
    from reconstruction._src.base.progress import Progress, silent
    from reconstruction._src.networks.growing_grid.growing_grid import GrowingGridConfig
    from reconstruction._src.networks.gsrm.gsrm import GSRMConfig
    from reconstruction._src.objects.finding import FoundObject, find_objects
    from reconstruction._src.resolution import choose_units
    from reconstruction._src.scans.cloud import Cloud
    from reconstruction._src.scans.cloud_file import (
        load_cloud,
        load_points,
        make_log_cloud,
        recenter,
        save_points,
    )
    from reconstruction._src.scans.depth_image import Intrinsics, load_depth_image
    from reconstruction._src.scans.frames import describe_odd_size
    from reconstruction._src.scans.leveling import level_floor
    from reconstruction._src.scans.localization import localize
    from reconstruction._src.scans.mesh_files import is_mesh, load_mesh
    from reconstruction._src.scans.preprocess import (
        preprocess,
        preprocess_cloud,
        remove_mixed_pixels,
        smooth_ranges,
    )
    from reconstruction._src.scans.scan import ScanLog, is_scan_log, load_scan_log
    from reconstruction._src.scans.selection import crop, find_crop_box, thin
    from reconstruction._src.scans.slip_readings import SlipReadings
    from reconstruction._src.surfaces.quality import Quality, measure_quality
    from reconstruction._src.tiles.point_stream import TilesConfig
    from reconstruction._src.tiles.tiling import reconstruct_tiles

__all__ = [
    "Cloud",
    "FoundObject",
    "GSRMConfig",
    "GrowingGridConfig",
    "Intrinsics",
    "Progress",
    "Quality",
    "Reconstruction",
    "ReconstructionError",
    "ReconstructionPackageError",
    "ScanError",
    "ScanLog",
    "SlipReadings",
    "TilesConfig",
    "choose_units",
    "crop",
    "describe_odd_size",
    "find_crop_box",
    "find_objects",
    "is_mesh",
    "is_scan_log",
    "level_floor",
    "load_cloud",
    "load_depth_image",
    "load_mesh",
    "load_points",
    "load_scan_log",
    "localize",
    "make_log_cloud",
    "measure_quality",
    "preprocess",
    "preprocess_cloud",
    "recenter",
    "reconstruct",
    "reconstruct_tiles",
    "remove_mixed_pixels",
    "save_points",
    "silent",
    "smooth_ranges",
    "thin",
]

__getattr__, __dir__ = export_lazily(__name__)
