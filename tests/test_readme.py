"""Every figure of the README comes from the results of the benchmarks."""

import copy
import re

import pytest

from benchmarks.ages import open_ages
from benchmarks.claims import CLAIMS, GROUPS, LIMITS
from benchmarks.figures import Claim, ClaimError, Value
from benchmarks.report import load_records
from benchmarks.table import README, TABLE, fill_in, is_up_to_date, make_table, replace_section

UNIT = r"(?:mm|cm|m|km|µs|ms|s|min|minutes|seconds|hours|Hz|%|°|degrees|MB|GB|N m|rad|times|x|×)"
NUMBER = re.compile(rf"(?<![\w.])\d[\d.,]*(?:\s*[-–/]\s*\d[\d.,]*)?\s?{UNIT}(?![\w])")
NOT_MEASURED = {"105 mm": "size of the Scout, `ScoutConfig`"}


def _cut_marked(text: str) -> str:
    """Return the prose: without the generated sections, code blocks and code in lines."""
    for mark in ("figures", "limits"):
        text = replace_section(text, mark, "")
    return re.sub(r"```.*?```|`[^`\n]*`", "", text, flags=re.DOTALL)


def test_readme_and_table_are_what_the_results_give() -> None:
    """What is old is compared, too, where the whole history can tell."""
    records, ages = load_records(), open_ages()
    readme = fill_in(README.read_text(), records, ages)
    assert is_up_to_date(README, readme, ages), "run `python -m benchmarks.table`"
    assert is_up_to_date(TABLE, make_table(records, ages=ages), ages), "run `python -m benchmarks.table`"


def test_prose_states_no_other_measurement() -> None:
    found = {match.group().strip() for match in NUMBER.finditer(_cut_marked(README.read_text()))}
    assert found <= set(NOT_MEASURED), "a figure needs a claim in benchmarks/claims/"


def test_number_finder_sees_what_it_must() -> None:
    text = "97.3-99.0 % of 2,200 units in 0.32 s, 5 ms, 12x, at 20°; 8 modules, section III, 2010"
    assert [match.group() for match in NUMBER.finditer(text)] == [
        "97.3-99.0 %",
        "0.32 s",
        "5 ms",
        "12x",
        "20°",
    ]


def test_claims_are_unique() -> None:
    words = [claim.what for claim in (*CLAIMS, *LIMITS)]
    assert len(words) == len(set(words))
    assert sum(claim.is_headline for claim in CLAIMS) <= 20, "the README is short"
    assert all(GROUPS.values())


def test_missing_path_is_named_with_claim_and_remedy() -> None:
    claim = Claim("weight of the moon", "{0:.1f} kg", (Value("moon", "phases/full/weight"),), bar="<= 1 kg")
    records = {"moon": {"results": {"phases": {"new": {}}}}}
    with pytest.raises(ClaimError, match=r"weight of the moon.*moon\.json.*'full'.*'new'.*benchmarks\.moon"):
        claim.format(records)
    with pytest.raises(ClaimError, match=r"weight of the moon.*no such file"):
        claim.format({})


def test_what_was_never_measured_is_not_claimed() -> None:
    records = copy.deepcopy(load_records())
    del records["scans"]["results"]["real_scan"]
    del records["environment"], records["audit"]
    table = make_table(records)
    assert "Real scan: share of all other readings that preprocessing keeps" not in table
    assert "## Environment" not in table
    assert "Real-time factor" not in fill_in(README.read_text(), records)
    assert make_table({}) == "Nothing was measured yet.\n"
    del records["scans"]["results"]["speed"]["preprocess_peak_mb"]
    with pytest.raises(ClaimError, match="peak memory"):
        make_table(records)


def test_values_are_reduced_scaled_and_taken_from_text() -> None:
    results = {"runs": [{"far": 0.1, "words": "29 of 30 agree"}, {"far": 0.3, "words": "28 of 30 agree"}]}
    assert Value("a", "runs/*/far", "max", scale=100.0).read(results) == pytest.approx(30.0)
    assert Value("a", "runs/1/far", scale=100.0, offset=-10.0).read(results) == pytest.approx(20.0)
    assert Value("a", "runs/*/words", "min", pattern=r"(\d+) of").read(results) == 28
    assert Value("a", "runs/*", "count").read(results) == 2
    assert Value("a", "models/gsrm 800/of").read({"models/gsrm 800": {"of": 5}}) == 5
    assert Value("a", "new/far | runs/0/far").read(results) == 0.1
    for bad in (Value("a", "runs/*/far"), Value("a", "runs"), Value("a", "runs/2/far"), Value("a", "far")):
        with pytest.raises(ClaimError):
            bad.read(results)
    with pytest.raises(ClaimError, match="median"):
        Value("a", "runs", reduce="mode")


@pytest.mark.parametrize(("number", "words"), [(0.9, "≤ 1.0 mm: met"), (1.1, "≤ 1.0 mm: **missed**")])
def test_bar_is_compared_with_its_number(number: float, words: str) -> None:
    claim = Claim("width", "{0:.1f} mm", (Value("a", "width"),), bar="<= 1.0 mm")
    assert claim.check_bar({"a": {"results": {"width": number}}}) == words
    with pytest.raises(ClaimError, match="a bar reads"):
        Claim("width", "{0}", (Value("a", "width"),), bar="small").check_bar(
            {"a": {"results": {"width": number}}}
        )


def test_changed_result_changes_the_readme() -> None:
    records, readme = copy.deepcopy(load_records()), README.read_text()
    records["scans"]["results"]["survey"][0]["far_after"] = 0.02
    assert "2.00 %" in fill_in(readme, records)
    assert "≤ 0.1 %: **missed**" in fill_in(readme, records)


def test_marks_must_be_there() -> None:
    with pytest.raises(ClaimError, match="<!-- figures -->"):
        replace_section("no marks", "figures", "")
    assert replace_section("a\n<!-- x -->\nold\n<!-- /x -->\nb", "x", "new").split("\n")[2] == "new"
