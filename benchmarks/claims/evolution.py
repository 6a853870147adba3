"""Whether champions hold, and what they cost."""

from benchmarks.figures import PERCENT, Claim, Value


def _count_champions(part: str) -> tuple[Value, ...]:
    names = ("champions_that_hold", "of", "median_genotypes", "unconfirmed", "unconfirmed_that_hold")
    return tuple(Value("evolution", f"{part}/{name}") for name in names)


EVOLUTION = (
    Claim(
        "runs whose champion, evolved and confirmed in the scanned arena, crosses in at least 18 of 20 fresh trials in "
        "the true one (default course, 8 modules, from zero); genotypes in the median; unconfirmed champions (of which "
        "as many cross)",
        "{0} of {1}; {2:.0f}; {3} ({4})",
        _count_champions("champions"),
        bar=">= 5 of 5",
        is_headline=True,
    ),
    Claim(
        "likewise by five seeds that were held out: the search's patience was set by a look at one of the first five",
        "{0} of {1}; {2:.0f}; {3} ({4})",
        _count_champions("champions_held_out"),
        bar=">= 5 of 5",
    ),
    Claim(
        "likewise with 6 modules",
        "{0} of {1}; {2:.0f}; {3} ({4})",
        _count_champions("six_modules"),
        bar=">= 3 of 5",
    ),
    Claim(
        "likewise over an abyss of 0.37 m, scanned, where only a bridge counts",
        "{0} of {1}; {2:.0f}; {3} ({4})",
        _count_champions("abyss"),
        bar=">= 3 of 5",
    ),
    Claim(
        "genotypes tried in the median, default course, 8 modules, from zero",
        "{0:.0f}",
        (Value("evolution", "champions/median_genotypes"),),
        bar="<= 600",
    ),
    *(
        Claim(f"likewise {words}", "{0} of {1}; {2:.0f}; {3} ({4})", _count_champions(f"laws/{law}"))
        for law, words in (
            ("travelling", "by a law of angles instead of slopes"),
            ("reactive from its hint", "by reflexes that begin from numbers set by hand"),
        )
    ),
    Claim(
        "wall time of the five runs with 8 modules on 2 cores, median / longest",
        "{0:.0f} / {1:.0f} s",
        (
            Value("evolution", "champions/median_wall_seconds"),
            Value("evolution", "champions/runs/*/wall_seconds", "max"),
        ),
        bar="<= 300 s",
        judged=1,
    ),
    Claim(
        "how much better validation was than the final test by seeds drawn with the row, trials of 20, mean over "
        "confirmed champions (how many); over unconfirmed ones",
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
            f"first in a GSRM of 800 units, then in {words}: times as fast as in it alone",
            "{0:.1f} ({1} of {2} are confirmed and hold)",
            (
                Value("evolution", f"stages_compared/{fine}/times_less_cpu_seconds"),
                *_count_champions(f"stages/{fine}")[:2],
            ),
            bar=">= 1.5",
        )
        for fine, words in (("gsrm 2200", "a GSRM of 2,200 units"), ("gg 13860", "a growing grid of 13,860"))
    ),
    Claim(
        "modules of the shortest body that holds, of 3 to 9 to choose from, least / most by seed; confirmed and hold "
        "in truth; unconfirmed (of which as many hold)",
        "{0} / {1}; {2} of {3}; {4} ({5})",
        (
            Value("evolution", "body_length/runs/*/modules", "min"),
            Value("evolution", "body_length/runs/*/modules", "max"),
            *(value for value in _count_champions("body_length") if "genotypes" not in value.path),
        ),
        bar="<= 4 in each, as 4 suffice",
        judged=1,
        set_after=True,
    ),
    Claim(
        "genotypes of still shorter bodies that these runs tried in vain",
        "{0:,}",
        (Value("evolution", "body_length/runs/*/shorter_genotypes", "sum"),),
    ),
    Claim(
        "overhead of the loop over bare stepping, trials of equal length",
        "{0:.1f} %",
        (Value("evolution", "overhead/none of which ends before the others", scale=PERCENT),),
        bar="<= 10 %",
    ),
    Claim(
        "two threads over one",
        "{0:.2f}",
        (Value("evolution", "workers/speedup_of_two"),),
        bar=">= 1.7 on an idle machine",
    ),
    Claim(
        "histories on 1, 2 and 4 threads and on 2 processes that are equal to the bit (Ray: by a test)",
        "{0} of {1}",
        (Value("evolution", "backends/equal"), Value("evolution", "backends/of")),
        bar=">= 4 of 4",
    ),
    Claim(
        "runs killed by signal 9 at random moments that end, resumed, as if they had not been",
        "{0} of {1}",
        (Value("evolution", "kills/same_champion_and_history"), Value("evolution", "kills/kills")),
        bar=">= 20 of 20",
        is_headline=True,
    ),
)
