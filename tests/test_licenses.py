"""No copyleft license comes into the core or into an extra of users, whatever part of the metadata tells of it."""

import re
import shutil
from pathlib import Path

import pytest

from tools.licenses import POLICY, Kind, check_licenses, classify

PERMISSIVE_CLASSIFIER = "Classifier: License :: OSI Approved :: MIT License"
GPL_CLASSIFIER = "Classifier: License :: OSI Approved :: GNU General Public License v3 or later (GPLv3+)"
MPL_CLASSIFIER = "Classifier: License :: OSI Approved :: Mozilla Public License 2.0 (MPL 2.0)"


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A project whose core is `direct`, whose extra is `plots`, and whose tools are `tester`."""
    (tmp_path / "pyproject.toml").write_text(
        """[project]
name = "project"
dependencies = ["direct>=1"]
[project.optional-dependencies]
extra = ["plots"]
dev = ["project[extra]", "tester"]
"""
    )
    for name in ("direct", "plots", "tester"):
        install(tmp_path, name, "License-Expression: MIT")
    return tmp_path


def install(folder: Path, name: str, *lines: str, files: dict[str, str] | None = None) -> None:
    """Write the metadata of an installed distribution, with license files beside them."""
    info = folder / f"{name}-1.0.dist-info"
    (info / "licenses").mkdir(parents=True, exist_ok=True)
    (info / "METADATA").write_text(
        "\n".join(["Metadata-Version: 2.4", f"Name: {name}", "Version: 1.0", *lines, ""])
    )
    for file, text in (files or {}).items():
        (info / "licenses" / file).write_text(text)
    (info / "RECORD").write_text("".join(f"{info.name}/licenses/{file},,\n" for file in files or {}))


def find_faults(project: Path, reviewed: dict | None = None) -> dict[str, str]:
    return {
        row.name: row.fault for row in check_licenses(project, [str(project)], reviewed or {}) if row.fault
    }


def test_permissive_dependencies_pass(project: Path) -> None:
    assert find_faults(project) == {}
    assert {row.name: row.groups for row in check_licenses(project, [str(project)], {})} == {
        "direct": ("core",),
        "plots": ("extra", "dev"),
        "tester": ("dev",),
    }


@pytest.mark.parametrize(
    "lines",
    [
        ["License-Expression: GPL-3.0-or-later"],
        ["License: GNU GENERAL PUBLIC LICENSE", PERMISSIVE_CLASSIFIER],
        ["License: MIT", GPL_CLASSIFIER],
        ["License-Expression: MIT AND (AGPL-3.0-only OR GPL-2.0-only)"],
    ],
)
@pytest.mark.parametrize("name", ["direct", "plots"])
def test_strong_copyleft_fails_wherever_it_is_told(project: Path, name: str, lines: list[str]) -> None:
    install(project, name, *lines)
    statement = " | ".join(
        row.statements[0] for row in check_licenses(project, [str(project)], {}) if row.name == name
    )
    assert find_faults(project, {name: {"statement": statement, "reason": "we like it"}}) == {
        name: "copyleft: replace it"
    }


def test_indirect_dependencies_are_checked(project: Path) -> None:
    install(
        project,
        "direct",
        "License: MIT",
        'Requires-Dist: deep; python_version >= "3"',
        "Requires-Dist: no; extra == 'x'",
    )
    install(project, "deep", GPL_CLASSIFIER)
    assert find_faults(project) == {"deep": "copyleft: replace it"}


def test_tools_of_developers_are_listed_and_not_checked(project: Path) -> None:
    install(project, "tester", GPL_CLASSIFIER)
    assert find_faults(project) == {}
    assert any(
        row.name == "tester" and "GPLv3+" in row.statements[0]
        for row in check_licenses(project, [str(project)], {})
    )


@pytest.mark.parametrize(
    ("lines", "fault"),
    [
        ([MPL_CLASSIFIER], "weak copyleft"),
        (["License: see the file"], "unknown license"),
        ([], "unknown license"),
    ],
)
def test_weak_copyleft_and_unknown_need_a_reason(project: Path, lines: list[str], fault: str) -> None:
    install(project, "direct", *lines)
    assert find_faults(project)["direct"].startswith(fault)
    (statement,) = (
        " | ".join(row.statements)
        for row in check_licenses(project, [str(project)], {})
        if row.name == "direct"
    )
    assert find_faults(project, {"direct": {"statement": statement, "reason": "only its own files"}}) == {}
    assert find_faults(project, {"dir*": {"statement": f"{statement[:3]}*", "reason": "several alike"}}) == {}
    assert find_faults(project, {"direct": {"statement": statement}})["direct"].startswith(fault)
    assert find_faults(project, {"direct": {"statement": "another", "reason": "old"}})["direct"].startswith(
        fault
    )


def test_copyleft_parts_are_seen_by_their_license_file(project: Path) -> None:
    install(project, "direct", "License: MIT", files={"LICENSE.GPL": "GNU GENERAL PUBLIC LICENSE\nVersion 3"})
    assert find_faults(project)["direct"].startswith("weak copyleft")


def test_core_that_is_not_installed_fails(project: Path) -> None:
    shutil.rmtree(project / "direct-1.0.dist-info")
    assert find_faults(project) == {"direct": "not installed: cannot be checked"}


@pytest.mark.parametrize(
    ("statement", "kind"),
    [
        ("Apache-2.0 OR BSD-2-Clause", Kind.PERMISSIVE),
        ("BSD-3-Clause AND 0BSD AND MIT AND Zlib AND CC0-1.0", Kind.PERMISSIVE),
        ("MIT OR GPL-3.0-only", Kind.PERMISSIVE),
        ("LGPL-3.0-or-later", Kind.WEAK),
        ("GNU Lesser General Public License v3 (LGPLv3)", Kind.WEAK),
        ("MIT AND MPL-2.0", Kind.WEAK),
        ("GPL-2.0-only WITH Classpath-exception-2.0", Kind.STRONG),
        ("GNU Affero General Public License v3", Kind.STRONG),
        ("GPLv2", Kind.STRONG),
        ("MIT AND (", Kind.UNKNOWN),
        ("Copyright (c) 2015, someone", Kind.UNKNOWN),
    ],
)
def test_kinds_of_licenses(statement: str, kind: Kind) -> None:
    assert classify(statement) == kind


def test_each_review_gives_its_reason() -> None:
    assert all(
        re.search(r"\w+ \w+", entry["reason"]) and "statement" in entry
        for entry in POLICY["reviewed"].values()
    )
