"""Optional dependencies: which modules each extra brings, and the error where one is missing."""

from importlib.util import find_spec

from reconstruction._src.base.errors import ReconstructionPackageError

EXTRAS: dict[str, tuple[str, ...]] = {
    "cli": ("rich", "tyro"),
    "formats": ("PIL", "collada", "laspy", "lazrs", "pye57", "rosbags"),
    "objects": ("cv2",),
    "scan": ("small_gicp",),
    "report": ("imageio", "imageio_ffmpeg", "jinja2", "markupsafe", "matplotlib", "PIL", "plotly"),
    "usd": ("pxr",),
    "rl": ("stable_baselines3", "torch"),
    "ribs": ("ribs",),
    "swarm": ("pettingzoo",),
    "gpu": ("mujoco_warp", "warp"),
}
"""Extra -> the modules that it brings; `pyproject.toml` lists the same as distributions."""


class MissingExtraError(ReconstructionPackageError, RuntimeError):
    """An optional dependency is not installed; the message says how to install it."""


def find_missing(extra: str) -> list[str]:
    """Return the modules of an extra that are not installed."""
    return [module for module in EXTRAS[extra] if find_spec(module) is None]


def require_extras(purpose: str, *extras: str) -> None:
    """Refuse in one line, before any work is done, what needs packages that are not installed."""
    missing = {name: found for name in extras if (found := find_missing(name))}
    if missing:
        names = " and ".join(f"'{name}'" for name in missing)
        modules = ", ".join(module for found in missing.values() for module in found)
        raise MissingExtraError(
            f"{purpose} needs the extra{'s' * (len(missing) > 1)} {names} (not installed: {modules}): "
            f"pip install 'symbrion-gym[{','.join(missing)}]'"
        )
