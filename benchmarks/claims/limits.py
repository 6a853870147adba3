"""Known limits: sentences with their own figures, for the README."""

from benchmarks.figures import PERCENT, Claim, Value

LIMITS = (
    Claim(
        "cost of refine",
        "Updating a reconstruction takes up to {0:.0f} % of the processor time of a new one with GSRM (2,200 units) "
        "and {1:.0f} % with the growing grid (target: 25 %), in the worst of seven changes with a tenth as many new "
        "readings. After a wall has moved it takes {2:.0f} % and {3:.0f} %.",
        (
            Value("refine", "gsrm 2200/*/cpu_ratio", "max", scale=PERCENT),
            Value("refine", "gg 13860/*/cpu_ratio", "max", scale=PERCENT),
            Value("refine", "gsrm 2200/wall moved/cpu_ratio", scale=PERCENT),
            Value("refine", "gg 13860/wall moved/cpu_ratio", scale=PERCENT),
        ),
    ),
    Claim(
        "speed loss over seams",
        "An arena consists of convex contact pieces, and a sharp edge can catch where two of them meet (a seam). A "
        "test pulls a sharp-edged block (a sled) over all seams: at the worst place it loses {0:.1f} % (arena gsrm) "
        "and {1:.1f} % (gg) of its speed (target: 5 %). A wheel on gsrm loses {2:.1f} %; the sled on the exact "
        "triangles of the scan loses {3:.0f} %.",
        (
            Value("arena", "sled/ready-made gsrm/speed_loss", scale=PERCENT),
            Value("arena", "sled/ready-made gg/speed_loss", scale=PERCENT),
            Value("arena", "wheel/ready-made gsrm/speed_loss", scale=PERCENT),
            Value("arena", "sled/exact triangles of ready-made gsrm/speed_loss", scale=PERCENT),
        ),
    ),
    Claim(
        "tilt out of the scan plane",
        "A vertical scan shows the robot's tilt within the plane of the scan only. The tilt across this plane is "
        "estimated from the sway of the horizontal scanner, with an error: of {1:.2f}° (root mean square), {0:.2f}° "
        "remain. This displaces 95 % of the points on the arena's surface by at most {2:.1f} mm (worst survey).",
        (
            Value("scans", "survey/*/across_after_deg_rms", "max"),
            Value("scans", "survey/*/across_before_deg_rms", "max"),
            Value("scans", "survey/*/across_after_mm_p95", "max"),
        ),
    ),
    Claim(
        "outcomes on the authors' cylinders",
        "Of 30 random controllers, {0} cross a pit of 0.35 m on tracks made of spheres and {1} on wheels of the same "
        "shape, but {2} on the smaller cylinders of the authors' simulator. The outcome is the same for {3} of 30, "
        "but the controllers for which it differs are those that cross.",
        (
            Value("environment", "tracks/pit 0.35: spheres", pattern=r"(\d+) successes"),
            Value("environment", "tracks/pit 0.35: wheels", pattern=r"(\d+) successes"),
            Value("environment", "tracks/pit 0.35: cylinders", pattern=r"(\d+) successes"),
            Value("environment", "tracks/pit 0.35: cylinders", pattern=r"(\d+) of \d+ agree"),
        ),
    ),
    Claim(
        "coarse to fine",
        "Coarse-to-fine evolution does not pay off here. Beginning in a GSRM arena of 800 units gives {0:.1f} times "
        "the speed of evolution in one of 2,200 units alone (target: 1.5), or {1:.1f} times if genotypes are counted "
        "instead of processor time. A coarser model misleads: of {3} confirmed champions evolved on a growing grid of "
        "210 triangles, {2} are robust in the true arena.",
        (
            Value("evolution", "stages_compared/gsrm 2200/times_less_cpu_seconds"),
            Value("evolution", "stages_compared/gsrm 2200/times_less_genotypes"),
            Value("evolution", "models/gg 210/champions_that_hold"),
            Value("evolution", "models/gg 210/confirmed"),
        ),
    ),
    Claim(
        "overhead of `env.step`",
        "`env.step` costs {0:.0f} % more than the physics steps alone in a single environment (target: 10 %), and "
        "{1:.0f} % more in a vector environment of sixteen.",
        (
            Value("environment", "speed/gsrm: over bare mj_step", scale=PERCENT, offset=-PERCENT),
            Value("environment", "speed/gsrm: 16 at once over bare", scale=PERCENT, offset=-PERCENT),
        ),
    ),
    Claim(
        "bottomless pit",
        "Over a bottomless pit of 0.37 m, evolution in the scanned arena confirms {0} of {1} champions within 600 "
        "genotypes (target: 3 of 5). Of the others, {2} succeed in at least 18 of 20 trials in the true arena.",
        (
            Value("evolution", "abyss/confirmed"),
            Value("evolution", "abyss/of"),
            Value("evolution", "abyss/unconfirmed_that_hold"),
        ),
    ),
)
