"""List the license of every dependency, and fail on a copyleft one.

    python -m tools.licenses

Checked are the core (`pip install .`) and the extras that users install, with all their dependencies. Development
tools are only listed: users of the package do not get them. Of the statements in the metadata (License-Expression,
License, classifiers) the strictest counts:

- permissive: passes;
- strong copyleft (GPL, AGPL, SSPL, EUPL, ...): fails, always;
- weak copyleft (LGPL, MPL, EPL, ...), parts under a copyleft license (by the license files that the package ships)
  and unknown: fail until `tools/licenses.toml` has the statement and a reason for accepting it.
"""

import re
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import IntEnum
from fnmatch import fnmatchcase
from importlib.metadata import Distribution, distributions
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
CORE, TOOLS = "core", frozenset({"test", "dev", "docs"})
PART = "parts under"

POLICY = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
PERMISSIVE = frozenset(name.lower() for name in POLICY["permissive"])
WEAK = re.compile(
    r"\bLGPL|lesser general public|\bMPL|mozilla public|\bEPL|eclipse public|\bCDDL", re.IGNORECASE
)
STRONG = re.compile(
    r"\bA?GPL|(?<!lesser )general public license|\bSSPL|\bEUPL|\bOSL-|\bCECILL(?!-B)|\bCC-BY-SA|copyleft",
    re.IGNORECASE,
)


class Kind(IntEnum):
    """Obligations of a license, from the least to the most."""

    PERMISSIVE = 0
    UNKNOWN = 1
    WEAK = 2
    STRONG = 3


@dataclass(frozen=True)
class Row:
    """One dependency.

    Attributes:
        name: of the distribution.
        version: installed; empty where it is not.
        groups: core and extras that depend on it.
        statements: of its metadata on its license.
        fault: why it is not acceptable, empty where it is.
    """

    name: str
    version: str
    groups: tuple[str, ...]
    statements: tuple[str, ...]
    fault: str = ""


def classify(statement: str) -> Kind:
    """Return the kind of a license name or of an SPDX expression (AND: all hold, OR: the user chooses)."""
    if statement.startswith(PART):
        return Kind.WEAK
    words = [
        re.sub(r"\s+WITH\s+.*", "", word).strip() for word in re.split(r"(\bAND\b|\bOR\b|[()])", statement)
    ]
    if not {"AND", "OR"} & set(words):
        return _classify_name(statement.strip())
    kind, rest = _read_choice([word for word in words if word])
    return Kind.UNKNOWN if rest else kind


def _read_choice(words: list[str]) -> tuple[Kind, list[str]]:
    kind, words = _read_union(words)
    while words[:1] == ["OR"]:
        other, words = _read_union(words[1:])
        kind = min(kind, other)
    return kind, words


def _read_union(words: list[str]) -> tuple[Kind, list[str]]:
    kind, words = _read_leaf(words)
    while words[:1] == ["AND"]:
        other, words = _read_leaf(words[1:])
        kind = max(kind, other)
    return kind, words


def _read_leaf(words: list[str]) -> tuple[Kind, list[str]]:
    if words[:1] == ["("]:
        kind, rest = _read_choice(words[1:])
        return kind, rest[1:]
    return (_classify_name(words[0]), words[1:]) if words else (Kind.UNKNOWN, [])


def _classify_name(name: str) -> Kind:
    if name.lower() in PERMISSIVE:
        return Kind.PERMISSIVE
    if STRONG.search(name):
        return Kind.STRONG
    return Kind.WEAK if WEAK.search(name) else Kind.UNKNOWN


def find_statements(distribution: Distribution) -> tuple[str, ...]:
    """Return the statements of the metadata on the license; of a whole text, its first line."""
    metadata = distribution.metadata
    fields = (
        metadata.get("License-Expression") or "",
        (metadata.get("License") or "").strip().split("\n")[0],
    )
    classifiers = (
        line.split(" :: ")[-1] for line in metadata.get_all("Classifier") or () if line.startswith("License")
    )
    parts = (f"{PART} {name}" for name in find_copyleft_files(distribution))
    return tuple(dict.fromkeys(one.strip() for one in (*fields, *classifiers, *parts) if one.strip()))


def find_copyleft_files(distribution: Distribution) -> list[str]:
    """Return the names of the license files next to the metadata that begin like a strong copyleft license."""
    files = [
        path
        for path in distribution.files or ()
        if re.search(r"dist-info/.*(licen[cs]e|copying)", str(path), re.I)
    ]
    return [path.name for path in files if STRONG.search(path.read_text().strip().split("\n")[0])]


def find_fault(name: str, statements: tuple[str, ...], reviewed: Mapping[str, Mapping[str, str]]) -> str:
    """Return why a dependency is not acceptable; empty where it is."""
    kinds = {statement: classify(statement) for statement in statements}
    known = [kind for kind in kinds.values() if kind != Kind.UNKNOWN]
    kind = max(known, default=Kind.UNKNOWN)
    if kind == Kind.STRONG:
        return "copyleft: replace it"
    entry = next((each for pattern, each in reviewed.items() if fnmatchcase(name, pattern)), {})
    is_reviewed = entry.get("reason") and fnmatchcase(" | ".join(statements), entry.get("statement", ""))
    if kind == Kind.PERMISSIVE or is_reviewed:
        return ""
    what = "weak copyleft" if kind == Kind.WEAK else "unknown license"
    return f"{what}: replace it, or accept it in tools/licenses.toml"


def find_groups(project: Mapping) -> dict[str, list[Requirement]]:
    """Return the requirements of the core and of each extra of a `pyproject.toml`."""
    tables = {CORE: project["dependencies"], **project.get("optional-dependencies", {})}
    return {name: [Requirement(line) for line in lines] for name, lines in tables.items()}


def find_dependencies(
    requirements: Iterable[Requirement], own: str, groups: Mapping[str, list[Requirement]], installed: Mapping
) -> Iterator[str]:
    """Yield the names of all direct and indirect dependencies of requirements."""
    seen: set[tuple[str, str]] = set()
    waiting = list(requirements)
    while waiting:
        requirement = waiting.pop()
        name = canonicalize_name(requirement.name)
        for extra in ("", *requirement.extras):
            if (name, extra) in seen:
                continue
            seen.add((name, extra))
            if name == own:
                waiting += groups[extra] if extra else []
                continue
            yield name
            lines = (installed[name].requires or []) if name in installed else []
            waiting += [
                r for r in map(Requirement, lines) if not r.marker or r.marker.evaluate({"extra": extra})
            ]


def check_licenses(
    root: Path = ROOT, path: list[str] | None = None, reviewed: Mapping = POLICY["reviewed"]
) -> list[Row]:
    """Check every dependency of a project.

    Args:
        root: folder with `pyproject.toml`.
        path: folders of installed distributions; `sys.path` unless given.
        reviewed: distribution, or a pattern as `nvidia-*` -> its statement on its license, likewise, and the reason
            for accepting it.
    """
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    installed = {str(canonicalize_name(d.name)): d for d in distributions(path=path or sys.path)}
    groups = find_groups(project)
    dependencies: dict[str, list[str]] = {}
    for group, requirements in groups.items():
        for name in dict.fromkeys(
            find_dependencies(requirements, canonicalize_name(project["name"]), groups, installed)
        ):
            dependencies.setdefault(name, []).append(group)
    return [
        _make_row(name, tuple(by), installed.get(name), reviewed) for name, by in sorted(dependencies.items())
    ]


def _make_row(name: str, by: tuple[str, ...], found: Distribution | None, reviewed: Mapping) -> Row:
    if found is None:
        return Row(name, "", by, (), "not installed: cannot be checked" if CORE in by else "")
    statements = find_statements(found)
    fault = "" if set(by) <= TOOLS else find_fault(name, statements, reviewed)
    return Row(name, found.version, by, statements, fault)


def main() -> None:
    """Print every dependency with its license; exit with 1 where one is not acceptable."""
    rows = check_licenses()
    for row in rows:
        statement = " | ".join(row.statements) or ("not installed" if not row.version else "no statement")
        print(f"{row.name:24} {row.version:12} {statement[:60]:60} {', '.join(row.groups)}")
    faults = [f"{row.name} ({' | '.join(row.statements)[:60]}): {row.fault}" for row in rows if row.fault]
    if faults:
        sys.exit("licenses:\n" + "\n".join(f"  {fault}" for fault in faults))
    absent = sum(not row.version for row in rows)
    print(
        f"licenses: {len(rows)} dependencies, {absent} of them not installed; no strong copyleft in core and extras"
    )


if __name__ == "__main__":
    main()
