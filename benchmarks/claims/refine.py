"""What a network that goes on learning costs, and what it leaves as it was."""

from benchmarks.figures import MM, Claim, Value

SIZES = {
    "gsrm 2200": "GSRM 2,200",
    "gsrm 800": "GSRM 800",
    "gg 13860": "growing grid, 13,860 triangles",
}


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


def _claim_all(size: str, words: str) -> tuple[Claim, ...]:
    return (
        Claim(
            f"{words}: share of a fresh run's processor time, the worst and the median of seven changes told by a "
            "tenth of new readings",
            "{0:.2f}, {1:.2f}",
            (
                Value("refine", f"{size}/*/cpu_ratio", "max"),
                Value("refine", f"{size}/*/cpu_ratio", "median"),
            ),
            bar="<= 0.25",
        ),
        Claim(
            f"{words}: drift of what did not change, the farthest place in seven changes",
            "{0:.2f} mm",
            (Value("refine", f"{size}/*/drift/max", "max", scale=MM),),
            bar="<= 2 mm",
            is_headline=size != "gsrm 800",
        ),
        Claim(
            f"{words}: likewise share and drift where a whole new scan tells that readings have stopped",
            "{0:.2f}, {1:.2f} mm",
            (
                Value("refine", f"{size}, scanned anew/*/cpu_ratio"),
                Value("refine", f"{size}, scanned anew/*/drift/max", scale=MM),
            ),
            bar="<= 2 mm",
            judged=1,
            set_after=True,
        ),
    )


REFINE = tuple(
    claim
    for size, words in SIZES.items()
    for claim in (*_claim_change(size, words), *_claim_all(size, words))
)
