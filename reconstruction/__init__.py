"""Points in, surface out: read and clean laser scans, and reconstruct surfaces with self-organizing networks."""

from typing import TYPE_CHECKING

from reconstruction.lazy import export_lazily
from reconstruction.reconstruct import Reconstruction, reconstruct  # the function has the name of its module

if TYPE_CHECKING:
    from reconstruction.errors import ReconstructionError, ReconstructionPackageError, ScanError
    from reconstruction.networks.growing_grid.growing_grid import GrowingGridConfig
    from reconstruction.networks.gsrm.gsrm import GSRMConfig
    from reconstruction.progress import Progress, silent
    from reconstruction.scans.cells import SparsePointsConfig
    from reconstruction.scans.formats import load_points, save_points
    from reconstruction.scans.leveling import LevelingConfig
    from reconstruction.scans.localization import LocalizationConfig, localise, localize
    from reconstruction.scans.mixed_pixels import MixedPixelsConfig
    from reconstruction.scans.preprocess import (
        PreprocessConfig,
        crop,
        level_floor,
        preprocess,
        remove_mixed_pixels,
        smooth_ranges,
        thin,
    )
    from reconstruction.scans.scan import ScanLog
    from reconstruction.scans.scan_log_file import load_scan_log
    from reconstruction.scans.smoothing import SmoothingConfig
    from reconstruction.surfaces.quality import Quality, measure_quality
    from reconstruction.tiles.config import TilesConfig
    from reconstruction.tiles.folder import TiledSurface
    from reconstruction.tiles.tiling import reconstruct_tiles

__all__ = [
    "GSRMConfig",
    "GrowingGridConfig",
    "LevelingConfig",
    "LocalizationConfig",
    "MixedPixelsConfig",
    "PreprocessConfig",
    "Progress",
    "Quality",
    "Reconstruction",
    "ReconstructionError",
    "ReconstructionPackageError",
    "ScanError",
    "ScanLog",
    "SmoothingConfig",
    "SparsePointsConfig",
    "TiledSurface",
    "TilesConfig",
    "crop",
    "level_floor",
    "load_points",
    "load_scan_log",
    "localise",
    "localize",
    "measure_quality",
    "preprocess",
    "reconstruct",
    "reconstruct_tiles",
    "remove_mixed_pixels",
    "save_points",
    "silent",
    "smooth_ranges",
    "thin",
]

__getattr__, __dir__ = export_lazily(__name__)
