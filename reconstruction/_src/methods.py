"""The networks by name: their modules, loaded at first use, and their configurations, also from a saved file."""

import dataclasses
import importlib
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from reconstruction._src.base.errors import ReconstructionError

if TYPE_CHECKING:
    from reconstruction._src.networks.growing_grid import growing_grid
    from reconstruction._src.networks.gsrm import gsrm

    NetworkConfig: TypeAlias = gsrm.GSRMConfig | growing_grid.GrowingGridConfig
    State: TypeAlias = gsrm.State | growing_grid.State

METHODS = {
    "gsrm": ("reconstruction._src.networks.gsrm.gsrm", "GSRMConfig"),
    "gg": ("reconstruction._src.networks.growing_grid.growing_grid", "GrowingGridConfig"),
}
"""Method -> the module of its network, which is loaded at first use, and the name of its configuration."""


def find_method(method: str) -> "tuple[Any, type[NetworkConfig]]":
    """Return the module of a method, with `State`, `train` and `train_again`, and its configuration."""
    if method not in METHODS:
        raise ReconstructionError(f"method must be one of {', '.join(map(repr, METHODS))}, got {method!r}")
    module, config = METHODS[method]
    network = importlib.import_module(module)
    return network, getattr(network, config)


def make_config(config_type: "type[NetworkConfig]", values: dict[str, Any]) -> "NetworkConfig":
    """Return the configuration; refuse names that it does not have."""
    known = {field.name for field in dataclasses.fields(config_type)}
    unknown = sorted(set(values) - known)
    if unknown:
        raise ReconstructionError(
            f"unknown option {', '.join(unknown)}; there are {', '.join(sorted(known))}"
        )
    units = values.get("units")
    if isinstance(units, bool) or not isinstance(units, int | np.integer):
        raise ReconstructionError(f"units must be a whole number, got {units!r}")
    return config_type(**values)
