"""Optional dependencies: which modules each extra brings, and what to say where one is missing."""

from importlib.util import find_spec

EXTRAS: dict[str, tuple[str, ...]] = {
    "cli": ("rich", "tyro"),
    "scan": ("small_gicp",),
    "report": ("imageio", "imageio_ffmpeg", "jinja2", "markupsafe", "matplotlib", "PIL", "plotly"),
}
"""Extra -> the modules that it brings; `pyproject.toml` lists the same as distributions."""


class MissingExtraError(RuntimeError):
    """Something was asked for that needs an optional dependency; the message says how to install it."""


def require_extras(purpose: str, *extras: str) -> None:
    """Refuse in one line, before any work is done, what the installed packages cannot do.

    Args:
        purpose: what needs the extras, as the beginning of a sentence: "`symbrion demo`".
        extras: names of extras.

    Raises:
        MissingExtraError: a module of one of these extras is not installed.
    """
    absent = {name: gone for name in extras if (gone := [m for m in EXTRAS[name] if find_spec(m) is None])}
    if absent:
        names = " and ".join(f"'{name}'" for name in absent)
        modules = ", ".join(module for gone in absent.values() for module in gone)
        raise MissingExtraError(
            f"{purpose} needs the extra{'s' * (len(absent) > 1)} {names} (not installed: {modules}): "
            f"pip install 'symbrion-gym[{','.join(absent)}]'"
        )
