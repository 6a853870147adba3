"""Let the tests check the shapes that annotations promise: functions with jaxtyping annotations, and no others.

Only arguments and results whose annotation names an array are checked; the rest is pyright's business. Of a function
that is called often, the first calls are checked and some of the rest. Worker processes are not checked.
"""

import ast
import functools
import itertools
import re
import sys
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from typing import Any, get_args

import jaxtyping
from beartype import beartype

PACKAGES = ("reconstruction", "symbrion_gym", "evolution")
ALL_OF, ONE_OF = 200, 50  # The first calls of a function are all checked, of later ones each fiftieth
ARRAYS = {"Bool", "Float", "Float32", "Float64", "Int", "Integer", "Num", "Shaped", "UInt", "UInt8"}
ALIASES = {"Angles", "Cells", "Chosen", "Corner", "Corners", "Depths", "Direction", "Directions"}
ALIASES |= {"Faces", "Grid", "Halfspaces", "Keys", "Marks", "Mask", "Normals", "Numbers"}
ALIASES |= {"Offsets", "Pairs", "Picture", "Points", "Population", "Pose", "Positions", "Ranges"}
ALIASES |= {"Readings", "Rows", "Samples", "Triangles", "Units", "Vectors", "Vertices", "Waypoints"}
"""Names of such arrays."""


def check_shapes(function: Any) -> Any:
    """Return the function with checks of those of its arguments and results that are arrays."""
    names = vars(sys.modules[function.__module__])
    hints = {name: _evaluate(hint, names) for name, hint in function.__annotations__.items()}
    function.__annotations__ = {name: hint for name, hint in hints.items() if _is_array(hint)}
    checked, calls = jaxtyping.jaxtyped(function, typechecker=beartype), itertools.count()

    @functools.wraps(function)
    def check_some(*arguments: Any, **options: Any) -> Any:
        number = next(calls)
        is_checked = number < ALL_OF or number % ONE_OF == 0
        return (checked if is_checked else function)(*arguments, **options)

    return check_some


def install() -> None:
    """Check the packages from now on; what is imported already is not."""
    sys.meta_path.insert(0, _Finder())


def _evaluate(hint: Any, names: dict[str, Any]) -> Any:
    """Return what an annotation means; one that names what is imported for type checkers alone means nothing."""
    if not isinstance(hint, str):
        return hint
    try:
        return eval(hint, names)
    except NameError:
        return None


def _is_array(hint: Any) -> bool:
    if isinstance(hint, type) and issubclass(hint, jaxtyping.AbstractArray):
        return True
    return any(map(_is_array, get_args(hint)))


class _Loader(SourceFileLoader):
    def source_to_code(self, data: Any, path: Any, *, _optimize: int = -1) -> Any:
        tree = ast.parse(data)
        chosen = [node for node in ast.walk(tree) if _has_array(node)]
        for node in chosen:
            node.decorator_list.append(ast.copy_location(_DECORATOR, node))
        if chosen:
            place = next((i for i, node in enumerate(tree.body) if not _comes_first(node)), len(tree.body))
            tree.body.insert(place, ast.copy_location(_IMPORT, tree.body[max(place - 1, 0)]))
            ast.fix_missing_locations(tree.body[place])
        return compile(tree, path, "exec", dont_inherit=True, optimize=_optimize)

    def get_code(self, fullname: str) -> Any:
        """Compile each time what has checks: bytecode on disk has none, and this shall not get there."""
        path = self.get_filename(fullname)
        source = self.get_data(path)
        if not _NAMES.search(source):
            return super().get_code(fullname)
        return self.source_to_code(source, path)


class _Finder(MetaPathFinder):
    def find_spec(self, fullname: str, path: Any, target: Any = None) -> ModuleSpec | None:
        if fullname.split(".")[0] not in PACKAGES:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = _Loader(spec.loader.name, spec.loader.path)
        return spec


_NAMES = re.compile(rf"\b({'|'.join(ARRAYS | ALIASES)})\b".encode())
_DECORATOR = ast.Name("_check_shapes", ast.Load())
_IMPORT = ast.ImportFrom("shape_checks", [ast.alias("check_shapes", "_check_shapes")], 0)


def _has_array(node: ast.AST) -> bool:
    if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        return False
    arguments = [
        *node.args.posonlyargs,
        *node.args.args,
        *node.args.kwonlyargs,
        node.args.vararg,
        node.args.kwarg,
    ]
    hints = [node.returns, *(each.annotation for each in arguments if each)]
    return any(
        isinstance(part, ast.Name) and part.id in ARRAYS | ALIASES
        for hint in hints
        if hint
        for part in ast.walk(hint)
    )


def _comes_first(node: ast.stmt) -> bool:
    is_docstring = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    return is_docstring or (isinstance(node, ast.ImportFrom) and node.module == "__future__")
