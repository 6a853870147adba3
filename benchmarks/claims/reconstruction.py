"""How near the networks come to the truth, and how fast."""

from benchmarks.figures import MM, Claim, Value


def _distance(size: str, way: str = "truth_to_mesh", of: str = "mean") -> Value:
    return Value("reconstruction", f"sizes/{size}/{way}/{of}", scale=MM)


RECONSTRUCTION = (
    Claim(
        "GSRM 2,200 units, 60,000 points: true surface → mesh, mean (the authors' C program, same run)",
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
        "GSRM 2,200 units: 95th percentile, true surface → mesh",
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
        "growing grid, 13,860 triangles: true surface → mesh, mean",
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
