"""The PettingZoo environment of a swarm, `swarm_v0.parallel_env(...)`, and its worlds without PettingZoo."""

from typing import TYPE_CHECKING, Any

from reconstruction._src.base.extras import require_extras
from reconstruction._src.base.lazy import export_lazily

if TYPE_CHECKING:
    from symbrion_gym._src.swarm.dynamic.world import DynamicWorld
    from symbrion_gym._src.swarm.environment import SwarmEnv
    from symbrion_gym._src.swarm.kinematic.kinematic_world import KinematicWorld
    from symbrion_gym._src.swarm.world import SwarmCommands, SwarmState

__all__ = ["DynamicWorld", "KinematicWorld", "SwarmCommands", "SwarmEnv", "SwarmState", "parallel_env"]


def parallel_env(render_mode: str | None = None, **options: Any) -> "SwarmEnv":
    """Return a PettingZoo `ParallelEnv` of Scouts that sense, dock and part; see `SwarmEnv` for all options.

    Args:
        render_mode: "rgb_array" for images by `render()`, or None.
        options: of the environment, such as `arena="gsrm"`, `num_robots=8` and `fidelity="dynamic"`.

    Raises:
        MissingExtraError: pettingzoo is not installed.
        OptionError: an option is unknown or out of range.
        ArenaError: there is no such arena, or it has no pit or no room for so many robots.
    """
    require_extras("`swarm_v0.parallel_env`", "swarm")
    from symbrion_gym._src.swarm.environment import SwarmEnv

    return SwarmEnv(render_mode=render_mode, **options)


__getattr__, __dir__ = export_lazily(__name__)
