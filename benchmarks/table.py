"""Turn the results into text: the table of all claims, and the sections of the README that hold figures.

    python -m benchmarks.table [--check]

A claim whose part of the results was never measured is left out, and named; one whose number has gone from its
part is an error.

Between `<!-- figures -->` and `<!-- /figures -->` of the README stands the table of the main claims, between
`<!-- limits -->` and `<!-- /limits -->` what is known to fall short. Nothing there is written by hand.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

from benchmarks.claims import CLAIMS, GROUPS, LIMITS
from benchmarks.figures import Claim, ClaimError
from benchmarks.report import RESULTS, load_records
from reconstruction.atomic_write import write_atomically

README = Path(__file__).parents[1] / "README.md"
TABLE = RESULTS / "table.md"
HEAD = "| what | figure | wanted |\n|---|---|---|"
Records = dict[str, dict[str, Any]]


def main() -> None:
    """Write the texts, or check that they are up to date."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.table",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--check", action="store_true", help="change nothing; fail where a text is out of date"
    )
    parser.add_argument(
        "--table-only", action="store_true", help="leave the README alone, skip what is missing"
    )
    options = parser.parse_args()
    records = load_records()
    if options.table_only:
        _write(TABLE, make_table(records, is_patient=True))
        print(TABLE.read_text())
        return
    try:
        wanted = {TABLE: make_table(records), README: fill_in(README.read_text(), records)}
    except ClaimError as error:
        sys.exit(str(error))
    old = [path.name for path, text in wanted.items() if not path.exists() or path.read_text() != text]
    if options.check and old:
        sys.exit(f"out of date: {', '.join(old)}; run `python -m benchmarks.table`")
    for path, text in wanted.items():
        _write(path, text)
    absent = [claim for claim in (*CLAIMS, *LIMITS) if not claim.is_measured(records)]
    for claim in absent:
        print(f"left out, not measured: {claim.file}: {claim.what}")
    print(f"{len(CLAIMS) + len(LIMITS) - len(absent)} claims; changed: {', '.join(old) or 'nothing'}")


def make_table(records: Records, is_patient: bool = False) -> str:
    """Return the table of all claims that were measured as Markdown, by group.

    Args:
        records: what the benchmarks wrote.
        is_patient: leave out claims without a figure rather than refuse.

    Raises:
        ClaimError: a claim has no figure.
    """
    parts = [describe_origin(records, [claim.file for claim in CLAIMS])]
    for title, claims in GROUPS.items():
        lines = [line for claim in claims if (line := _make_line(claim, records, is_patient))]
        if not lines:
            continue
        commands = dict.fromkeys(f"`python -m benchmarks.{claim.file}`" for claim in claims)
        parts += [f"## {title}", " and ".join(commands), "\n".join([HEAD, *lines])]
    return "\n\n".join(parts) + "\n"


def fill_in(readme: str, records: Records) -> str:
    """Return the README with its marked sections made anew.

    Raises:
        ClaimError: a claim has no figure, or a mark is missing.
    """
    claims = [claim for claim in CLAIMS if claim.is_headline and claim.is_measured(records)]
    origin = describe_origin(records, [claim.file for claim in claims])
    figures = "\n".join([origin, "", HEAD, *(_make_line(claim, records) for claim in claims)])
    limits = "\n".join(f"- {limit.format(records)}" for limit in LIMITS if limit.is_measured(records))
    return replace_section(replace_section(readme, "figures", figures), "limits", limits)


def replace_section(text: str, mark: str, content: str) -> str:
    """Return the text with other content between `<!-- mark -->` and `<!-- /mark -->`.

    Raises:
        ClaimError: a mark is missing.
    """
    begin, end = f"<!-- {mark} -->", f"<!-- /{mark} -->"
    if text.count(begin) != 1 or text.count(end) != 1 or text.index(begin) > text.index(end):
        raise ClaimError(f"the text needs {begin} and after it {end}, each once")
    head, rest = text.split(begin)
    return f"{head}{begin}\n{content}\n{end}{rest.split(end)[1]}"


def describe_origin(records: Records, files: list[str]) -> str:
    """Return one line: machine, versions and days of the results in these files."""
    used = [records[name] for name in dict.fromkeys(files) if name in records]
    if not used:
        return "Nothing was measured yet."
    machines = {
        "{cores} cores of an {processor}, {system}, Python {python}".format(**record["machine"])
        for record in used
    }
    versions = {"MuJoCo {mujoco}, JAX {jax}, coacd {coacd}".format(**record["versions"]) for record in used}
    days = sorted(record["date"] for record in used)
    span = days[0] if days[0] == days[-1] else f"{days[0]} to {days[-1]}"
    return f"Measured on {' and '.join(sorted(machines))}; {' and '.join(sorted(versions))}; {span}."


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with write_atomically(path) as beside:
        beside.write_text(text)


def _make_line(claim: Claim, records: Records, is_patient: bool = False) -> str:
    if not claim.is_measured(records):
        return ""
    try:
        remark = " (quick run)" if _is_quick(claim, records) else ""
        return f"| {claim.what} | {claim.format(records)}{remark} | {claim.judge(records)} |"
    except ClaimError:
        if is_patient:
            return ""
        raise


def _is_quick(claim: Claim, records: Records) -> bool:
    """Tell whether the part of the results that a claim is about comes from a quick run."""
    part = claim.find_part(records)
    whole = records.get(claim.file, {}).get("is_quick", False)
    return bool(part.get("is_quick", whole) if isinstance(part, dict) else whole)


if __name__ == "__main__":
    main()
