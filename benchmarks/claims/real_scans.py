"""Arenas of made scenes and public scans, with default options."""

from benchmarks.figures import Claim, Value
from benchmarks.material.bars import BARS


def _claim(what: str, key: str, unit: str = "") -> Claim:
    bar = BARS[key]
    worst = f"{{0:.{bar.digits}f}}{unit}"
    return Claim(
        f"Arenas of made scenes and public scans, default options: {what} (scenes that meet the target)",
        f"{worst} ({{1}} of {{2}})",
        (
            Value("real_scans", f"summary/{key}/worst", scale=bar.scale),
            Value("real_scans", f"summary/{key}/met"),
            Value("real_scans", f"summary/{key}/of"),
        ),
        bar=f"{'>=' if bar.is_least else '<='} {bar.scale * bar.limit:g}{unit}",
    )


REAL_SCANS = (
    _claim("mean distance of the surface from contact, relative to the accuracy", "contact_over_accuracy"),
    _claim("95th percentile of that distance, relative to the accuracy", "p95_over_accuracy"),
    _claim("largest share of the surface without contact within 5 cm", "uncovered", " %"),
    _claim(
        "smallest share of the scanner's beams that end within 5 cm of their reading on contact, relative to the "
        "surface",
        "beams_over_surface",
    ),
    _claim("largest share of the free space seen by the scanner that is solid", "free_space", " %"),
    _claim("longest physics step of a snake, relative to one on boxes", "step_over_boxes"),
    _claim("longest processor time from 100,000 points to the arena", "cpu_s_per_100k", " s"),
    _claim("largest peak memory from points to the arena", "memory_gb", " GB"),
    _claim(
        "fewest of 16 random starts from which a tracked robot reaches the goal by simple pursuit", "arrived"
    ),
    _claim(
        "largest error of the surface, relative to Poisson's with equally many triangles",
        "surface_over_poisson",
    ),
)
