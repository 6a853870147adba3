"""Cheaper trials of a search: what they save until a champion is confirmed, and whether it holds in the truth."""

from benchmarks.figures import Claim, Value

_WAYS = {
    "coarse physics": "steps of 10 ms in place of 5",
    "short trials": "trials of 45 s in place of 90",
    "racing": "one trial each, the rest for those that succeed or are in the better half",
    "surrogate": "a Gaussian process over genes leaves out half of each generation",
}


def _speed_up(way: str, words: str) -> Claim:
    return Claim(
        f"Time to a confirmed champion with {words}: times faster than with full trials, median of seeds side by side "
        "(quartiles; champions that hold in the truth in 18 of 20 trials, of seeds)",
        "{0:.2f} ({1:.2f}-{2:.2f}; {3} of {4})",
        (
            Value("cheap_trials", f"summary/{way}/times_faster"),
            Value("cheap_trials", f"summary/{way}/quartiles/0"),
            Value("cheap_trials", f"summary/{way}/quartiles/1"),
            Value("cheap_trials", f"summary/{way}/held"),
            Value("cheap_trials", f"summary/{way}/seeds"),
        ),
        bar=">= 1.5",
    )


def _full() -> Claim:
    return Claim(
        "Processor time to a confirmed champion with full trials, median [s] (champions that hold, of seeds)",
        "{0:.0f} ({1} of {2})",
        tuple(Value("cheap_trials", f"summary/full/{name}") for name in ("cpu_seconds", "held", "seeds")),
    )


CHEAP_TRIALS = (_full(), *(_speed_up(way, words) for way, words in _WAYS.items()))
