"""What contact is worth in a scanned arena."""

from benchmarks.figures import Claim, Value

ARENA = (
    Claim(
        "contact pieces from GSRM 2,200: mean distance from the truth (number of pieces)",
        "{0:.2f} mm ({1})",
        (
            Value("arena", "accuracy/gsrm 2200/mean_mm"),
            Value("arena", "accuracy/gsrm 2200/pieces"),
        ),
        bar="<= 1.0 mm",
        is_headline=True,
    ),
    Claim(
        "contact pieces from the growing grid: mean distance from the truth (number of pieces)",
        "{0:.2f} mm ({1})",
        (Value("arena", "accuracy/gg/mean_mm"), Value("arena", "accuracy/gg/pieces")),
        bar="<= 1.0 mm",
    ),
    Claim(
        "contact pieces from GSRM 800: mean distance from the truth (number of pieces)",
        "{0:.2f} mm ({1})",
        (Value("arena", "accuracy/gsrm 800/mean_mm"), Value("arena", "accuracy/gsrm 800/pieces")),
        bar="<= 2.0 mm",
    ),
    Claim(
        "GSRM 2,200, turned by 20° and cut to an irregular outline: mean distance (number of pieces)",
        "{0:.2f} mm ({1})",
        (
            Value("arena", "accuracy/gsrm 2200, yawed and cut/mean_mm"),
            Value("arena", "accuracy/gsrm 2200, yawed and cut/pieces"),
        ),
        bar="<= 1.0 mm",
    ),
    Claim(
        "real staircase: pieces against its own surface, mean distance (number of pieces)",
        "{0:.1f} mm ({1})",
        (
            Value("arena", "accuracy/real staircase, own surface/mean_mm"),
            Value("arena", "accuracy/real staircase, own surface/pieces"),
        ),
        bar="<= 4 mm",
    ),
    Claim(
        "physics step of a snake of 8 on the pieces of GSRM 2,200, and on the boxes of the truth",
        "{0:.0f} µs against {1:.0f} µs",
        (Value("arena", "steps_us/gsrm 2200"), Value("arena", "steps_us/boxes")),
    ),
)
