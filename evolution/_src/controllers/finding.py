"""Controllers by what names them: a law of ours, an object, a class, a function, "module:name", or a record."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from evolution._src.controllers.controller import CONTROLLERS, OwnController, make_law
from evolution._src.controllers.protocol import CheckedController, Controller
from evolution._src.controllers.source import (
    ControllerSource,
    find_source,
    import_path,
    make_from,
    read_source,
)
from evolution._src.errors import RunError
from reconstruction._src.base.range_checks import check_choice

if TYPE_CHECKING:
    from symbrion_gym._src.robot.organism import Organism

FIRST_VERSION = "1"  # Version of laws before they had one: records of these hold their name alone


def find_controller(spec: Any, organism: Organism, num_tracks: int = 0) -> Controller:
    """Return the controller that something names, for a body.

    Args:
        spec: name of a law of ours, of `CONTROLLERS`; an object that follows `Controller`; a class or function of the
            organism that returns one (it also gets `num_tracks` if it has a parameter of that name); "module:name" of
            any of these; what `refer_to_controller` returned.
        organism: body that it moves.
        num_tracks: number of track speeds in an action: 0 with the option `track_control` "constant", 1 with "body",
            one per module with "modules", two with "skid".

    Raises:
        RunError: there is no such controller, it does not suit the body, or it is not of the version recorded.
    """
    if isinstance(spec, str) and ":" not in spec:
        check_choice("controller", spec, CONTROLLERS, RunError)
        return make_law(spec, organism, num_tracks)
    if isinstance(spec, OwnController | CheckedController):
        return spec
    num_actions = len(organism.servos) + num_tracks
    if isinstance(spec, ControllerSource):
        return CheckedController(spec.make(organism, num_tracks), num_actions, spec)
    found = import_path(spec) if isinstance(spec, str) else spec
    what = spec if isinstance(spec, str) else getattr(spec, "__qualname__", type(spec).__qualname__)
    made = CheckedController(make_from(found, organism, num_tracks, what), num_actions, spec=spec)
    with suppress(RunError):
        made.source = find_source(spec, made.name, made.version)
    return made


def refer_to_controller(
    spec: Any, organism: Organism, num_tracks: int = 0, *, must_be_found: bool = False
) -> Any:
    """Return what stands for a controller in the configuration of a run and in jobs."""
    if isinstance(spec, Mapping):
        return _read_reference(spec)
    if isinstance(spec, ControllerSource):
        return spec
    if isinstance(spec, str) and ":" not in spec:
        check_choice("controller", spec, CONTROLLERS, RunError)
        return spec
    controller = find_controller(spec, organism, num_tracks)
    if isinstance(controller, OwnController):
        return controller.name
    reference = getattr(controller, "source", None)
    if must_be_found and reference is None:
        controller_to_json(controller)
    return reference or _require_hashable(spec)


def check_genotype(name: str, genotype: Sequence[float], controller: Controller) -> None:
    """Refuse a genotype that is not one of a controller."""
    if len(genotype) != len(controller.parameters):
        raise RunError(
            f"{name} has {len(genotype)} genes; {controller.name} has {len(controller.parameters)} for this body: "
            f"{', '.join(controller.parameters)}"
        )
    for gene, value, low, high in zip(
        controller.parameters, genotype, controller.lower, controller.upper, strict=True
    ):
        if not low <= value <= high:
            raise RunError(f"{name}: {gene} is {value:g}; {low:g} to {high:g} is needed")


def controller_to_json(controller: Any) -> str | dict[str, Any]:
    """Return what a record holds of a controller: its name and version, and of a user's where it is found."""
    if isinstance(controller, str) and ":" not in controller:
        check_choice("controller", controller, CONTROLLERS, RunError)
        return controller
    if isinstance(controller, OwnController):
        is_first = controller.version == FIRST_VERSION
        return controller.name if is_first else {"name": controller.name, "version": controller.version}
    if isinstance(controller, ControllerSource):
        return controller.as_dict()
    if isinstance(controller, CheckedController):
        source = controller.source or find_source(controller.spec, controller.name, controller.version)
        return source.as_dict()
    if isinstance(controller, str):
        raise RunError(f"controller {controller!r}: its version is not known; `find_controller` finds it")
    name, version = (str(getattr(controller, key, "?")) for key in ("name", "version"))
    return find_source(controller, name, version).as_dict()


def read_controller(
    content: Any,
    organism: Organism,
    num_tracks: int = 0,
    allow: Collection[str] = (),
) -> Controller:
    """Return the controller of a record."""
    if not isinstance(content, str | Mapping):
        raise RunError(f"controller is {content!r}; a name, or name, version and source are needed")
    reference = _read_reference(content) if isinstance(content, Mapping) else content
    if isinstance(reference, ControllerSource):
        reference = reference.allow(allow)
    return find_controller(reference, organism, num_tracks)


def _require_hashable(spec: Any) -> Any:
    try:
        hash(spec)
    except TypeError as error:
        raise RunError(f"controller {spec!r} cannot be hashed; make its dataclass frozen") from error
    return spec


def _read_reference(content: Mapping[str, Any]) -> str | ControllerSource:
    """Return the law or the source that a record describes, without importing anything."""
    name, version = content.get("name"), content.get("version")
    if "source" in content:
        return read_source(content)
    check_choice("controller", str(name), CONTROLLERS, RunError)
    if version != FIRST_VERSION:
        raise RunError(
            f"controller {name!r} is of version {FIRST_VERSION!r} here, the record of {version!r}; "
            "read it with the release that wrote it"
        )
    return str(name)
