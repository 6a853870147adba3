"""Points in, surface out: read and clean laser scans, and reconstruct surfaces with self-organising networks."""

from reconstruction.errors import ReconstructionError, ScanError
from reconstruction.formats import load_points, save_points
from reconstruction.growing_grid import GrowingGridConfig
from reconstruction.gsrm import GSRMConfig
from reconstruction.localisation import localise
from reconstruction.preprocess import crop, level_floor, preprocess, remove_mixed_pixels, smooth_ranges, thin
from reconstruction.progress import Progress, silent
from reconstruction.quality import Quality, measure_quality
from reconstruction.reconstruct import Reconstruction, reconstruct
from reconstruction.scan import ScanLog, load_scan_log

__all__ = [
    "GSRMConfig",
    "GrowingGridConfig",
    "Progress",
    "Quality",
    "Reconstruction",
    "ReconstructionError",
    "ScanError",
    "ScanLog",
    "crop",
    "level_floor",
    "load_points",
    "load_scan_log",
    "localise",
    "measure_quality",
    "preprocess",
    "reconstruct",
    "remove_mixed_pixels",
    "save_points",
    "silent",
    "smooth_ranges",
    "thin",
]
