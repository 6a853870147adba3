"""Detection with git of whether the code that a figure measures has changed since.

Only the code itself counts: each Python file is compared as a syntax tree without docstrings, so changes of comments
and formatting do not count. The present code is that of the working tree: a table made just before a commit is correct
after it.
"""

import ast
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from evolution.search.provenance import run_git

ROOT = Path(__file__).parents[1]


class Ages:
    """Compares the present code with that of earlier commits.

    Args:
        root: of a checkout with its whole history.
    """

    def __init__(self, root: Path) -> None:
        self._root = root
        self._find_changed = cache(self._list_changed)
        self._differs = cache(self._compare)

    def is_old(self, commit: str, sources: Sequence[str]) -> bool | None:
        """Return whether the code at these places differs from that of a commit.

        Args:
            commit: its hash.
            sources: folders or files from the root; "file.py::name" means that definition only.

        Returns:
            None if the history does not contain the commit.
        """
        changed = self._find_changed(commit)
        if changed is None:
            return None
        for source in sources:
            place, _, name = source.partition("::")
            paths = [path for path in changed if path == place or path.startswith(f"{place}/")]
            if any(self._differs(commit, path, name) for path in paths):
                return True
        return False

    def _list_changed(self, commit: str) -> list[str] | None:
        tracked = run_git(self._root, "diff", "--name-only", "--no-renames", "-z", commit, "--")
        added = run_git(self._root, "ls-files", "--others", "--exclude-standard", "-z")
        return None if tracked is None else [path for path in f"{tracked}\0{added}".split("\0") if path]

    def _compare(self, commit: str, path: str, name: str) -> bool:
        if path.endswith(".md"):
            return False
        file = self._root / path
        before = run_git(self._root, "show", f"{commit}:{path}")
        now = file.read_bytes().decode(errors="surrogateescape") if file.is_file() else None
        if before is None or now is None or not path.endswith(".py"):
            return True
        return normalize(before, name) != normalize(now, name)


def open_ages(root: Path = ROOT) -> Ages | None:
    """Return a comparison with earlier commits; None without git or without the whole history."""
    top, is_shallow = (
        run_git(root, "rev-parse", word) for word in ("--show-toplevel", "--is-shallow-repository")
    )
    return Ages(root) if top and Path(top).resolve() == root.resolve() and is_shallow == "false" else None


def normalize(code: str, name: str = "") -> str:
    """Return code without comments, docstrings and formatting.

    Args:
        code: of a Python file; other text is returned unchanged.
        name: of the only function, class or constant to keep; empty means all.
    """
    try:
        tree = ast.parse(code)
    except SyntaxError:
        return code
    if name:
        tree.body = [statement for statement in tree.body if name in _list_names(statement)]
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [statement for statement in node.body if not _is_text(statement)]
    return ast.dump(tree)


def _list_names(statement: ast.stmt) -> list[str]:
    if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return [statement.name]
    targets = statement.targets if isinstance(statement, ast.Assign) else [getattr(statement, "target", None)]
    return [
        node.id for target in targets if target for node in ast.walk(target) if isinstance(node, ast.Name)
    ]


def _is_text(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
