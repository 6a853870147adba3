"""What falls short: sentences with figures of their own, for the README."""

from benchmarks.figures import PERCENT, Claim, Value

LIMITS = (
    Claim(
        "speed loss of a sled over the seams",
        "A sled drawn over the seams between the pieces of a GSRM arena loses up to {0:.0f} % of its speed at one "
        "spot (growing grid: {1:.0f} %; wanted: 5 %).",
        (
            Value("arena", "sled/gsrm 2200/speed_loss", scale=PERCENT),
            Value("arena", "sled/gg/speed_loss", scale=PERCENT),
        ),
    ),
    Claim(
        "cost of the loop in Python",
        "The loop around the physics costs {0:.0f}-{1:.0f} % of a bare physics step.",
        (
            Value("environment", "speed/gg: over bare mj_step", scale=PERCENT, offset=-PERCENT),
            Value("environment", "speed/truth: over bare mj_step", scale=PERCENT, offset=-PERCENT),
        ),
    ),
)
