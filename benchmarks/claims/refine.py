"""Cost and side effects of updating a reconstruction with new readings."""

from benchmarks.figures import MM, Claim, Value

SIZES = {
    "gsrm 2200": "GSRM with 2,200 units",
    "gsrm 800": "GSRM with 800 units",
    "gg 13860": "growing grid with 13,860 triangles",
}


def _claim_change(size: str, words: str) -> tuple[Claim, Claim]:
    path = f"{size}/wall moved"
    return (
        Claim(
            f"Far wall of the pit moved by 5 cm, {words}: processor time of `refine` relative to a new reconstruction",
            "{0:.2f}",
            (Value("refine", f"{path}/cpu_ratio"),),
            bar="<= 0.25",
            is_headline=size == "gsrm 2200",
        ),
        Claim(
            f"Far wall moved, {words}: mean distance from the true surface to the mesh before → after `refine` (after "
            "a new reconstruction)",
            "{0:.1f} → {1:.2f} mm ({2:.2f} mm)",
            tuple(
                Value("refine", f"{path}/{when}/truth_to_mesh", scale=MM)
                for when in ("before", "after", "fresh")
            ),
        ),
    )


def _claim_all(size: str, words: str) -> tuple[Claim, ...]:
    return (
        Claim(
            f"Seven changes of the scene, with a tenth as many new readings as the first scan has, {words}: processor "
            "time of `refine` relative to a new reconstruction, worst and median",
            "{0:.2f}, {1:.2f}",
            (
                Value("refine", f"{size}/*/cpu_ratio", "max"),
                Value("refine", f"{size}/*/cpu_ratio", "median"),
            ),
            bar="<= 0.25",
        ),
        Claim(
            f"Seven changes of the scene, {words}: largest displacement of the mesh by `refine` where nothing changed",
            "{0:.2f} mm",
            (Value("refine", f"{size}/*/drift/max", "max", scale=MM),),
            bar="<= 2 mm",
            is_headline=size != "gsrm 800",
        ),
        Claim(
            f"Removed object that only a complete new scan shows, {words}: relative processor time of `refine`, and "
            "largest displacement where nothing changed",
            "{0:.2f}, {1:.2f} mm",
            (
                Value("refine", f"{size}, scanned anew/*/cpu_ratio"),
                Value("refine", f"{size}, scanned anew/*/drift/max", scale=MM),
            ),
            bar="<= 2 mm",
            bar_index=1,
            set_after=True,
        ),
    )


REFINE = tuple(
    claim
    for size, words in SIZES.items()
    for claim in (*_claim_change(size, words), *_claim_all(size, words))
)
