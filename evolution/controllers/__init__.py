"""Control laws: from genotypes and sensor readings to hinge targets and track speeds."""

from typing import TYPE_CHECKING

from reconstruction.lazy import export_lazily

if TYPE_CHECKING:
    from evolution.controllers.finding import (
        controller_to_json,
        find_controller,
        read_controller,
        refer_to_controller,
    )
    from evolution.controllers.protocol import Controller, check_genotypes, reset_rows
    from evolution.controllers.source import ControllerSource

__all__ = [
    "Controller",
    "ControllerSource",
    "check_genotypes",
    "controller_to_json",
    "find_controller",
    "read_controller",
    "refer_to_controller",
    "reset_rows",
]

__getattr__, __dir__ = export_lazily(__name__)
