"""The landscape of bodies: the scan against the truth, and searches replayed on it."""

from benchmarks.figures import Claim, Value

_TASKS = {"pit": "a pit of 0.18 m", "stairs": "two steps of 0.05 m", "rough": "2 m of low hills"}
_HELD_OUT = {
    "gap": "a pit of 0.25 m",
    "low_stairs": "two steps of 0.04 m",
    "other_hills": "2 m of other low hills",
}
_SECOND_HELD_OUT = {
    "one_step": "a step of 0.05 m",
    "sill": "a bar of 0.05 m across the way",
    "steep_hills": "2 m of steep low hills",
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


def _reach(part: str, title: str) -> Claim:
    return Claim(
        f"{title}, looked up in a map of all small bodies: seeds of 10 that come within 5 % of the known optimum with "
        "a tenth of the exhaustive search's time (halving in niches; a prediction from shapes; successive halving "
        "alone; random search)",
        "{0} ({1}; {2}; {3}; {4})",
        tuple(
            Value("landscape", f"{part}/searches/{name}/reached")
            for name in ("freeze_thaw", "niches", "surrogate", "halving", "random")
        ),
        bar=">= 10",
    )


def _replay(task: str, place: str) -> Claim:
    return _reach(f"replays of {task}", f"Search for a body for {place}")


def _replay_other(task: str, place: str) -> Claim:
    return _reach(
        f"held out: {task}", f"Search for a body for {place}, on which this search was developed, too"
    )


def _hold_out(task: str, place: str) -> Claim:
    return _reach(
        f"held out: {task}", f"Held out: search for a body for {place}, on which nothing was developed"
    )


def _search_really(task: str, place: str) -> Claim:
    return Claim(
        f"Search for a body for {place} by physics, not looked up, in a tenth of the exhaustive time: seeds that come "
        "within 5 % of the known optimum (halving in niches likewise)",
        "{0} of {1} ({2} of {3})",
        tuple(
            Value("landscape", f"real {name} of {task}/{key}")
            for name in ("freeze_thaw", "niches")
            for key in ("reached", "of")
        ),
        bar=">= 5",
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
        for make in (_trust, _repeat, _lengthen, _replay, _beat, _search_really)
    ),
    *(_replay_other(task, place) for task, place in _HELD_OUT.items()),
    *(_hold_out(task, place) for task, place in _SECOND_HELD_OUT.items()),
)
