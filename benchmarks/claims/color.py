"""Colors from readings to surface: error against the true ones, and cost."""

from benchmarks.figures import Claim, Value

GROUPS = {
    "courses": "Surveys with a camera of two courses",
    "held-out courses": "Surveys with a camera of four other courses, held out",
    "scenes": "Three made scenes",
    "held-out scenes": "Four made scenes, held out",
}
METHODS = {"gsrm": "GSRM, 2,200 units", "gg": "growing grid, 7,000 units"}

COLOR = (
    *(
        Claim(
            f"{words}: error of the texture against the true colors, 5 cm or more from their edges, largest root mean "
            "square (of 1)",
            "{0:.3f}",
            (Value("color", f"{group}/*/texture", "max"),),
            bar="<= 0.05",
        )
        for group, words in GROUPS.items()
    ),
    *(
        Claim(
            f"{GROUPS[group]}: error of the vertices' colors, likewise",
            "{0:.3f}",
            (Value("color", f"{group}/*/vertices", "max"),),
            bar="<= 0.05",
        )
        for group in GROUPS
    ),
    *(
        Claim(
            f"Colors in the survey of the pit, {words}: additional processor time of `reconstruct`, without and with "
            "all readings",
            "{0:.0f} %, {1:.0f} %",
            (
                Value("color", f"cost/{method}/share", scale=100),
                Value("color", f"cost/{method}/share with readings", scale=100),
            ),
            bar="<= 15 %",
        )
        for method, words in METHODS.items()
    ),
    Claim(
        "Texture of that arena, 1,024 x 1,024 texels: processor time, both networks",
        "{0:.1f} s, {1:.1f} s",
        (Value("color", "cost/gsrm/texture"), Value("color", "cost/gg/texture")),
    ),
)
