"""Robustness of champions, and the cost of finding them."""

from benchmarks.figures import PERCENT, Claim, Value

_CHAMPIONS = "{0} of {1}; {2:.0f}; {3} ({4})"
_UNCONFIRMED = (
    "unconfirmed champions (how many of them succeed in at least 18 of 20 trials in the true arena)"
)


def _count_champions(part: str) -> tuple[Value, ...]:
    names = ("champions_that_hold", "of", "median_genotypes", "unconfirmed", "unconfirmed_that_hold")
    return tuple(Value("evolution", f"{part}/{name}") for name in names)


EVOLUTION = (
    Claim(
        "Runs of evolution in the scanned arena with a robust champion (default course, 8 modules, search from "
        f"zero); median number of genotypes; {_UNCONFIRMED}",
        _CHAMPIONS,
        _count_champions("champions"),
        bar=">= 5 of 5",
        is_headline=True,
    ),
    Claim(
        "Five more seeds, held out (one of the first five was used to tune when the search stops): runs with a robust "
        f"champion; median number of genotypes; {_UNCONFIRMED}",
        _CHAMPIONS,
        _count_champions("champions_held_out"),
        bar=">= 5 of 5",
    ),
    Claim(
        f"6 modules: runs with a robust champion; median number of genotypes; {_UNCONFIRMED}",
        _CHAMPIONS,
        _count_champions("six_modules"),
        bar=">= 3 of 5",
    ),
    Claim(
        "Bottomless pit of 0.37 m, scanned: runs with a robust champion; median number of genotypes; "
        f"{_UNCONFIRMED}",
        _CHAMPIONS,
        _count_champions("abyss"),
        bar=">= 3 of 5",
    ),
    Claim(
        "Default course, 8 modules, search from zero: median number of genotypes until the run ends",
        "{0:.0f}",
        (Value("evolution", "champions/median_genotypes"),),
        bar="<= 600",
    ),
    *(
        Claim(
            f"{words}: runs with a robust champion; median number of genotypes; {_UNCONFIRMED}",
            _CHAMPIONS,
            _count_champions(f"laws/{law}"),
        )
        for law, words in (
            ("travelling", "Controller `travelling` (angles instead of slopes)"),
            ("reactive from its hint", "Controller `reactive`, search from its hand-set genotype"),
        )
    ),
    Claim(
        "Default course, 8 modules: wall time of the five runs on 2 cores, median / longest",
        "{0:.0f} / {1:.0f} s",
        (
            Value("evolution", "champions/median_wall_seconds"),
            Value("evolution", "champions/runs/*/wall_seconds", "max"),
        ),
        bar="<= 300 s",
        bar_index=1,
    ),
    Claim(
        "Selection bias of validation: successes in validation, converted to 20 trials, minus successes in 20 final "
        "trials with a newly drawn seed; mean over confirmed champions (their number); over unconfirmed ones (their "
        "number)",
        "{0} ({1}); {2} ({3})",
        tuple(
            Value("evolution", f"gap/{key}")
            for key in ("mean_of_20", "of", "unconfirmed/mean_of_20", "unconfirmed/of")
        ),
        bar="<= 1.5",
        is_headline=True,
    ),
    *(
        Claim(
            f"Evolution first in an arena of a coarse GSRM (800 units), then in {words}: processor time of the fine "
            "arena alone divided by that of both (runs with a robust champion)",
            "{0:.1f} ({1} of {2})",
            (
                Value("evolution", f"stages_compared/{fine}/times_less_cpu_seconds"),
                *_count_champions(f"stages/{fine}")[:2],
            ),
            bar=">= 1.5",
        )
        for fine, words in (("gsrm 2200", "a GSRM of 2,200 units"), ("gg 13860", "a growing grid of 13,860"))
    ),
    Claim(
        "Evolution chooses the length of the body, 3 to 9 modules: shortest body found, smallest / largest over the "
        f"runs; runs with a robust champion; {_UNCONFIRMED}",
        "{0} / {1}; {2} of {3}; {4} ({5})",
        (
            Value("evolution", "body_length/runs/*/modules", "min"),
            Value("evolution", "body_length/runs/*/modules", "max"),
            *(value for value in _count_champions("body_length") if "genotypes" not in value.path),
        ),
        bar="<= 4 in each, as 4 suffice",
        bar_index=1,
        set_after=True,
    ),
    Claim(
        "Evolution chooses the length of the body, 3 to 9 modules: genotypes of still shorter bodies tried without "
        "success",
        "{0:,}",
        (Value("evolution", "body_length/runs/*/shorter_genotypes", "sum"),),
    ),
    Claim(
        "Overhead of evaluation over the physics steps alone, trials of equal length",
        "{0:.1f} %",
        (Value("evolution", "overhead/none of which ends before the others", scale=PERCENT),),
        bar="<= 10 %",
    ),
    Claim(
        "Evaluation of genotypes: speedup by a second thread",
        "{0:.2f}",
        (Value("evolution", "workers/speedup_of_two"),),
        bar=">= 1.7 on an idle machine",
    ),
    Claim(
        "Histories of the same run on 1, 2 and 4 threads and on 2 processes that are identical to the bit (Ray: see "
        "the tests)",
        "{0} of {1}",
        (Value("evolution", "backends/equal"), Value("evolution", "backends/of")),
        bar=">= 4 of 4",
    ),
    Claim(
        "Runs killed (SIGKILL) at random moments that, once resumed, end with the same champion and history as an "
        "uninterrupted run",
        "{0} of {1}",
        (Value("evolution", "kills/same_champion_and_history"), Value("evolution", "kills/kills")),
        bar=">= 20 of 20",
        is_headline=True,
    ),
)
