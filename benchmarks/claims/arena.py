"""Accuracy and cost of contact in a scanned arena."""

from benchmarks.figures import PERCENT, Claim, Value

ARENA = (
    Claim(
        "Contact pieces made from a GSRM mesh of 2,200 units: mean distance from the true surface (number of pieces)",
        "{0:.2f} mm ({1})",
        (
            Value("arena", "accuracy/gsrm 2200/mean_mm"),
            Value("arena", "accuracy/gsrm 2200/pieces"),
        ),
        bar="<= 1.0 mm",
        is_headline=True,
    ),
    Claim(
        "Contact pieces made from a growing grid's mesh: mean distance from the true surface (number of pieces)",
        "{0:.2f} mm ({1})",
        (Value("arena", "accuracy/gg/mean_mm"), Value("arena", "accuracy/gg/pieces")),
        bar="<= 1.0 mm",
    ),
    Claim(
        "Contact pieces made from a GSRM mesh of 800 units: mean distance from the true surface (number of pieces)",
        "{0:.2f} mm ({1})",
        (Value("arena", "accuracy/gsrm 800/mean_mm"), Value("arena", "accuracy/gsrm 800/pieces")),
        bar="<= 2.0 mm",
    ),
    Claim(
        "Contact pieces made from a GSRM mesh of 2,200 units, rotated by 20° and cut to an irregular outline: mean "
        "distance from the true surface (number of pieces)",
        "{0:.2f} mm ({1})",
        (
            Value("arena", "accuracy/gsrm 2200, yawed and cut/mean_mm"),
            Value("arena", "accuracy/gsrm 2200, yawed and cut/pieces"),
        ),
        bar="<= 1.0 mm",
    ),
    Claim(
        "Contact pieces made from the real staircase's mesh: mean distance from that mesh (number of pieces)",
        "{0:.1f} mm ({1})",
        (
            Value("arena", "accuracy/real staircase, own surface/mean_mm"),
            Value("arena", "accuracy/real staircase, own surface/pieces"),
        ),
        bar="<= 4 mm",
    ),
    Claim(
        "Simulated laser scan (361 beams) on the growing grid's mesh: time relative to the model made by hand (in the "
        "paper: 66)",
        "{0:.2f}",
        (Value("arena", "scans/exact surface/over_hand_made"),),
        bar="<= 1.5",
        is_headline=True,
    ),
    Claim(
        "Time of one simulated laser scan in the growing grid's arena: exact surface / contact pieces / height field "
        "/ exact surface by Embree",
        "{0:.0f} / {1:.0f} / {2:.0f} / {3:.0f} µs",
        tuple(
            Value("arena", f"scans/{way}/scan_us")
            for way in ("exact surface", "contact pieces", "height field", "Embree, exact surface")
        ),
    ),
    Claim(
        "Random rays on which MuJoCo and Embree agree within 0.1 mm",
        "{0:,} of {1:,}",
        (Value("arena", "random_rays/within_0.1_mm"), Value("arena", "random_rays/both_hit")),
    ),
    Claim(
        "30 random open-loop oscillators (the kind of controller tried first), pit of 0.30 m: same outcome, crossing "
        "or failing, in the arena reconstructed with GSRM (2,200 units) as in the true one; in parentheses, how "
        "sensitive the test is: same outcome in the true arena raised by 1 mm",
        "{0} of 30 ({1})",
        (
            Value("arena", "behaviour_of_waves/gsrm 2200/agree"),
            Value("arena", "behaviour_of_waves/truth moved by 1 mm/agree"),
        ),
        bar=">= 28",
        is_headline=True,
    ),
    Claim(
        "30 random position-indexed postures (hinge angles by position on the course; tried second, after the "
        "oscillators), pit of 0.30 m: same outcome in the arena reconstructed with GSRM (2,200 units) as in the true "
        "one; in parentheses: in the true arena raised by 1 mm",
        "{0} of 30 ({1})",
        (
            Value("arena", "behaviour/gsrm 2200/agree"),
            Value("arena", "behaviour/truth moved by 1 mm/agree"),
        ),
        bar=">= 28",
        set_after=True,
        is_headline=True,
    ),
    Claim(
        "30 random open-loop oscillators, pit of 0.30 m: same outcome in the arena reconstructed with the growing "
        "grid as in the true one",
        "{0}",
        (Value("arena", "behaviour_of_waves/gg/agree"),),
        bar=">= 28",
    ),
    Claim(
        "30 random position-indexed postures, pit of 0.30 m: same outcome in the arena reconstructed with the growing "
        "grid as in the true one",
        "{0}",
        (Value("arena", "behaviour/gg/agree"),),
        bar=">= 28",
        set_after=True,
    ),
    Claim(
        "30 random position-indexed postures, pit of 0.30 m: rank correlation of the progress in the reconstructed "
        "arena with that in the true one, for GSRM (2,200 units), growing grid",
        "{0:.2f}, {1:.2f}",
        (
            Value("arena", "behaviour/gsrm 2200/rank_correlation"),
            Value("arena", "behaviour/gg/rank_correlation"),
        ),
        bar=">= 0.9",
        set_after=True,
    ),
    Claim(
        "Sharp-edged block (a sled) pulled over the seams between pieces of the arenas gsrm, gg: largest jump above "
        "its height at the same place in the true arena, without 5 cm around the walls of the pit (wheel on gsrm; sled "
        "on the exact triangles)",
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
        "Sharp-edged block (a sled) pulled over the seams between pieces of the arenas gsrm, gg: largest loss of speed "
        "(wheel on gsrm; sled in the true arena shifted by 1 mm along the course; sled on the exact triangles)",
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
        "Processor time of a physics step, snake of 8 modules: on the contact pieces from GSRM with 2,200 units, on "
        "the boxes of the true arena",
        "{0:.0f} µs against {1:.0f} µs",
        (Value("arena", "steps_us/gsrm 2200"), Value("arena", "steps_us/boxes")),
    ),
)
