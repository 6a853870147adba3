"""The road with a real scan."""

from benchmarks.figures import MM, Claim, Value

STAIRCASE = (
    Claim(
        "real staircase: heights of its treads in the mesh against the scan, the worst of those judged",
        "{0:.1f} mm of {1} treads",
        (
            Value("staircase", "surfaces/beams/worst_height", scale=MM),
            Value("staircase", "surfaces/beams/judged"),
        ),
        is_headline=True,
    ),
    Claim(
        "real staircase: rise and tread in the mesh (known: 144 and 340 mm)",
        "{0:.1f} and {1:.1f} mm",
        (
            Value("staircase", "surfaces/beams/rise", scale=MM),
            Value("staircase", "surfaces/beams/tread", scale=MM),
        ),
    ),
    Claim(
        "modules of a snake of 8, evolved on these stairs, that stand above their first / second / third tread",
        "{0} / {1} / {2}",
        tuple(Value("staircase", f"drives/stairs/on_steps/{step}") for step in range(3)),
    ),
)
