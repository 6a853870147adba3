"""What a network that goes on learning costs, and what it leaves as it was."""

from benchmarks.figures import MM, Claim, Value


def _claim_change(size: str, words: str) -> tuple[Claim, Claim]:
    path = f"{size}/wall moved"
    return (
        Claim(
            f"the far wall of the pit has moved by 5 cm, {words}: share of a fresh run's processor time",
            "{0:.2f}",
            (Value("refine", f"{path}/cpu_ratio"),),
            bar="<= 0.25",
            is_headline=size == "gsrm 2200",
        ),
        Claim(
            f"{words}: mean distance, true surface → mesh, before → after (a fresh run)",
            "{0:.1f} → {1:.2f} mm ({2:.2f} mm)",
            tuple(
                Value("refine", f"{path}/{when}/truth_to_mesh", scale=MM)
                for when in ("before", "after", "fresh")
            ),
        ),
    )


REFINE = (
    *_claim_change("gsrm 2200", "GSRM 2,200"),
    *_claim_change("gg 13860", "growing grid, 13,860 triangles"),
    Claim(
        "drift of what did not change, GSRM 2,200: mean",
        "{0:.2f} mm",
        (Value("refine", "gsrm 2200/wall moved/drift/mean", scale=MM),),
        bar="<= 2 mm",
    ),
)
