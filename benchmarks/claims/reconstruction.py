"""Accuracy and speed of the networks."""

from benchmarks.figures import MM, Claim, Value


def _distance(size: str, way: str = "truth_to_mesh", of: str = "mean") -> Value:
    return Value("reconstruction", f"sizes/{size}/{way}/{of}", scale=MM)


RECONSTRUCTION = (
    Claim(
        "GSRM with 2,200 units on 60,000 points: mean distance from the true surface to the mesh (the authors' C "
        "program in the same run)",
        "{0:.2f} mm ({1:.2f} mm)",
        (_distance("gsrm 2200"), _distance("gsrm 2200: C 2200")),
        bar="<= 1.0 mm",
        is_headline=True,
    ),
    Claim(
        "GSRM with 2,200 units: wall time relative to the authors' C program (below 1: faster)",
        "{0:.2f}",
        (Value("reconstruction", "sizes/gsrm 2200/time_against_c"),),
        bar="<= 0.45",
        is_headline=True,
    ),
    Claim(
        "GSRM with 2,200 units: boundary loops of the mesh (1 is correct: the outer edge); of the C program's mesh",
        "{0:.0f}; {1:.0f}",
        (
            Value("reconstruction", "sizes/gsrm 2200/boundary_loops/*", "max"),
            Value("reconstruction", "sizes/gsrm 2200: C 2200/boundary_loops/*", "max"),
        ),
        bar="<= 1",
    ),
    Claim(
        "GSRM with 2,200 units: 95th percentile of the distance from the true surface to the mesh",
        "{0:.1f} mm",
        (_distance("gsrm 2200", of="p95"),),
        bar="<= 2.6 mm",
    ),
    Claim(
        "GSRM with 800 units: mean distance from the true surface to the mesh",
        "{0:.2f} mm",
        (_distance("gsrm 800"),),
        bar="<= 1.0 mm",
    ),
    Claim(
        "GSRM with 800 units: wall time relative to the authors' C program",
        "{0:.2f}",
        (Value("reconstruction", "sizes/gsrm 800/time_against_c"),),
        bar="<= 0.75",
    ),
    Claim(
        "GSRM with 5,000 units: mean distance from the true surface to the mesh",
        "{0:.2f} mm",
        (_distance("gsrm 5000"),),
        bar="<= 1.25 mm",
    ),
    Claim(
        "GSRM with 5,000 units: wall time relative to the authors' C program",
        "{0:.2f}",
        (Value("reconstruction", "sizes/gsrm 5000/time_against_c"),),
        bar="<= 0.45",
    ),
    Claim(
        "Growing grid with 13,860 triangles: mean distance from the true surface to the mesh",
        "{0:.2f} mm",
        (_distance("gg 13860"),),
        bar="<= 1.4 mm",
        is_headline=True,
    ),
    Claim(
        "Growing grid with 13,860 triangles: wall time relative to the authors' C program for GSRM with 2,200 units",
        "{0:.2f}",
        (Value("reconstruction", "sizes/gg 13860/time_against_c"),),
        bar="<= 0.60",
    ),
    Claim(
        "Exponent with which the run time grows with the number of units: GSRM / growing grid (1: linear)",
        "{0:.2f} / {1:.2f}",
        (Value("reconstruction", "scaling/gsrm/exponent"), Value("reconstruction", "scaling/gg/exponent")),
        bar="<= 1.15",
    ),
    Claim(
        "GSRM with 2,200 units in a fresh process: wall time from the imports to the mesh (compiled programs cached)",
        "{0:.1f} s",
        (Value("reconstruction", "start/gsrm"),),
        bar="<= 1.5 s",
    ),
)
