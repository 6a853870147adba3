"""The evidence of a release: whole, and of the code that is released."""

import json
import sys
import time

import pytest

from benchmarks.evidence import __main__ as evidence
from benchmarks.evidence.row import ROWS


@pytest.mark.parametrize(
    ("changes", "changed", "message"),
    [
        ({}, "", None),
        ({"vector": {"failed": "took longer"}}, "", "lacks, or failed at, vector"),
        ({}, "evolution/__init__.py", "after which the code changed: evolution"),
        ({}, None, "after which the code changed"),  # a commit that git does not know
    ],
)
def test_a_release_needs_whole_evidence_of_its_code(changes, changed, message, monkeypatch) -> None:
    monkeypatch.setattr(evidence, "run_git", lambda *words: changed)
    record = {"about": {"commit": "abc"}, "rows": {name: {"said": "1"} for name in ROWS} | changes}
    if message is None:
        evidence.check_tree(record)
        return
    with pytest.raises(SystemExit, match=message):
        evidence.check_tree(record)
    with pytest.raises(SystemExit, match="lacks"):
        evidence.check_tree({})


def test_the_page_is_made_of_the_figures() -> None:
    record = json.loads(evidence.RESULTS.read_text())
    assert evidence.PAGE.read_text() == evidence.make_page(record)


def test_every_target_is_judged_by_its_figures() -> None:
    assert all(bool(row.target) == (row.met is not None) for row in ROWS.values())
    for speed, verdict in ((99.0, "at least 100: missed"), (100.0, "at least 100")):
        assert ROWS["vector"].judge({"robot_s_per_s": speed, "said": ""}) == verdict
    alone = {"truth_to_mesh_mm": 0.9, "faults": 0, "said": ""}
    assert ROWS["gsrm"].judge(alone).endswith(": not all measured")
    assert ROWS["gsrm"].judge(alone | {"faults": 1}).endswith(": missed")
    assert ROWS["vector"].judge({"failed": "took longer"}) == "at least 100"


@pytest.mark.skipif(sys.platform == "win32", reason="no process groups")
def test_a_row_that_takes_too_long_is_ended_with_its_workers(tmp_path, monkeypatch) -> None:
    written, program = tmp_path / "written", tmp_path / "python"
    program.write_text(f"#!/bin/sh\n(while :; do echo >> {written}; sleep 0.05; done) &\nwait\n")
    program.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(program))
    monkeypatch.setattr(evidence, "LONGEST", 1.0)
    assert evidence.measure("vector")["failed"] == "took longer than 1 s"
    size = written.stat().st_size
    time.sleep(0.5)
    assert written.stat().st_size == size
