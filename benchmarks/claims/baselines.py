"""Success of zero actions, of random actions and of random genotypes."""

from benchmarks.figures import Claim, Value


def _value(path: str) -> Value:
    return Value("baselines", path)


BASELINES = (
    Claim(
        "Default course, 8 modules, start on the floor: successes in 200 trials with zero actions; in 200 trials of 50 "
        "random genotypes (parameters of a controller, kept for the whole trial) of the controller `path` / "
        "`reactive`; in 200 episodes with random actions (drawn again at every step)",
        "{0}; {1} / {2}; {3}",
        (
            *(_value(f"default_course/{who}") for who in ("zero", "random of path", "random of reactive")),
            _value("random_actions/successes"),
        ),
        bar="<= 10 of 200 with zero actions",
        is_headline=True,
    ),
    Claim(
        "Default course, 8 modules: successes in 200 trials with the hand-set genotype of the controller `reactive` / "
        "`travelling`",
        "{0} / {1}",
        (_value("default_course/hint of reactive"), _value("default_course/hint of travelling")),
    ),
    Claim(
        "Default course, 6 modules: successes in 60 trials without control",
        "{0}",
        (_value("other_tasks/six modules"),),
    ),
    Claim(
        "Bottomless pit of 0.36 m / 0.37 m, 8 modules: successes in 60 trials without control",
        "{0} / {1}",
        (_value("other_tasks/abyss/0.36"), _value("other_tasks/abyss/0.37")),
    ),
    Claim(
        "Pit of 0.40 m, 6 / 7 / 8 modules: successes in 30 trials without control",
        "{0} / {1} / {2}",
        tuple(_value(f"widths/{modules}/successes/0.40") for modules in (6, 7, 8)),
    ),
    Claim(
        "Pit of 0.42 m, 6 / 7 / 8 modules: successes in 30 trials without control",
        "{0} / {1} / {2}",
        tuple(_value(f"widths/{modules}/successes/0.42") for modules in (6, 7, 8)),
    ),
)
