"""The whole pipeline on a real scan."""

from benchmarks.figures import MM, Claim, Value

STAIRCASE = (
    Claim(
        "Real scan of a staircase: largest error of a tread's height in the mesh against the scan (treads with enough "
        "points to compare)",
        "{0:.1f} mm ({1})",
        (
            Value("staircase", "surfaces/beams/worst_height", scale=MM),
            Value("staircase", "surfaces/beams/judged"),
        ),
        is_headline=True,
    ),
    Claim(
        "Real scan of a staircase: mean height and depth of a step in the mesh (known: 144 and 340 mm)",
        "{0:.1f} and {1:.1f} mm",
        (
            Value("staircase", "surfaces/beams/rise", scale=MM),
            Value("staircase", "surfaces/beams/tread", scale=MM),
        ),
    ),
    Claim(
        "Snake of 8 modules evolved on these stairs: modules that end above the first / second / third tread",
        "{0} / {1} / {2}",
        tuple(Value("staircase", f"drives/stairs/on_steps/{step}") for step in range(3)),
    ),
)
