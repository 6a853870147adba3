"""Options of an environment that concern the body, and how they go together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, cast

from symbrion_gym._src.errors import OptionError
from symbrion_gym._src.robot.scout_constants import ScoutConfig

if TYPE_CHECKING:
    from symbrion_gym._src.robot.organism import Organism

SCOUT_OPTIONS = ("hinge_torque", "track_speed", "tracks", "friction")
"""Options that are constants of the modules too."""
_DEFAULTS = {entry.name: entry.default for entry in fields(ScoutConfig)}


def check_organism_options(given: Mapping[str, Any]) -> None:
    """Refuse options that contradict each other."""
    if given.get("modules") is not None and given.get("organism") is not None:
        raise OptionError("the options 'modules' and 'organism' both name the body; give one of them")
    for body in (given.get("modules"), given.get("organism")):
        if body is not None and hasattr(body, "scout"):  # an `Organism`, whose module takes long to load
            wanted = {name: given[name] for name in SCOUT_OPTIONS if given.get(name) is not None}
            apply_options(cast("Organism", body), wanted)


def apply_options(organism: Organism, wanted: Mapping[str, Any]) -> Organism:
    """Return an organism whose modules have the constants that options name."""
    scout = organism.scout
    for name, value in wanted.items():
        own = getattr(scout, name)
        if own not in (_DEFAULTS[name], value):
            raise OptionError(
                f"{name}={value!r} contradicts {name}={own!r} of the organism's modules; give one of them"
            )
    return replace(organism, scout=replace(scout, **wanted)) if wanted else organism
