"""Folds and self-intersections of the networks' surfaces."""

from benchmarks.figures import Claim, Value

GROUPS = {
    "surveys": "Ten simulated surveys of each pit (0.40 and 0.45 m), used for development",
    "held-out surveys": "Ten more surveys of the 0.40 m pit, held out",
    "held-out ground": "Other pits, stairs, natural terrain, hills, uneven density, the real staircase",
    "changes": "Eight changes of the scene, after `refine`",
}

FOLDS = tuple(
    Claim(
        f"{words}: {what} of a surface, largest count over all surfaces of both networks",
        "{0:.0f}",
        (Value("folds", f"{group}/*/{name}", "max"),),
        bar="<= 0",
    )
    for group, words in GROUPS.items()
    for name, what in (
        ("self_intersections", "pairs of intersecting triangles"),
        ("folds", "folds (edges where the surface doubles back)"),
    )
)
