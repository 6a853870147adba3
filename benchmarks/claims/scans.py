"""Accuracy of the scans after preprocessing."""

from benchmarks.figures import MM, PERCENT, Claim, Value


def _survey(key: str, reduce: str, scale: float = 1.0) -> Value:
    return Value("scans", f"survey/*/{key}", reduce, scale)


SCANS = (
    Claim(
        "Simulated scans (five surveys): share of readings more than 3 cm from the true surface, before preprocessing "
        "→ after it (worst survey)",
        "{0:.0f}-{1:.0f} % → {2:.2f} %",
        (
            _survey("far_before", "min", PERCENT),
            _survey("far_before", "max", PERCENT),
            _survey("far_after", "max", PERCENT),
        ),
        bar="<= 0.1 %",
        bar_index=2,
        is_headline=True,
    ),
    Claim(
        "Simulated scans: median distance of the preprocessed readings from the true surface, worst survey",
        "{0:.1f} mm",
        (_survey("median_after", "max", MM),),
        bar="<= 5 mm",
    ),
    Claim(
        "Simulated scans: share of mixed pixels (false readings at edges) that preprocessing removes, worst of five "
        "surveys",
        "{0:.1f} %",
        (_survey("mixed_removed", "min", PERCENT),),
        bar=">= 97 %",
        is_headline=True,
    ),
    Claim(
        "Simulated scans: share of readings other than mixed pixels that preprocessing keeps, worst of five surveys",
        "{0:.1f} %",
        (_survey("others_kept", "min", PERCENT),),
        bar=">= 97 %",
    ),
    Claim(
        "Simulated scans: largest error of the robot's tilt within the scan plane after leveling, worst of five "
        "surveys",
        "{0:.3f}°",
        (Value("scans", "survey/*/in_plane_after_deg_max | survey/*/roll_after_deg", "max"),),
        bar="<= 0.1°",
        set_after=True,
    ),
    Claim(
        "Simulated scans: largest error of the surveying robot's estimated position",
        "{0:.1f} mm",
        (_survey("localisation_max", "max", MM),),
        bar="<= 10 mm",
    ),
    Claim(
        "Simulated scans: largest error of the surveying robot's estimated heading",
        "{0:.2f}°",
        (_survey("localisation_max_deg", "max"),),
        bar="<= 0.5°",
    ),
    Claim(
        "Real scan: share of mixed pixels removed (readings more than 10 cm from both neighbors, in the same "
        "direction)",
        "{0:.0f} %",
        (Value("scans", "real_scan/veils_removed", scale=PERCENT),),
        bar=">= 90 %",
    ),
    Claim(
        "Real scan: share of all other readings that preprocessing keeps",
        "{0:.1f} %",
        (Value("scans", "real_scan/others_kept", scale=PERCENT),),
        bar=">= 97 %",
    ),
    Claim(
        "Preprocessing one million readings: wall time (peak memory)",
        "{0:.1f} s ({1:.0f} MB)",
        (Value("scans", "speed/preprocess_million_beams_s"), Value("scans", "speed/preprocess_peak_mb")),
        bar="<= 2 s",
    ),
)
