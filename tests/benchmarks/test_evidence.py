"""The evidence of a release: whole, and of the code that is released."""

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
