"""Arenas that follow a place that changes, and the robot that updates its model."""

from benchmarks.figures import MM, Claim, Value

PLACES = {"course": "the course", "held-out course": "a held-out course with a box elsewhere"}
CHANGED = {
    "box gone": "where a box was gone",
    "box added": "where a box was added",
    "wall moved": "where a wall had moved",
    "elsewhere": "elsewhere",
}

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
    *(
        Claim(
            "A Scout's round through a changed course (`symbrion live`, three seeds), mean distance of the true "
            f"surface from the model, {words}, largest before → after",
            "{0:.1f} → {1:.1f} mm",
            tuple(Value("living", f"live/*/errors/{place}/{k}", "max", scale=MM) for k in (0, 1)),
        )
        for place, words in CHANGED.items()
    ),
    Claim(
        "The same rounds, mean distance of the true friction of the ice from that of the model, largest before → after",
        "{0:.2f} → {1:.2f}",
        tuple(Value("living", f"live/*/friction/ice/error_{when}", "max") for when in ("before", "after")),
    ),
    Claim(
        "The same rounds, pairs of intersecting triangles in the model after, most",
        "{0}",
        (Value("living", "live/*/self_intersections/1", "max"),),
        bar="<= 0",
        set_after=True,
    ),
)
