"""Whether the networks' surfaces fold or pass through themselves."""

from benchmarks.figures import Claim, Value

GROUPS = {
    "surveys": "ten surveys of each pit (0.40 and 0.45 m) that the networks were mended on",
    "held-out surveys": "ten more surveys of the 0.40 m pit",
    "held-out ground": "other pits, stairs, natural terrain, hills, uneven density, the real staircase",
    "changes": "refined after each of eight changes",
}

FOLDS = tuple(
    Claim(
        f"{words}: {what}, the most on any surface of either network",
        "{0:.0f}",
        (Value("folds", f"{group}/*/{name}", "max"),),
        bar="<= 0",
    )
    for group, words in GROUPS.items()
    for name, what in (("self_intersections", "pairs of intersecting triangles"), ("folds", "folds"))
)
