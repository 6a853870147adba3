"""What doing nothing and a random choice score."""

from benchmarks.figures import Claim, Value


def _value(path: str) -> Value:
    return Value("baselines", path)


BASELINES = (
    Claim(
        "default course, 8 modules, from the floor: crossings of 200 by doing nothing; by 50 random genotypes of "
        "the law `path` / `reactive`, four trials each",
        "{0}; {1} / {2}",
        tuple(_value(f"default_course/{who}") for who in ("zero", "random of path", "random of reactive")),
        bar="<= 10 of 200",
        is_headline=True,
    ),
    Claim(
        "likewise by the numbers set by hand for the law `reactive` / `travelling`, of 200 trials",
        "{0} / {1}",
        (_value("default_course/hint of reactive"), _value("default_course/hint of travelling")),
    ),
    Claim(
        "crossings by doing nothing with six modules, of 60 trials",
        "{0}",
        (_value("other_tasks/six modules"),),
    ),
    Claim(
        "crossings by doing nothing over an abyss of 0.36 m / 0.37 m, of 60 trials",
        "{0} / {1}",
        (_value("other_tasks/abyss/0.36"), _value("other_tasks/abyss/0.37")),
    ),
    Claim(
        "pit of 0.40 m, crossings by doing nothing with 6 / 7 / 8 modules, of 30 trials",
        "{0} / {1} / {2}",
        tuple(_value(f"widths/{modules}/successes/0.40") for modules in (6, 7, 8)),
    ),
    Claim(
        "pit of 0.42 m, likewise",
        "{0} / {1} / {2}",
        tuple(_value(f"widths/{modules}/successes/0.42") for modules in (6, 7, 8)),
    ),
)
