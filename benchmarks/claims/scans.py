"""What the scans are worth."""

from benchmarks.figures import MM, PERCENT, Claim, Value


def _survey(key: str, reduce: str, scale: float = 1.0) -> Value:
    return Value("scans", f"survey/*/{key}", reduce, scale)


SCANS = (
    Claim(
        "readings farther than 3 cm from the true surface, before → after pre-processing, five surveys",
        "{0:.0f}-{1:.0f} % → {2:.2f} %",
        (
            _survey("far_before", "min", PERCENT),
            _survey("far_before", "max", PERCENT),
            _survey("far_after", "max", PERCENT),
        ),
        bar="<= 0.1 %",
        judged=2,
        is_headline=True,
    ),
    Claim(
        "median distance of the cloud from the true surface",
        "{0:.1f} mm",
        (_survey("median_after", "max", MM),),
        bar="<= 5 mm",
    ),
    Claim(
        "mixed pixels removed, the worst of five surveys",
        "{0:.1f} %",
        (_survey("mixed_removed", "min", PERCENT),),
        bar=">= 97 %",
        is_headline=True,
    ),
    Claim(
        "other readings kept, the worst of five surveys",
        "{0:.1f} %",
        (_survey("others_kept", "min", PERCENT),),
        bar=">= 97 %",
    ),
    Claim(
        "shaking in the plane of the scan that levelling leaves, the worst of five surveys",
        "{0:.3f}°",
        (Value("scans", "survey/*/in_plane_after_deg_max | survey/*/roll_after_deg", "max"),),
        bar="<= 0.1°",
        set_after=True,
    ),
    Claim(
        "largest error of the surveying robot's position",
        "{0:.1f} mm",
        (_survey("localisation_max", "max", MM),),
        bar="<= 10 mm",
    ),
    Claim(
        "largest error of its heading",
        "{0:.2f}°",
        (_survey("localisation_max_deg", "max"),),
        bar="<= 0.5°",
    ),
    Claim(
        "real scan: veils of mixed pixels removed",
        "{0:.0f} %",
        (Value("scans", "real_scan/veils_removed", scale=PERCENT),),
        bar=">= 90 %",
    ),
    Claim(
        "real scan: other beams kept",
        "{0:.1f} %",
        (Value("scans", "real_scan/others_kept", scale=PERCENT),),
        bar=">= 97 %",
    ),
    Claim(
        "pre-processing of a million readings (peak memory)",
        "{0:.1f} s ({1:.0f} MB)",
        (Value("scans", "speed/preprocess_million_beams_s"), Value("scans", "speed/preprocess_peak_mb")),
        bar="<= 2 s",
    ),
)
