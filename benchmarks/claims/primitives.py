"""Primitives in place of triangles: what a scan costs and how far its ranges are off."""

from benchmarks.figures import Claim, Value

SCENES = {
    "gsrm": "the course by GSRM",
    "gg": "the course by the growing grid",
    "room": "a furnished room",
    "bare room": "a bare room",
    "warehouse": "a hall with columns and crates",
    "office": "an office, seen once before the last setting",
    "corridor": "a corridor, seen once before the last setting",
}

PRIMITIVES = tuple(
    claim
    for name, words in SCENES.items()
    for claim in (
        Claim(
            f'Arena of the kind "mixed", {words}: time of a scan of 361 beams, relative to the exact mesh',
            "{0:.2f}",
            (Value("primitives", f"scenes/{name}/ratio"),),
            bar="<= 0.7",
        ),
        Claim(
            f'Arena of the kind "mixed", {words}: difference of ranges from the exact mesh, mm, 95th percentile (mean)',
            "{0:.1f} ({1:.1f})",
            (
                Value("primitives", f"scenes/{name}/mixed_to_exact/p95_mm"),
                Value("primitives", f"scenes/{name}/mixed_to_exact/mean_mm"),
            ),
            bar="<= 2",
        ),
    )
)
