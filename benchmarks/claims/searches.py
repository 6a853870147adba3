"""Islands and MAP-Elites beside CMA-ES and random genotypes, at an equal budget."""

from benchmarks.figures import Claim, Value

_NAMES = ("cmaes", "islands", "islands_apart", "elites", "random")


def _find(name: str) -> tuple[Value, ...]:
    return tuple(Value("searches", f"searches/summary/{each}/{name}") for each in _NAMES)


SEARCHES = (
    Claim(
        "96 genotypes of a traveling law, one trial each, searched on the scanned arena by CMA-ES, four islands that "
        "exchange, four that do not, MAP-Elites, and random ones: successes of the fittest in fresh trials in the true "
        "course, of all seeds together",
        "{0}, {1}, {2}, {3} and {4} of {5}",
        (*_find("successes"), Value("searches", "searches/summary/cmaes/trials")),
    ),
    Claim(
        "The same: kinds of behavior found, cells of an 8 x 8 grid of effort and time, mean of the seeds",
        "{0:.1f}, {1:.1f}, {2:.1f}, {3:.1f} and {4:.1f}",
        _find("cells"),
    ),
)
