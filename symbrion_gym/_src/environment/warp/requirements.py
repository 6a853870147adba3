"""What MuJoCo Warp needs: the extra `gpu`, a device, and models without the flag that it does not know."""

from __future__ import annotations

from typing import Any

import mujoco

from reconstruction._src.base.extras import require_extras
from symbrion_gym._src.errors import OptionError


def import_warp() -> tuple[Any, Any]:
    """Return the modules `warp` and `mujoco_warp`, which print nothing from now on."""
    require_extras("backend 'warp'", "gpu")
    import warp

    warp.config.log_level = max(warp.config.log_level, warp.LOG_ERROR)
    import mujoco_warp

    return warp, mujoco_warp


def find_device(warp: Any, name: str | None) -> Any:
    """Return a device of Warp."""
    known = {each.alias: each for each in warp.get_devices()}
    if name is None:
        name = next((alias for alias in known if alias.startswith("cuda")), "cpu")
    name = "cuda:0" if name == "cuda" else name
    if name not in known:
        raise OptionError(f"there is no device {name!r} for backend 'warp'; there are: {', '.join(known)}")
    return known[name]


def prepare_model(model: mujoco.MjModel) -> mujoco.MjModel:
    """Return a copy of a model without the flag AUTORESET, which Warp neither knows nor needs: it never resets."""
    copy = model.__copy__()
    copy.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    return copy
