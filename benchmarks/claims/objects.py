"""Known objects in scans of made rooms."""

from benchmarks.figures import Claim, Value

_WHERE = "20 surveys of made rooms with 0 to 6 sockets and clutter (noise 5 mm, beams 0.4° apart, held out)"

OBJECTS = (
    Claim(
        f"{_WHERE}: share of the sockets that were found",
        "{0:.1%}",
        (Value("objects", "sockets/recall"),),
        bar=">= 0.95",
    ),
    Claim(f"{_WHERE}: false finds", "{0:.0f}", (Value("objects", "sockets/false"),), bar="<= 1"),
    Claim(
        f"{_WHERE}: largest error of the position, mm",
        "{0:.1f}",
        (Value("objects", "sockets/position_mm_max"),),
        bar="<= 20",
    ),
    Claim(
        f"{_WHERE}: largest error of the angle, degrees",
        "{0:.1f}",
        (Value("objects", "sockets/angle_deg_max"),),
        bar="<= 5",
    ),
    Claim(
        f"{_WHERE}: processor time of a survey, s, of the slowest (median)",
        "{0:.1f} ({1:.1f})",
        (Value("objects", "sockets/cpu_s_max"), Value("objects", "sockets/cpu_s_median")),
        bar="<= 10",
    ),
)
