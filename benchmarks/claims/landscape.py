"""The landscape of bodies: the scan against the truth, and searches replayed on it."""

from benchmarks.figures import Claim, Value

_TASKS = {"pit": "a pit of 0.18 m", "stairs": "two steps of 0.05 m", "rough": "2 m of low hills"}
_HELD_OUT = {
    "gap": "a pit of 0.25 m",
    "low_stairs": "two steps of 0.04 m",
    "other_hills": "2 m of other low hills",
}
_RIVALS = "random search, a plain genetic algorithm and plain MAP-Elites"


def _trust(task: str, place: str) -> Claim:
    return Claim(
        f"What all small bodies learned on a scan of {place}, tried in the exact place: rank correlation of fitness "
        "(bodies, mean difference)",
        "{0:.3f} ({1}, {2:.3f} m)",
        tuple(
            Value("landscape", f"map/{task}/{name}") for name in ("truth_rank", "bodies", "truth_difference")
        ),
        bar=">= 0.9",
    )


def _repeat(task: str, place: str) -> Claim:
    return Claim(
        f"The same genotypes on the scan of {place} under other conditions: rank correlation of both exams (mean "
        "difference)",
        "{0:.3f} ({1:.3f} m)",
        tuple(Value("landscape", f"map/{task}/{name}") for name in ("again_rank", "again_difference")),
    )


_AGAIN = Claim(
    "The published table of bodies, random bodies of all tasks and the arenas made again from nothing: equal to the "
    "bit (arenas)",
    "{0} of {1} ({2} of {3})",
    tuple(Value("landscape", f"again/{name}") for name in ("same", "of", "same_places", "places")),
)


def _lengthen(task: str, place: str) -> Claim:
    return Claim(
        f"The 20 fittest bodies of {place} with ten times the genotypes: place of the best of before; place before of "
        "the best of now (rank correlation of before and now, mean gain in fitness, bodies that succeed in all trials "
        "before and now)",
        "{0}; {1} ({2:.2f}, {3:.2f} m, {4} and {5})",
        tuple(
            Value("landscape", f"longer of {task}/{name}")
            for name in ("first_is_now", "best_was", "rank", "gain", "solved_before", "solved")
        ),
    )


def _list_reached(part: str) -> tuple[Value, ...]:
    """Return seeds that reached the goal: of the default search, and of three others."""
    searches = f"{part}/searches"
    first = Value("landscape", f"{searches}/freeze_thaw/reached | {searches}/niches/reached")
    others = ("surrogate", "halving", "random")
    return first, *(Value("landscape", f"{searches}/{name}/reached") for name in others)


def _reach(task: str, place: str) -> Claim:
    return Claim(
        f"Search for a body for {place}, looked up in the map of all small bodies: seeds of 10 that come within 5 % of "
        "the known optimum with a tenth of the exhaustive search's time (a prediction from shapes; "
        "successive halving alone; random search)",
        "{0} ({1}; {2}; {3})",
        _list_reached(f"replays of {task}"),
        bar=">= 10",
    )


def _hold_out(task: str, place: str) -> Claim:
    return Claim(
        f"Held out: search for a body for {place}, on which nothing was developed, looked up in a map of all small "
        "bodies: seeds of 10 that come within 5 % of the known optimum with a tenth of the exhaustive search's time (a "
        "prediction from shapes; successive halving alone; random search)",
        "{0} ({1}; {2}; {3})",
        _list_reached(f"held out: {task}"),
        bar=">= 10",
    )


def _beat(task: str, place: str) -> Claim:
    return Claim(
        f"The same for {place}: of {_RIVALS}, those whose area under the curve is smaller, with "
        "a 95 % interval of its own",
        "{0} of {1}",
        tuple(Value("landscape", f"replays of {task}/{name}") for name in ("beaten", "rivals")),
        bar=">= 3",
    )


LANDSCAPE = (
    _AGAIN,
    *(
        make(task, place)
        for task, place in _TASKS.items()
        for make in (_trust, _repeat, _lengthen, _reach, _beat)
    ),
    *(_hold_out(task, place) for task, place in _HELD_OUT.items()),
)
