"""Turn the results into text: the table of all claims, and the sections of the README that contain figures.

    python -m benchmarks.table [--check]

A claim whose part of the results was never measured is left out and reported; a number that is missing from a
measured part is an error.

The table of the main claims goes between `<!-- figures -->` and `<!-- /figures -->` of the README, the known limits
between `<!-- limits -->` and `<!-- /limits -->`. Nothing there is written by hand.

Git shows which figures are old, so tables are written only in a checkout with its whole history; elsewhere `--check`
compares everything else.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.ages import Ages, open_ages
from benchmarks.champions_table import make_champions_table
from benchmarks.claims import CLAIMS, GROUPS, LIMITS
from benchmarks.claims.baselines import BASELINES
from benchmarks.figures import Claim, ClaimError
from benchmarks.learning_table import make_learning_table
from benchmarks.origins import LEGEND, SET_AFTER, Records, describe_measuring, find_origins, strip_ages
from benchmarks.report import RESULTS, load_records
from reconstruction.files.atomic_write import write_atomically

README = Path(__file__).parents[1] / "README.md"
TABLE = RESULTS / "table.md"
HEAD = "| quantity | result | target | measured |\n|---|---|---|---|"


def main() -> None:
    """Write the texts, or check that they are up to date."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.table",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--check", action="store_true", help="change nothing; fail if a text is out of date")
    parser.add_argument(
        "--table-only", action="store_true", help="write only the table of all claims; skip what is missing"
    )
    options = parser.parse_args()
    records, ages = load_records(), open_ages()
    if options.table_only:
        _write(TABLE, make_table(records, is_lenient=True))
        print(TABLE.read_text())
        return
    if ages is None and not options.check:
        sys.exit(
            "git is needed to find which figures are old: write tables in a checkout with its whole history; "
            "`git fetch --unshallow` completes a shallow one"
        )
    try:
        wanted = {
            TABLE: make_table(records, ages=ages),
            README: fill_in(README.read_text(), records, ages),
        }
    except ClaimError as error:
        sys.exit(str(error))
    old = [path.name for path, text in wanted.items() if not is_up_to_date(path, text, ages)]
    if options.check and old:
        sys.exit(f"out of date: {', '.join(old)}; run `python -m benchmarks.table`")
    if options.check:
        return
    for path, text in wanted.items():
        _write(path, text)
    absent = [claim for claim in (*CLAIMS, *LIMITS) if not claim.is_measured(records)]
    for claim in absent:
        print(f"left out, not measured: {claim.file}: {claim.what}")
    print(f"{len(CLAIMS) + len(LIMITS) - len(absent)} claims; changed: {', '.join(old) or 'nothing'}")


def is_up_to_date(path: Path, text: str, ages: Ages | None) -> bool:
    """Return whether a file contains a text; without the whole history the marks of age are ignored."""
    present = path.read_text() if path.exists() else ""
    return present == text if ages else strip_ages(present) == strip_ages(text)


def make_table(records: Records, is_lenient: bool = False, ages: Ages | None = None) -> str:
    """Return the table of all measured claims as Markdown, by group.

    Args:
        records: what the benchmarks wrote.
        is_lenient: leave out claims without a figure instead of raising an error.
        ages: finds what is old; by default from the checkout of this file, if its history is complete.

    Raises:
        ClaimError: a claim has no figure.
    """
    origin, ages = describe_origin(records, CLAIMS), ages or open_ages()
    parts = [origin, LEGEND] if records else [origin]
    for title, claims in GROUPS.items():
        lines = [line for claim in claims if (line := _make_line(claim, records, ages, is_lenient))]
        if not lines:
            continue
        commands = dict.fromkeys(f"`python -m benchmarks.{claim.file}`" for claim in claims)
        parts += [f"## {title}", " and ".join(commands), "\n".join([HEAD, *lines])]
        if claims is GROUPS["Evolution"]:
            parts.append(make_champions_table(records, ages))
        if claims is BASELINES and (table := make_learning_table(records, ages)):
            parts.append(table)
    return "\n\n".join(parts) + "\n"


def fill_in(readme: str, records: Records, ages: Ages | None = None) -> str:
    """Return the README with its marked sections replaced; `ages` as in `make_table`.

    Raises:
        ClaimError: a claim has no figure, or a mark is missing.
    """
    claims = [claim for claim in CLAIMS if claim.is_headline and claim.is_measured(records)]
    ages = ages or open_ages()
    origin = describe_origin(records, claims)
    lines = [_make_line(claim, records, ages) for claim in claims]
    figures = "\n".join([origin, "", HEAD, *lines, "", LEGEND])
    limits = "\n".join(_make_limit(limit, records, ages) for limit in LIMITS if limit.is_measured(records))
    return replace_section(replace_section(readme, "figures", figures), "limits", limits)


def replace_section(text: str, mark: str, content: str) -> str:
    """Return the text with new content between `<!-- mark -->` and `<!-- /mark -->`.

    Raises:
        ClaimError: a mark is missing.
    """
    begin, end = f"<!-- {mark} -->", f"<!-- /{mark} -->"
    if text.count(begin) != 1 or text.count(end) != 1 or text.index(begin) > text.index(end):
        raise ClaimError(f"the text needs {begin} and then {end}, each exactly once")
    head, rest = text.split(begin)
    return f"{head}{begin}\n{content}\n{end}{rest.split(end)[1]}"


def describe_origin(records: Records, claims: Sequence[Claim]) -> str:
    """Return machine, versions and days of the results behind some claims."""
    places = dict.fromkeys(place for claim in claims for place in claim.find_parts(records))
    used = [records[file]["origins"][part] for file, part in places]
    if not used:
        return "Nothing was measured yet."
    machines = {
        "{cores} cores of an {processor}, {system}, Python {python}".format(**origin["machine"])
        for origin in used
    }
    versions = {"MuJoCo {mujoco}, JAX {jax}, coacd {coacd}".format(**origin["versions"]) for origin in used}
    days = sorted(origin["date"] for file, part in places for origin in find_origins(records[file], part))
    span = days[0] if days[0] == days[-1] else f"{days[0]} to {days[-1]}"
    return f"Measured on {' and '.join(sorted(machines))}; {' and '.join(sorted(versions))}; {span}."


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with write_atomically(path) as temporary:
        temporary.write_text(text)


def _make_line(claim: Claim, records: Records, ages: Ages | None, is_lenient: bool = False) -> str:
    if not claim.is_measured(records):
        return ""
    try:
        bar = claim.check_bar(records) + (SET_AFTER if claim.set_after else "")
        return f"| {claim.what} | {claim.format(records)} | {bar} | {_describe(claim, records, ages)} |"
    except ClaimError:
        if is_lenient:
            return ""
        raise


def _make_limit(limit: Claim, records: Records, ages: Ages | None) -> str:
    return f"- {limit.format(records)} (Measured {_describe(limit, records, ages)}.)"


def _describe(claim: Claim, records: Records, ages: Ages | None) -> str:
    return describe_measuring(claim.find_parts(records), records, ages, claim.sources)


if __name__ == "__main__":
    main()
