"""Points in, surface out: read and clean laser scans, and reconstruct surfaces with self-organizing networks."""

from typing import TYPE_CHECKING

from reconstruction.lazy import export_lazily
from reconstruction.reconstruct import reconstruct  # the function has the name of its module
from reconstruction.reconstruction import Reconstruction

if TYPE_CHECKING:
    from reconstruction.errors import ReconstructionError, ReconstructionPackageError, ScanError
    from reconstruction.networks.growing_grid.growing_grid import GrowingGridConfig
    from reconstruction.networks.gsrm.gsrm import GSRMConfig
    from reconstruction.objects.config import ObjectsConfig
    from reconstruction.objects.finding import FoundObject, find_objects
    from reconstruction.progress import Progress, silent
    from reconstruction.resolution import ResolutionConfig, choose_units
    from reconstruction.scans.cells import SparsePointsConfig
    from reconstruction.scans.cloud import Cloud
    from reconstruction.scans.cloud_file import load_cloud, make_log_cloud, recenter
    from reconstruction.scans.cloud_preprocess import preprocess_cloud
    from reconstruction.scans.depth_image import Intrinsics, load_depth_image
    from reconstruction.scans.formats import load_points, save_points
    from reconstruction.scans.frames import FrameConfig, describe_odd_size
    from reconstruction.scans.leveling import LevelingConfig
    from reconstruction.scans.localization import LocalizationConfig, localise, localize
    from reconstruction.scans.mesh_files import is_mesh, load_mesh
    from reconstruction.scans.mixed_pixels import MixedPixelsConfig
    from reconstruction.scans.noise_priors import NoisePriors
    from reconstruction.scans.preprocess import (
        PreprocessConfig,
        level_floor,
        preprocess,
        remove_mixed_pixels,
        smooth_ranges,
    )
    from reconstruction.scans.scan import ScanLog
    from reconstruction.scans.scan_log_file import load_scan_log
    from reconstruction.scans.selection import CropConfig, crop, find_crop_box, thin
    from reconstruction.scans.smoothing import SmoothingConfig
    from reconstruction.slip.drags import DragConfig, FrictionReadings, SlipPriors, find_friction
    from reconstruction.slip.patches import (
        EstimatedPatch,
        FrictionEstimate,
        FrictionPatchConfig,
        find_friction_patches,
    )
    from reconstruction.slip.readings import SlipReadings
    from reconstruction.surfaces.quality import Quality, measure_quality
    from reconstruction.tiles.config import TilesConfig
    from reconstruction.tiles.folder import TiledSurface
    from reconstruction.tiles.tiling import reconstruct_tiles

__all__ = [
    "Cloud",
    "CropConfig",
    "DragConfig",
    "EstimatedPatch",
    "FoundObject",
    "FrameConfig",
    "FrictionEstimate",
    "FrictionPatchConfig",
    "FrictionReadings",
    "GSRMConfig",
    "GrowingGridConfig",
    "Intrinsics",
    "LevelingConfig",
    "LocalizationConfig",
    "MixedPixelsConfig",
    "NoisePriors",
    "ObjectsConfig",
    "PreprocessConfig",
    "Progress",
    "Quality",
    "Reconstruction",
    "ReconstructionError",
    "ReconstructionPackageError",
    "ResolutionConfig",
    "ScanError",
    "ScanLog",
    "SlipPriors",
    "SlipReadings",
    "SmoothingConfig",
    "SparsePointsConfig",
    "TiledSurface",
    "TilesConfig",
    "choose_units",
    "crop",
    "describe_odd_size",
    "find_crop_box",
    "find_friction",
    "find_friction_patches",
    "find_objects",
    "is_mesh",
    "level_floor",
    "load_cloud",
    "load_depth_image",
    "load_mesh",
    "load_points",
    "load_scan_log",
    "localise",
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
