"""Arenas that follow a place that changes, and the robot that updates its model."""

from benchmarks.figures import MM, Claim, Value

PLACES = {"course": "the course", "held-out course": "a held-out course with a box elsewhere"}

LIVING = (
    *(
        Claim(
            f"Arena updated after a change, {words}: processor time relative to a new arena, worst and median of six "
            "changes",
            "{0:.2f}, {1:.2f}",
            (
                Value("living", f"{place}/*/cpu_ratio", "max"),
                Value("living", f"{place}/*/cpu_ratio", "median"),
            ),
            bar="<= 0.25",
        )
        for place, words in PLACES.items()
    ),
    Claim(
        "Arena of a room updated after a box was put on its floor: processor time relative to a new arena",
        "{0:.2f}",
        (Value("living", "room/cpu_ratio"),),
        bar="<= 0.25",
    ),
    Claim(
        "A Scout's round through a changed course (`symbrion live`, three seeds), mean distance of the true surface "
        "from the model where a box was gone, largest before → after",
        "{0:.1f} → {1:.1f} mm",
        (
            Value("living", "live/*/errors/box gone/0", "max", scale=MM),
            Value("living", "live/*/errors/box gone/1", "max", scale=MM),
        ),
    ),
)
