"""Each row of a table says when and at which commit it was measured."""

import json
from pathlib import Path

import pytest

from benchmarks import report, table
from benchmarks.ages import Ages
from benchmarks.claims import CLAIMS
from benchmarks.figures import Claim, Value
from benchmarks.origins import describe_measuring, find_origins, strip_ages
from evolution.search.provenance import Revision

MOMENT = {"date": "2026-11-21", "commit": "0123456789", "dirty": False}
PART = {**MOMENT, "is_quick": False, "machine": {}, "versions": {}}
PLACES = [("scans", "survey")]


class FixedAges(Ages):
    """Says the same of every commit."""

    def __init__(self, answer: bool | None) -> None:
        self.answer = answer

    def is_old(self, commit: str, sources: object) -> bool | None:
        return self.answer


def describe(age: bool | None, **changes: object) -> str:
    records = {"scans": {"origins": {"survey": PART | changes}, "results": {"survey": {}}}}
    return describe_measuring(PLACES, records, FixedAges(age))


def test_day_commit_and_marks() -> None:
    assert describe(False) == "2026-11-21, code commit 0123456"
    assert describe(True) == "2026-11-21, code commit 0123456, **old**"
    assert describe(None) == "2026-11-21, code commit 0123456, age unknown"
    assert describe(False, commit=None) == "2026-11-21, age unknown"
    assert describe(False, from_history=True) == "2026-11-21, result commit 0123456"
    assert describe(False, dirty=True) == "2026-11-21, code commit 0123456, uncommitted changes"
    assert describe(False, is_quick=True) == "2026-11-21, code commit 0123456 (quick run)"


def test_without_the_history_nothing_is_said_of_age() -> None:
    records = {"scans": {"origins": {"survey": PART}, "results": {"survey": {}}}}
    bare = describe_measuring(PLACES, records, None)
    assert (
        bare == strip_ages(describe(True)) == strip_ages(describe(None)) == "2026-11-21, code commit 0123456"
    )


def test_the_check_without_history_compares_the_rest(tmp_path: Path) -> None:
    file = tmp_path / "table.md"
    file.write_text("| a | 1 | 2026-11-21, code commit 0123456, **old** |")
    same, other = "| a | 1 | 2026-11-21, code commit 0123456 |", "| a | 2 | 2026-11-21, code commit 0123456 |"
    assert table.is_up_to_date(file, same, None)
    assert not table.is_up_to_date(file, other, None)
    assert not table.is_up_to_date(file, same, FixedAges(False))


def test_runs_have_origins_of_their_own() -> None:
    runs = [
        {"origin": MOMENT | {"date": day, "commit": day * 2}, "judging_seed": 1} for day in ("day 1", "day 2")
    ]
    record = {
        "origins": {"champions": PART, "gap": PART},
        "results": {"champions": {"runs": runs}, "gap": {"from_parts": ["champions"]}},
    }
    assert [origin["date"] for origin in find_origins(record, "gap")] == ["day 1", "day 2"]
    text = describe_measuring([("evolution", "gap")], {"evolution": record}, FixedAges(False))
    assert text == "day 1 to day 2, code commits day 1da, day 2da"
    del runs[0]["judging_seed"]
    assert "‡" in describe_measuring([("evolution", "gap")], {"evolution": record}, FixedAges(False))


def test_a_bar_set_after_its_figure_is_marked() -> None:
    assert not [claim.what for claim in CLAIMS if claim.set_after and not claim.bar]
    claim = Claim("width", "{0}", (Value("scans", "survey/width"),), bar="<= 1 mm", set_after=True)
    records = {"scans": {"origins": {"survey": PART}, "results": {"survey": {"width": 2}}}}
    assert "≤ 1 mm: **missed** † |" in table._make_line(claim, records, None)


def test_parts_keep_their_own_origin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report, "RESULTS", tmp_path)
    monkeypatch.setattr(report, "REVISION", Revision("a" * 40, is_dirty=False))
    report.write_results("moon", {"phases": 1, "tides": 2})
    monkeypatch.setattr(report, "REVISION", Revision("b" * 40, is_dirty=True))
    path = report.write_results("moon", {"tides": 2})
    record = json.loads(path.read_text())
    assert record["results"] == {"phases": 1, "tides": 2}
    assert [record["origins"][part]["commit"][0] for part in ("phases", "tides")] == ["a", "b"]
    assert [record["origins"][part]["dirty"] for part in ("phases", "tides")] == [False, True]
    assert record["origins"]["tides"]["machine"]["cores"]
    (tmp_path / "venus.json").write_text(json.dumps({"date": "2026-01-01", "results": {"phases": 1}}))
    assert report.load_records()["venus"]["results"] == {}, "nobody knows when or on what it was measured"
    assert report.load_record("mars") == {"origins": {}, "results": {}}


def test_every_part_and_every_run_of_the_results_has_an_origin() -> None:
    for name, record in report.load_records().items():
        for part in record["results"]:
            for origin in find_origins(record, part):
                assert {"date", "commit", "dirty"} <= set(origin), (name, part)
            assert {"machine", "versions", "is_quick"} <= set(record["origins"][part]), (name, part)
