"""Friction of the ground, estimated by robots from their slip."""

from benchmarks.figures import Claim, Value

FRICTION = (
    Claim(
        "Friction felt by robots, patches of 0.3 to 0.9 on which they drove 1 m or more: 95 % intervals that hold the "
        "truth (of so many patches)",
        "{0:.0%} ({1})",
        (Value("friction", "patches/covered_share"), Value("friction", "patches/patches")),
        bar=">= 0.9",
        is_headline=True,
    ),
    Claim(
        "Friction felt by robots, the same patches: largest error",
        "{0:.3f}",
        (Value("friction", "patches/worst"),),
        bar="<= 0.05",
    ),
    Claim(
        "Friction felt by robots, the same patches: root mean square error, mean half-width of the interval",
        "{0:.3f}, {1:.3f}",
        (Value("friction", "patches/rms"), Value("friction", "patches/half_width")),
    ),
    Claim(
        "Champions of 5 seeds on a course with ice, which was changed after first figures: successes in the truth "
        "after evolution on what robots felt, and on one friction for all",
        "{0} and {1} of {2}",
        tuple(
            Value("friction", f"champions/{path}")
            for path in ("felt/successes", "one/successes", "one/trials")
        ),
    ),
)
