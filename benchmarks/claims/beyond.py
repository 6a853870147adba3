"""Beyond the map of small bodies: evolved bodies of up to twelve modules against snakes."""

from benchmarks.figures import Claim, Value

_WORDS = {
    "stairs": "three steps of 0.07 m",
    "pit": "a pit of 0.45 m",
    "rubble": "held-out rubble",
}
MEASURED: tuple[str, ...] = ("stairs", "pit", "rubble")
"""Places of which all five seeds are measured."""


def make_claims(place: str) -> tuple[Claim, ...]:
    """Return the claims of a place."""
    numbers = ("hold", "of", "snakes_hold")
    return (
        Claim(
            f"Search for a body of up to 12 modules with two degrees of freedom for {_WORDS[place]}, on a scan: "
            "seeds whose champion succeeds in at least 18 of 20 trials in the exact place (best snakes likewise)",
            "{0} of {1} ({2})",
            tuple(Value("beyond", f"{place}/{name}") for name in numbers),
            bar=">= 5 of 5",
        ),
        Claim(
            f"The same for {_WORDS[place]}: seeds in which the evolved body is better than the best snake of as many "
            "modules (seeds in which it is a snake itself)",
            "{0} of {1} ({2})",
            tuple(Value("beyond", f"{place}/{name}") for name in ("better", "of", "rows")),
            bar=">= 5 of 5",
        ),
    )


BEYOND = tuple(claim for place in MEASURED for claim in make_claims(place))
