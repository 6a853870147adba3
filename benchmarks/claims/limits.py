"""What falls short: sentences with figures of their own, for the README."""

from benchmarks.figures import PERCENT, Claim, Value

LIMITS = (
    Claim(
        "cost of refine",
        "Of seven changes, told by a tenth of new readings, the dearest costs `refine` {0:.0f} % of a fresh "
        "run with GSRM 2,200 and {1:.0f} % with the growing grid (wanted: 25 %); a wall that has moved {2:.0f} % and "
        "{3:.0f} %.",
        (
            Value("refine", "gsrm 2200/*/cpu_ratio", "max", scale=PERCENT),
            Value("refine", "gg 13860/*/cpu_ratio", "max", scale=PERCENT),
            Value("refine", "gsrm 2200/wall moved/cpu_ratio", scale=PERCENT),
            Value("refine", "gg 13860/wall moved/cpu_ratio", scale=PERCENT),
        ),
    ),
    Claim(
        "speed loss of a sled over the seams",
        "A sled drawn over the seams between the pieces of the ready-made arenas loses up to {0:.1f} % (gsrm) and "
        "{1:.1f} % (gg) of its speed at one spot (wanted: 5 %; a wheel: {2:.1f} %; on the exact triangles of a scan: "
        "{3:.0f} %).",
        (
            Value("arena", "sled/ready-made gsrm/speed_loss", scale=PERCENT),
            Value("arena", "sled/ready-made gg/speed_loss", scale=PERCENT),
            Value("arena", "wheel/ready-made gsrm/speed_loss", scale=PERCENT),
            Value("arena", "sled/exact triangles of ready-made gsrm/speed_loss", scale=PERCENT),
        ),
    ),
    Claim(
        "lean across the plane of the scan",
        "Levelling sees the robot's lean in the plane of the scan. Across it {0:.2f}° of {1:.2f}° (root mean square) "
        "stay, which is {2:.1f} mm on the arena's surface at the 95th percentile; no scanner of the two sees more.",
        (
            Value("scans", "survey/*/across_after_deg_rms", "max"),
            Value("scans", "survey/*/across_before_deg_rms", "max"),
            Value("scans", "survey/*/across_after_mm_p95", "max"),
        ),
    ),
    Claim(
        "crossings on the authors' cylinders",
        "Of 30 random controllers {0} cross a pit of 0.35 m on sphere tracks and {1} on wheels of their shape, but {2} "
        "on the authors' smaller cylinders: agreement in {3} of 30 hides that those who cross are the ones who differ.",
        (
            Value("environment", "tracks/pit 0.35: spheres", pattern=r"(\d+) successes"),
            Value("environment", "tracks/pit 0.35: wheels", pattern=r"(\d+) successes"),
            Value("environment", "tracks/pit 0.35: cylinders", pattern=r"(\d+) successes"),
            Value("environment", "tracks/pit 0.35: cylinders", pattern=r"(\d+) of \d+ agree"),
        ),
    ),
    Claim(
        "coarse to fine",
        "Coarse to fine does not pay here: begun in a GSRM of 800 units, evolution is {0:.1f} times as fast as in one "
        "of 2,200 alone (wanted: 1.5), counted in genotypes {1:.1f} times. A still coarser model leads astray: of {3} "
        "confirmed champions of a grid of 210 triangles {2} hold in the truth.",
        (
            Value("evolution", "stages_compared/gsrm 2200/times_less_cpu_seconds"),
            Value("evolution", "stages_compared/gsrm 2200/times_less_genotypes"),
            Value("evolution", "models/gg 210/champions_that_hold"),
            Value("evolution", "models/gg 210/confirmed"),
        ),
    ),
    Claim(
        "cost of the loop in Python",
        "The loop around the physics costs {0:.0f} % of a bare physics step in a single environment (wanted: 10 %), "
        "{1:.0f} % with sixteen at once.",
        (
            Value("environment", "speed/gsrm: over bare mj_step", scale=PERCENT, offset=-PERCENT),
            Value("environment", "speed/gsrm: 16 at once over bare", scale=PERCENT, offset=-PERCENT),
        ),
    ),
)
