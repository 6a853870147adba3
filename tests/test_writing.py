"""Files are written by one function, `write_atomically`, and removed in few places, each known here."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("reconstruction", "symbrion_gym", "evolution", "benchmarks")
WRITER = "reconstruction/files/atomic_write.py"
FILES = [
    path
    for package in PACKAGES
    for path in sorted((ROOT / package).rglob("*.py"))
    if path.relative_to(ROOT).as_posix() != WRITER
]
METHODS = {
    *(
        "write_text",
        "write_bytes",
        "savez",
        "savez_compressed",
        "savetxt",
        "savefig",
        "tofile",
        "dump",
        "export",
    ),
    *("unlink", "rmdir", "rename", "touch", "symlink_to", "hardlink_to", "imwrite", "imsave", "get_writer"),
    *("rmtree", "move", "copy2", "copyfile", "copytree", "NamedTemporaryFile", "mkstemp", "mkdtemp"),
}
"""Methods and functions that write or remove a file, of whatever object."""
OF_MODULES = {("os", "replace"), ("os", "remove"), ("np", "save"), ("Image", "save"), ("shutil", "copy")}
"""Likewise, of these modules and classes alone: others have harmless methods of these names."""
ALLOWED = {
    ("symbrion_gym/arenas/saving.py", "unlink"): "files that the arena's manifest names",
    ("symbrion_gym/arenas/saving.py", "rmdir"): "folders of the arena that are empty",
    ("symbrion_gym/arenas/export/saving.py", "unlink"): "files that the export's manifest names",
    ("symbrion_gym/arenas/export/saving.py", "rmdir"): "the folder of pieces that is empty",
    ("evolution/cli/commands/export.py", "export"): "an arena, by its own method",
    ("evolution/search/run.py", "unlink"): "the four files of a run",
    ("symbrion_gym/contact/decomposition.py", "savez"): "into a temporary folder",
    ("symbrion_gym/contact/coacd_worker.py", "savez"): "into the same",
    ("evolution/report/video.py", "get_writer"): "into a temporary folder",
    ("benchmarks/material/c_gsrm.py", "savetxt"): "into a temporary folder",
    (
        "benchmarks/material/open3d_peer.py",
        "savez",
    ): "into a temporary folder, where this project is not installed",
    ("benchmarks/reconstruction.py", "save"): "into a temporary folder",
    ("benchmarks/ages.py", "dump"): "a syntax tree as text",
    ("evolution/cli/streams.py", "open"): "where output goes that nobody reads",
    ("reconstruction/files/bounded_read.py", "open"): "a member of an archive, for reading",
    ("reconstruction/tiles/buckets.py", "open"): "points of a tile, in a temporary folder",
    ("reconstruction/tiles/folder.py", "unlink"): "tiles of a former reconstruction",
    ("reconstruction/files/cache.py", "mkdtemp"): "a private cache where the shared one is not ours",
}


def _find_writes(source: str) -> list[tuple[int, str]]:
    """Return line and name of each call that writes or removes a file, other than through the writer."""
    tree = ast.parse(source)
    safe = _find_safe_names(tree)
    return [
        (call.lineno, name)
        for call in ast.walk(tree)
        if isinstance(call, ast.Call) and (name := _name_write(call)) and not _names(call) & safe
    ]


def _name_write(call: ast.Call) -> str | None:
    """Return what a call is named, if it writes or removes."""
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    owners = _names(call.func.value) if isinstance(call.func, ast.Attribute) else set()
    if name == "open" and "Image" not in owners:
        modes = [value for each in _find_modes(call) if isinstance(value := getattr(each, "value", "w"), str)]
        return name if any(set(mode) & set("wax+") for mode in modes) else None
    is_write = name in METHODS or any((owner, name) in OF_MODULES for owner in owners)
    return name if is_write else None


def _find_modes(call: ast.Call) -> list[ast.expr]:
    position = 0 if isinstance(call.func, ast.Attribute) and _names(call.func.value) != {"os"} else 1
    return [
        *call.args[position : position + 1],
        *(each.value for each in call.keywords if each.arg == "mode"),
    ]


def _find_safe_names(tree: ast.AST) -> set[str]:
    """Return the names of files beside, of files opened there, of buffers, and of open files that were passed."""
    safe = {"file"}
    for node in ast.walk(tree):
        if isinstance(node, ast.With):
            for item in node.items:
                if _names(item.context_expr) & {"write_atomically", *safe} and item.optional_vars is not None:
                    safe |= _names(item.optional_vars)
        if isinstance(node, ast.Assign) and _names(node.value) & {"BytesIO", "StringIO"}:
            safe |= {name for target in node.targets for name in _names(target)}
    return safe


def _names(node: ast.AST) -> set[str]:
    found = {each.id for each in ast.walk(node) if isinstance(each, ast.Name)}
    return found | {each.attr for each in ast.walk(node) if isinstance(each, ast.Attribute)}


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_files_are_written_by_the_one_writer(path: Path) -> None:
    place = path.relative_to(ROOT).as_posix()
    direct = [(line, name) for line, name in _find_writes(path.read_text()) if (place, name) not in ALLOWED]
    assert not direct, f"{place} goes past write_atomically: {direct}"


@pytest.mark.parametrize(
    "source",
    [
        "path.write_text(text)",
        "open(path, 'w').write(text)",
        "path.open(mode='ab')",
        "open(path, chosen)",
        "np.savez(path, a=a)",
        "np.save(path, a)",
        "Image.fromarray(pixels).save(path)",
        "os.replace(a, b)",
        "shutil.rmtree(folder)",
        "path.unlink()",
        "with write_atomically(path) as beside:\n    other.write_text(text)",
    ],
)
def test_direct_writes_are_seen(source: str) -> None:
    assert _find_writes(source)


@pytest.mark.parametrize(
    "source",
    [
        "open(path)",
        "path.open('rb')",
        "text.replace('a', 'b')",
        "arena.save(folder)",
        "buffer = io.BytesIO()\nnp.savez(buffer, a=a)",
        "with write_atomically(path) as beside:\n    beside.write_text(text)",
        "with write_atomically(path) as beside, beside.open('wb') as out:\n    np.savez(out, a=a)",
    ],
)
def test_what_is_harmless_passes(source: str) -> None:
    assert not _find_writes(source)


def test_every_exception_is_needed() -> None:
    found = {
        (place, name)
        for path in FILES
        for _, name in _find_writes(path.read_text())
        if (place := path.relative_to(ROOT).as_posix())
    }
    assert set(ALLOWED) == found
