"""Every figure that README and documentation state, and where in `benchmarks/results` it comes from.

`python -m benchmarks.table` turns this list into text; a figure stands nowhere else.
"""

from benchmarks.figures import Claim, Value

MM = 1000.0
PERCENT = 100.0


def _distance(size: str, way: str = "truth_to_mesh", of: str = "mean") -> Value:
    return Value("reconstruction", f"sizes/{size}/{way}/{of}", scale=MM)


def _survey(key: str, reduce: str, scale: float = 1.0) -> Value:
    return Value("scans", f"survey/*/{key}", reduce, scale)


def _speed(arena: str) -> Value:
    return Value("environment", f"speed/{arena}: robot-seconds per second")


def _agreement(part: str, key: str) -> tuple[Value, Value]:
    path = f"{part}/{key}"
    return (
        Value("environment", path, pattern=r"(\d+) of \d+ agree"),
        Value("environment", path, pattern=r"of (\d+) agree"),
    )


SCANS = (
    Claim(
        "readings farther than 3 cm from the true surface, before -> after pre-processing, five surveys",
        "{0:.0f}-{1:.0f} % -> {2:.2f} %",
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
        "roll of the shaking scanner that levelling leaves, the worst of five surveys",
        "{0:.3f}°",
        (_survey("roll_after_deg", "max"),),
        bar="<= 0.1°",
    ),
    Claim(
        "largest error of the surveying robot's position",
        "{0:.1f} mm",
        (_survey("localisation_max", "max", MM),),
        bar="<= 10 mm",
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

RECONSTRUCTION = (
    Claim(
        "GSRM 2,200 units, 60,000 points: true surface -> mesh, mean (the authors' C program, same run)",
        "{0:.2f} mm ({1:.2f} mm)",
        (_distance("gsrm 2200"), _distance("gsrm 2200: C 2200")),
        bar="<= 1.0 mm",
        is_headline=True,
    ),
    Claim(
        "its time, as a share of the C program's",
        "{0:.2f}",
        (Value("reconstruction", "sizes/gsrm 2200/time_against_c"),),
        bar="<= 0.45",
        is_headline=True,
    ),
    Claim(
        "its boundary loops (one is the rim of the terrain); the C program's",
        "{0:.0f}; {1:.0f}",
        (
            Value("reconstruction", "sizes/gsrm 2200/boundary_loops/*", "max"),
            Value("reconstruction", "sizes/gsrm 2200: C 2200/boundary_loops/*", "max"),
        ),
        bar="<= 1",
    ),
    Claim(
        "GSRM 2,200 units: 95th percentile, true surface -> mesh",
        "{0:.1f} mm",
        (_distance("gsrm 2200", of="p95"),),
        bar="<= 2.6 mm",
    ),
    Claim(
        "GSRM 800 units: mean",
        "{0:.2f} mm",
        (_distance("gsrm 800"),),
        bar="<= 1.0 mm",
    ),
    Claim(
        "GSRM 800 units: time against the C program",
        "{0:.2f}",
        (Value("reconstruction", "sizes/gsrm 800/time_against_c"),),
        bar="<= 0.75",
    ),
    Claim(
        "GSRM 5,000 units: mean",
        "{0:.2f} mm",
        (_distance("gsrm 5000"),),
        bar="<= 1.25 mm",
    ),
    Claim(
        "GSRM 5,000 units: time against the C program",
        "{0:.2f}",
        (Value("reconstruction", "sizes/gsrm 5000/time_against_c"),),
        bar="<= 0.45",
    ),
    Claim(
        "growing grid, 13,860 triangles: true surface -> mesh, mean",
        "{0:.2f} mm",
        (_distance("gg 13860"),),
        bar="<= 1.4 mm",
        is_headline=True,
    ),
    Claim(
        "growing grid: time against the C program's GSRM of 2,200 units",
        "{0:.2f}",
        (Value("reconstruction", "sizes/gg 13860/time_against_c"),),
        bar="<= 0.60",
    ),
    Claim(
        "time grows with units to the power of, GSRM / grid",
        "{0:.2f} / {1:.2f}",
        (Value("reconstruction", "scaling/gsrm/exponent"), Value("reconstruction", "scaling/gg/exponent")),
        bar="<= 1.15",
    ),
    Claim(
        "cold start: a fresh process, GSRM 2,200",
        "{0:.1f} s",
        (Value("reconstruction", "start/gsrm"),),
        bar="<= 1.5 s",
    ),
)

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

ENVIRONMENT = (
    Claim(
        "robot-seconds per second, 8 modules, one thread: truth / gsrm / gg",
        "{0:.0f} / {1:.0f} / {2:.0f}",
        (_speed("truth"), _speed("gsrm"), _speed("gg")),
        bar=">= 60 on gsrm",
        judged=1,
        is_headline=True,
    ),
    Claim(
        "`env.step` against bare `mj_step`, gsrm",
        "{0:.2f}",
        (Value("environment", "speed/gsrm: over bare mj_step"),),
        bar="<= 1.10",
    ),
    Claim(
        "`reset`, gsrm",
        "{0:.1f} ms",
        (Value("environment", "speed/gsrm: reset [ms]"),),
        bar="<= 2 ms",
    ),
    Claim(
        "vector environment: two threads over one",
        "{0:.2f}",
        (Value("environment", "threads/two threads over one"),),
        bar=">= 1.7 on an idle machine",
    ),
    Claim(
        "5 ms physics agrees with 1 ms on who crosses, pit 0.30 m",
        "{0} of {1}",
        _agreement("timestep", "pit 0.30"),
        bar=">= 28 of 30",
        is_headline=True,
    ),
    Claim(
        "5 ms physics agrees with 1 ms on who crosses, pit 0.35 m",
        "{0} of {1}",
        _agreement("timestep", "pit 0.35"),
        bar=">= 28 of 30",
    ),
    Claim(
        "sphere tracks agree with wheels on joints, pit 0.35 m",
        "{0} of {1}",
        _agreement("tracks", "pit 0.35: wheels"),
        bar=">= 27 of 30",
    ),
    Claim(
        "sphere tracks agree with the authors' cylinders, pit 0.35 m",
        "{0} of {1}",
        _agreement("tracks", "pit 0.35: cylinders"),
        bar=">= 27 of 30",
    ),
    Claim(
        "cheats found by a second judge among the successes of random and of evolved episodes",
        "{0} in {1:,} + {2:,}",
        (
            Value("environment", "cheats/cheats"),
            Value("environment", "cheats/episodes/random"),
            Value("environment", "cheats/episodes/evolved"),
        ),
        bar="<= 0",
        is_headline=True,
    ),
)

STAIRCASE = (
    Claim(
        "real staircase: heights of its treads in the mesh against the scan, the worst of those judged",
        "{0:.1f} mm of {1} treads",
        (
            Value("staircase", "surfaces/beams/worst_height", scale=MM),
            Value("staircase", "surfaces/beams/judged"),
        ),
        is_headline=True,
    ),
    Claim(
        "real staircase: rise and tread in the mesh (known: 144 and 340 mm)",
        "{0:.1f} and {1:.1f} mm",
        (
            Value("staircase", "surfaces/beams/rise", scale=MM),
            Value("staircase", "surfaces/beams/tread", scale=MM),
        ),
    ),
    Claim(
        "modules of a snake of 8, evolved on these stairs, that stand above their first / second / third tread",
        "{0} / {1} / {2}",
        tuple(Value("staircase", f"drives/stairs/on_steps/{step}") for step in range(3)),
    ),
)

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
"""Sentences with figures of their own, for the README's list of limits."""

GROUPS: dict[str, tuple[Claim, ...]] = {
    "Scans": SCANS,
    "Reconstruction": RECONSTRUCTION,
    "Arenas": ARENA,
    "Environment": ENVIRONMENT,
    "A real staircase": STAIRCASE,
}
CLAIMS: tuple[Claim, ...] = tuple(claim for group in GROUPS.values() for claim in group)
