"""What contact is worth in a scanned arena."""

from benchmarks.figures import PERCENT, Claim, Value

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
        "one laser scan of 361 beams on the growing grid's exact surface, times that on the model made by hand (the "
        "paper: 66)",
        "{0:.2f}",
        (Value("arena", "scans/exact surface/over_hand_made"),),
        bar="<= 1.5",
        is_headline=True,
    ),
    Claim(
        "one laser scan: exact surface / contact pieces / height field / Embree",
        "{0:.0f} / {1:.0f} / {2:.0f} / {3:.0f} µs",
        tuple(
            Value("arena", f"scans/{way}/scan_us")
            for way in ("exact surface", "contact pieces", "height field", "Embree, exact surface")
        ),
    ),
    Claim(
        "random rays on which MuJoCo and Embree agree within 0.1 mm",
        "{0:,} of {1:,}",
        (Value("arena", "random_rays/within_0.1_mm"), Value("arena", "random_rays/both_hit")),
    ),
    Claim(
        "random waves (tried first) that cross on GSRM 2,200, or do not, as in the truth, of 30 (in the truth moved by "
        "1 mm)",
        "{0} ({1})",
        (
            Value("arena", "behaviour_of_waves/gsrm 2200/agree"),
            Value("arena", "behaviour_of_waves/truth moved by 1 mm/agree"),
        ),
        bar=">= 28",
        is_headline=True,
    ),
    Claim(
        "random postures (tried second) that cross on GSRM 2,200, or do not, as in the truth, of 30 (in the truth "
        "moved by 1 mm)",
        "{0} ({1})",
        (
            Value("arena", "behaviour/gsrm 2200/agree"),
            Value("arena", "behaviour/truth moved by 1 mm/agree"),
        ),
        bar=">= 28",
        set_after=True,
        is_headline=True,
    ),
    Claim(
        "the same on the growing grid: waves",
        "{0}",
        (Value("arena", "behaviour_of_waves/gg/agree"),),
        bar=">= 28",
    ),
    Claim(
        "the same on the growing grid: postures",
        "{0}",
        (Value("arena", "behaviour/gg/agree"),),
        bar=">= 28",
        set_after=True,
    ),
    Claim(
        "rank correlation of the way that postures make with that in the truth: GSRM 2,200, growing grid",
        "{0:.2f}, {1:.2f}",
        (
            Value("arena", "behaviour/gsrm 2200/rank_correlation"),
            Value("arena", "behaviour/gg/rank_correlation"),
        ),
        bar=">= 0.9",
        set_after=True,
    ),
    Claim(
        "largest kick of a sled over the seams of the ready-made gsrm, gg: how much higher than in the truth at the "
        "same place, left out 5 cm about the pit's walls (wheel on gsrm; sled on exact triangles)",
        "{0:.1f} mm, {1:.1f} mm ({2:.1f} mm; {3:.1f} mm)",
        (
            Value("arena", "sled/ready-made gsrm/kick_mm"),
            Value("arena", "sled/ready-made gg/kick_mm"),
            Value("arena", "wheel/ready-made gsrm/kick_mm"),
            Value("arena", "sled/exact triangles of ready-made gsrm/kick_mm"),
        ),
        bar="<= 2 mm",
        set_after=True,
    ),
    Claim(
        "largest loss of speed of a sled over the seams of the ready-made gsrm, gg (wheel on gsrm; sled on the truth "
        "moved by 1 mm; on exact triangles)",
        "{0:.1f} %, {1:.1f} % ({2:.1f} %; {3:.1f} %; {4:.0f} %)",
        (
            Value("arena", "sled/ready-made gsrm/speed_loss", scale=PERCENT),
            Value("arena", "sled/ready-made gg/speed_loss", scale=PERCENT),
            Value("arena", "wheel/ready-made gsrm/speed_loss", scale=PERCENT),
            Value("arena", "sled/truth moved by 1 mm along/speed_loss", scale=PERCENT),
            Value("arena", "sled/exact triangles of ready-made gsrm/speed_loss", scale=PERCENT),
        ),
        bar="<= 5 %",
    ),
    Claim(
        "physics step of a snake of 8 on the pieces of GSRM 2,200, and on the boxes of the truth",
        "{0:.0f} µs against {1:.0f} µs",
        (Value("arena", "steps_us/gsrm 2200"), Value("arena", "steps_us/boxes")),
    ),
)
